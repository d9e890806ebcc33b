"""What of the contract a check can be tried on: with this robot, and with the permission that was given."""

from collections.abc import Callable, Sequence
from http import HTTPStatus

from conformance.api.rest.calls import Call, example_call
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.validity import require_valid
from conformance.documents.json_schema import kind_of
from conformance.documents.openapi import Operation, operations_of

NO_MOTION = "it moves the robot, and --allow-motion was not given"


def reads(api: RestInterface) -> list[Call]:
    """A valid request for each operation that only reads, the optional ones last."""
    found = [item for item in operations_of(api.run.contract) if item.method == "GET" and allowed(api, item)]
    return [readable(api, item) for item in sorted(found, key=lambda item: item.optional)]


def readable(api: RestInterface, operation: Operation) -> Call:
    """A request for an operation that reads, which is answered 200 if any is.

    Where the contract's example makes no sense to this robot (a place outside its map), small numbers are tried.

    Raises:
        HarnessError: what was made is not valid by the contract.
    """
    call = example_call(api, operation)
    numbers = [item.name for item in operation.parameter("query") if kind_of(item.schema) in {"number", "integer"}]
    required = [item.name for item in operation.parameter("query") if item.name in numbers and item.required]
    if not required:
        return call
    if operation.id not in api.small_numbers:
        api.small_numbers[operation.id] = ""
        for text in ("", "0", "1", "0.5"):
            answer = _with(call, required, text).send(api).response
            if answer.ok:
                api.small_numbers[operation.id] = text
                break
    found = _with(call, required, api.small_numbers[operation.id])
    require_valid(api.run.contract, operation.method, found.path)
    return found


def _with(call: Call, names: list[str], text: str) -> Call:
    for name in names if text else ():
        call = call.having(name, text)
    return call


def answered(api: RestInterface) -> list[Call]:
    """Those of reads() that are answered 200 as things are: a robot may lack an extension, or have no goal."""
    found = []
    for call in reads(api):
        answer = call.send(api).response
        if answer.status == HTTPStatus.OK:
            found.append(call)
    return found


def allowed(api: RestInterface, operation: Operation) -> bool:
    """Whether the operation may be sent in this run."""
    return api.run.allow_motion or not operation.motion


def applicable_operations(
    api: RestInterface, ids: Sequence[str], wanted: Callable[[Operation], bool], what: str
) -> list[Operation]:
    """The operations that a check is about.

    Where the contract has none, its requirements do not apply; where none may be sent, they are skipped. Requirements
    that other checks judge as well are left as they are.

    Args:
        api: the robot's REST interface.
        ids: of the requirements that depend on it.
        wanted: picks the operations.
        what: says what they are: "takes JSON".
    """
    found = [item for item in operations_of(api.run.contract) if wanted(item)]
    usable = [item for item in found if allowed(api, item)]
    for id_ in ids if not usable else ():
        if found:
            api.run.judge.skip(id_, NO_MOTION)
        else:
            api.run.judge.unclaimed(id_, f"the contract has no operation that {what}")
    return api.run.effort.subsample(usable, 2)
