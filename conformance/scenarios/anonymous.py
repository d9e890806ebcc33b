"""Requests without credentials, and with wrong ones, to operations for which the description requires some."""

from collections.abc import Iterator
from contextlib import ExitStack, closing, suppress
from dataclasses import replace
from typing import Final
from urllib.parse import quote

from conformance.api.rest.applicable import allows, callable_operations
from conformance.api.rest.inputs import request_of, usual_inputs
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.stranger import Stranger
from conformance.api.rest.things import collection_of, path_chosen
from conformance.api.rest.values import Values
from conformance.documents.openapi import Operation, operations_of
from conformance.documents.security import demands
from conformance.scenarios.creating import created_path
from conformance.scenarios.reaching import WANTS_CONDITION
from conformance.scenarios.scenario import NotPossibleError, scenario
from conformance.scenarios.stage import Leaves, Need, Stage
from conformance.scenarios.survey import Surveyor
from conformance.scenarios.writing import Writer
from conformance.transport.client import HttpClient
from conformance.transport.exchange import Exchange, NoAnswerError, Outgoing

# Statuses about the resource, which a device may send before it checks credentials.
_UNDECIDED: Final = frozenset({404, 409, 410})
# Statuses by which a device says that there is a new thing, or a job that has begun.
_MAY_BE_CREATED: Final = frozenset({200, 201, 202})
# Operations of a slow device that are sent without credentials on a connection that has carried credentials.
_KEPT: Final = 3
_NEVER: Final = 97  # number for an identifier that nobody creates
_ABSENT: Final = "roaas-is-not-there"


@scenario(needs={Need.REST}, leaves=Leaves.UNTOUCHED, stage=Stage.LAST)
def anonymous_requests(api: RestInterface, values: Values) -> tuple[Exchange, ...]:
    """Send each operation for which the description requires credentials, without any, and with wrong ones."""
    closed = [
        item
        for item in operations_of(api.run.contract)
        if demands(api.run.contract.openapi, item) and allows(api, item)
    ]
    if not closed:
        raise NotPossibleError("no operation that may be called requires credentials by the description")
    found = []
    own = api.client.connection.credentials
    with ExitStack() as stack:
        unknown, *nearly = (stack.enter_context(closing(Stranger(api, wrong))) for wrong in (own.wrong, *own.nearly))
        for number, operation in enumerate(closed):
            # Nearly right credentials are used in rotation, all of them at least once.
            near = nearly[number % len(nearly) :: len(closed)] if nearly else []
            tried: list[tuple[HttpClient | Stranger, bool]] = [(api.client, False)]
            tried += [(stranger, True) for stranger in ([unknown, *near] if own else [])]
            if operation.label in api.streams:
                continue
            request = request_of(operation, usual_inputs(operation, values)[0])
            for client, authorized in tried:
                with suppress(NoAnswerError):  # the survey reports a missing response
                    exchange = _send(client, request, authorized=authorized)
                    if exchange and exchange.response.status in WANTS_CONDITION:
                        # The condition was looked at before the credentials, or these were not looked at.
                        tag = api.client.send("GET", request.target).response.header("etag") or "*"
                        exchange = _send(
                            client,
                            replace(request, headers=(*request.headers, ("If-Match", tag))),
                            authorized=authorized,
                        )
                    found += [exchange] if exchange else []
                    if exchange and operation.method == "GET" and not authorized and not exchange.response.ok:
                        found.append(api.client.send("HEAD", request.target, authorized=False, fresh=True))
                    if exchange and exchange.response.status in _UNDECIDED:
                        found += _on_new_thing(Surveyor(api, values), operation, request, client, authorized=authorized)
        # An error of another request does not come from the wrong credentials before it.
        reads = [one for (method, _), one in callable_operations(api).items() if method == "GET"]
        absent = (path_chosen(one, _NEVER) for one in reads if one.parameter("path"))
        with suppress(NoAnswerError):
            api.client.send("GET", next(filter(None, absent), f"/{_ABSENT}"))
    return (*found, *_on_kept_connection(api, values, closed), *_beyond_ascii(api, values, closed))


def _send(client: HttpClient | Stranger, request: Outgoing, *, authorized: bool) -> Exchange | None:
    return client.send(
        request.method, request.target, headers=request.headers, body=request.body, authorized=authorized, fresh=True
    )


def _on_kept_connection(api: RestInterface, values: Values, closed: list[Operation]) -> Iterator[Exchange]:
    """Send requests without credentials on a connection that has just carried them: they count for one request."""
    read = next((item for item in api.working.values() if item.operation.safe), None)
    for operation in api.run.effort.subsample(closed, _KEPT) if read is not None else ():
        if operation.label in api.streams or read is None:
            continue
        request = request_of(operation, usual_inputs(operation, values)[0])
        with suppress(NoAnswerError):
            read.send(api)
            yield api.client.send(
                request.method, request.target, headers=request.headers, body=request.body, authorized=False
            )


def _on_new_thing(
    surveyor: Surveyor, operation: Operation, request: Outgoing, client: HttpClient | Stranger, *, authorized: bool
) -> Iterator[Exchange]:
    """Send a request without valid credentials for a thing that was just created, if one can be; delete the thing.

    What a GET reads below the thing is written first.
    """
    api = surveyor.api
    known = callable_operations(api)
    item = operation.template.rpartition("}")[0] + "}"
    read, create, delete = (known.get((method, path)) for method, path in _life_of(item))
    put = known.get(("PUT", operation.template)) if operation.template != item else None
    if read is None or create is None or (operation.safe and put is None):
        return
    path = created_path(surveyor, create, read, _MAY_BE_CREATED)
    if path:
        target = path + operation.template[len(item) :] + "".join(request.target.partition("?")[1:])
        if operation.safe and put is not None:
            Writer(api, surveyor.values).send(put, target)
        sent = _send(client, replace(request, target=target), authorized=authorized)
        yield from [sent] if sent else []
        if delete is not None:
            Writer(api, surveyor.values).send(delete, path)


def _life_of(item: str) -> tuple[tuple[str, str], ...]:
    return ("GET", item), ("POST", collection_of(item)), ("DELETE", item)


def _beyond_ascii(api: RestInterface, values: Values, closed: list[Operation]) -> Iterator[Exchange]:
    """Send one read with a non-ASCII key in the query: functions that compare secrets fail on such a text."""
    schemes = api.run.contract.openapi.get("components", {}).get("securitySchemes", {})
    names = [
        scheme["name"] for scheme in schemes.values() if (scheme.get("type"), scheme.get("in")) == ("apiKey", "query")
    ]
    reads = [operation for operation in closed if operation.method == "GET" and operation.label not in api.streams]
    for name in names[:1] if reads else ():
        target = request_of(reads[0], usual_inputs(reads[0], values)[0]).target
        with suppress(NoAnswerError):
            query = f"{'&' if '?' in target else '?'}{quote(name, safe='')}=%C3%A9"
            yield api.client.send("GET", target + query, authorized=False, fresh=True)
