"""The operations of the contract that a check can use with this robot and the run's permissions."""

from collections.abc import Callable, Sequence
from http import HTTPStatus
from urllib.parse import urlsplit

from conformance.api.rest.calls import Call, example_call
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.validity import require_valid
from conformance.documents.json_schema import kind_of
from conformance.documents.openapi import Operation, is_json, operations_of
from conformance.documents.wsdl_pack import own_wsdl

# Number of operations that the checks of HTTP read.
_READS = 8
NO_MOTION = "it moves the robot, and --allow-motion was not given"


def reads(api: RestInterface, most: int = _READS) -> list[Call]:
    """Return valid requests for operations that read, the optional ones last: a few show how a server speaks HTTP.

    Those that the survey found to answer 2xx come first, of these the ones that never took a second. A response that
    does not end is none that two can share.
    """
    found = [item for item in operations_of(api.run.contract) if item.method == "GET" and allows(api, item)]
    if own := _wsdl_path(api):
        return [Call(Operation("the WSDL", "GET", own))]
    ranked = sorted(
        (item for item in found if item.label not in api.streams),
        key=lambda item: (item.optional, item.label not in api.working, item.label in api.slow, len(item.parameters)),
    )
    return [api.working.get(item.label) or readable(api, item) for item in ranked[:most]]


def _wsdl_path(api: RestInterface) -> str:
    """Return the path below the base URL of the WSDL that a SOAP device serves; empty where it serves none."""
    url = urlsplit(own_wsdl(api.run.contract))
    is_own = url.netloc == api.client.authority and url.path.startswith(f"{api.client.prefix}/")
    return url._replace(scheme="", netloc="").geturl().removeprefix(api.client.prefix) if is_own else ""


def readable(api: RestInterface, operation: Operation) -> Call:
    """Return a request for a read-only operation, with parameters that this robot accepts if possible.

    If the robot rejects the description's example (a place outside its map), small numbers are tried. The first call
    for an operation sends up to four requests.

    Raises:
        HarnessError: the generated request is invalid by the contract.
    """
    call = example_call(api, operation)
    plain = [item for item in operation.parameter("query") if item.required and not is_json(item.media_type)]
    required = [item.name for item in plain if kind_of(item.schema) in {"number", "integer"}]
    if not required:
        return call
    if operation.id not in api.small_numbers:
        texts = ("", "0", "1", "0.5")
        accepted = (text for text in texts if _with(call, required, text).send(api).response.ok)
        api.small_numbers[operation.id] = next(accepted, "")
    found = _with(call, required, api.small_numbers[operation.id])
    require_valid(api.run.contract, operation.method, found.path)
    return found


def _with(call: Call, names: list[str], text: str) -> Call:
    for name in names if text else ():
        call = call.having(name, text)
    return call


def working_reads(api: RestInterface, *ids: str, most: int = _READS) -> list[Call]:
    """Send the requests of reads(), up to a number, and return those answered 200: a robot may lack an extension.

    What can be deleted is left out if there is anything else: a robot's own goal may end between two requests. If there
    is nothing at all, add a note to the requirements.
    """
    deletable = {item.template for item in operations_of(api.run.contract) if item.method == "DELETE"}
    all_found = [call for call in reads(api, most) if call.send(api).response.status == HTTPStatus.OK]
    found = [call for call in all_found if call.operation.template not in deletable] or all_found
    for id_ in ids if not found else ():
        api.run.judge.note(id_, "no operation that only reads got status 200")
    return found


def allows(api: RestInterface, operation: Operation) -> bool:
    """Return whether the operation may be sent in this run."""
    return api.call_rules.decide(operation).may


def callable_operations(api: RestInterface) -> dict[tuple[str, str], Operation]:
    """Return the operations that may be sent and whose responses end, by method and path without a slash at its end."""
    found = (
        operation
        for operation in operations_of(api.run.contract)
        if allows(api, operation) and operation.label not in api.streams
    )
    return {(operation.method, operation.template.rstrip("/")): operation for operation in found}


def usable_operations(api: RestInterface, wanted: Callable[[Operation], bool]) -> list[Operation]:
    """Return the operations that ``wanted`` selects and this run may send; for a slow robot, a few of them."""
    usable = [item for item in operations_of(api.run.contract) if wanted(item) and allows(api, item)]
    return api.run.effort.subsample(usable, 2)


def record_unusable(api: RestInterface, ids: Sequence[str], wanted: Callable[[Operation], bool], what: str) -> None:
    """Record why requirements cannot be judged if this run may not send any of the operations.

    Without such operations in the contract, the requirements do not apply; without permission, they are not tested.
    """
    found = [item for item in operations_of(api.run.contract) if wanted(item)]
    for id_ in ids if not any(allows(api, item) for item in found) else ():
        if found:
            api.run.judge.skip(id_, NO_MOTION)
        else:
            api.run.judge.note_unclaimed(id_, f"the contract has no operation that {what}")


def applicable_operations(
    api: RestInterface, ids: Sequence[str], wanted: Callable[[Operation], bool], what: str
) -> list[Operation]:
    """Return the operations that a check uses, after recording why there are none.

    Args:
        api: the robot's REST interface.
        ids: the requirements that only these operations can show.
        wanted: selects the operations.
        what: describes them: "takes JSON".
    """
    record_unusable(api, ids, wanted, what)
    return usable_operations(api, wanted)
