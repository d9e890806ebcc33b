"""Exchanges that other checks than the survey had with a described API.

A fault in one response of a hundred may meet none of the survey's requests, so its rules judge these as well.
"""

import time
from contextlib import suppress
from itertools import islice
from typing import Final

from conformance.api.rest.applicable import allows
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.left_behind import LeftBehind
from conformance.api.rest.request_context import RequestContext
from conformance.api.rest.statuses import CRASHES, HELD, held_text
from conformance.api.rest.things import object_in
from conformance.api.rest.validity import VALID, validity
from conformance.api.rest.variations import Kind
from conformance.contract.described import SOAP
from conformance.documents.json_schema import kinds_of
from conformance.documents.json_text import read_json
from conformance.documents.openapi import matching, operations_of
from conformance.documents.representation import flat
from conformance.documents.writing import json_text
from conformance.scenarios.living import ABSENT
from conformance.scenarios.scenario import NoOccasionError, NotPossibleError, scenario
from conformance.scenarios.stage import Leaves, Need, Stage
from conformance.scenarios.survey import Probe, Survey
from conformance.transport.exchange import Attempt, Exchange, Listener, NoAnswer, NoAnswerError, Outgoing, Unanswered
from conformance.verdict.time_limit import TimeIsOverError

# Different responses that are kept, so that a long run needs no more memory.
_MOST: Final = 2000
# Things that are read at the end of a run, when even a slow device has created or deleted them.
_MOST_THINGS = 40
_REMEMBERED = 400  # things that are remembered for that
# A device may carry out a request this long after its response, s: slightly longer than the checkers wait.
_SETTLES_S: Final = 3.2
_MOST_DELETED: Final = 10  # things that are deleted at the end
_DONE: Final = frozenset({200, 204})
_ERRORS: Final = range(400, 500)
_ANY_FORMAT: Final = frozenset({None, "*/*", "application/json"})


_Things = dict[str, tuple[bool, float]]


class OtherExchanges(Listener):
    """Keeps the usual and valid requests of all checks to operations that work, if no scenario records them.

    Attributes:
        probes: the exchanges, those with equal responses once.
        things: by the path of what was created or deleted whether it should be there, and since when, s of the
            monotonic clock; what was not read since then comes first.
    """

    def __init__(self, api: RestInterface) -> None:
        self.probes: list[Probe] = []
        self.things: _Things = {}
        self._made = LeftBehind(operations_of(api.run.contract), api.client.base_url).created_path
        self._api = api
        self._seen: set[int] = set()

    def on_response(self, exchange: Exchange) -> None:
        """Keep an exchange."""
        answer = exchange.response
        names = sorted(name.lower() for name, _ in answer.headers)
        self._keep(exchange, (answer.status, answer.media_type, *names, answer.body))
        if answer.ok and exchange.request.method in {"POST", "PUT", "DELETE"}:
            self._note(exchange)
        elif exchange.request.method == "GET":
            path = exchange.request.url.removeprefix(self._api.client.base_url)
            if self.things.get(path, (None,))[0] is answer.ok:
                self.things[path] = self.things.pop(path)

    def _note(self, exchange: Exchange) -> None:
        context = RequestContext.of(self._api.run.contract, self._api.client.base_url, exchange.request)
        if context is not None and context.operation is not None:
            path = context.target.partition("?")[0]
            made = path if exchange.request.method == "DELETE" else self._made(context.operation, path, exchange)
            reads = matching(self._api.run.contract, "GET", made) if made else None
            if reads is not None and allows(self._api, reads):
                self.things.pop(made, None)
                known = exchange.request.method != "DELETE", exchange.response.received_s
                self.things = {made: known, **self.things}
                if len(self.things) > _REMEMBERED:
                    self.things.popitem()

    def on_no_response(self, request: Unanswered) -> None:
        """Keep a request whose connection was closed; those of concurrent clients may be refused, and are not kept."""
        if request.kind is NoAnswer.CLOSED:
            self._keep(request, (request.kind,))

    def _keep(self, attempt: Attempt, shown: tuple[object, ...]) -> None:
        if self._api.is_recorded or len(self.probes) >= _MOST:
            return
        kind, label = Kind.OTHER, self._operation_of(attempt)
        if not label and isinstance(attempt, Exchange) and attempt.response.status in _ERRORS:
            kind, label = Kind.ODD, self._refusing_label(attempt)
        key = hash((label, shown))
        if not label or key in self._seen:
            return
        self._seen.add(key)
        exchange, unanswered = (attempt, None) if isinstance(attempt, Exchange) else (None, attempt)
        self.probes.append(Probe(label, kind, exchange=exchange, unanswered=unanswered))

    def _refusing_label(self, exchange: Exchange) -> str:
        """Return the operation that refuses a request by a status which it declares; or an empty text."""
        context = RequestContext.of(self._api.run.contract, self._api.client.base_url, exchange.request)
        operation = context.operation if context and exchange.request.raw is None else None
        is_own = operation is not None and operation.method == exchange.request.method
        declared = operation.responses if operation is not None and is_own else {}
        return operation.label if operation is not None and str(exchange.response.status) in declared else ""

    def _operation_of(self, attempt: Attempt) -> str:
        """Return the operation of a usual and valid request, if it was answered 2xx before; or an empty text."""
        request = attempt.request
        contract, base_url = self._api.run.contract, self._api.client.base_url
        context = RequestContext.of(contract, base_url, request)
        operation = context.operation if context else None
        if context is None or operation is None or operation.label not in self._api.working:
            return ""
        names = {name.lower() for name, _ in request.headers}
        hidden = any(item.required for where in ("header", "cookie") for item in operation.parameter(where))
        if not context.usual or hidden or "transfer-encoding" in names or context.accept not in _ANY_FORMAT:
            return ""
        sent = Outgoing(request.method, context.target, request.headers, request.body)
        said = validity(contract, sent.method, sent.target, sent.content_type, sent.body)
        # A request that refers to a missing thing is no reason to crash.
        crashed = isinstance(attempt, Exchange) and attempt.response.status in CRASHES
        invents = not crashed and self._api.values is not None and self._api.values.invents(operation, sent)
        return operation.label if said.verdict == VALID and not invents else ""


def _read(api: RestInterface, things: _Things) -> dict[str, Exchange]:
    return {path: api.client.send("GET", path, headers=(("Accept", "*/*"),)) for path in things}


def _wrong(things: _Things, sent: dict[str, Exchange]) -> _Things:
    """Return the things that are missing, or are there although they were deleted."""
    return {path: one for path, one in things.items() if one[0] is (sent[path].response.status in ABSENT)}


def _delete_things(api: RestInterface, sent: dict[str, Exchange]) -> _Things:
    """Delete things that were read: for each declared value of a member, one that has it."""
    covered, found = set[tuple[str, ...]](), _Things()
    for path, exchange in sent.items():
        read, delete = (matching(api.run.contract, method, path) for method in ("GET", "DELETE"))
        if read is None or delete is None or not allows(api, delete) or len(found) >= _MOST_DELETED:
            continue
        parts = flat(read.shape or {}).get("properties", {})
        own = object_in(read_json(exchange.response.body).value, parts)
        few = [name for name, one in parts.items() if name in own and _has_few(one)]
        values = {(read.template,), *((read.template, name, json_text(own[name])) for name in few)}
        if not values <= covered:
            covered |= values
            answer = api.client.send("DELETE", path).response
            found |= {path: (False, answer.received_s)} if answer.status in _DONE else {}
    return found


def _has_few(schema: object) -> bool:
    """Return whether a member has few values, as states do."""
    return isinstance(schema, dict) and ("enum" in flat(schema) or kinds_of(schema) == {"boolean"})


@scenario(needs={Need.REST}, leaves=Leaves.UNTOUCHED, stage=Stage.LAST)
def others(api: RestInterface, other_exchanges: OtherExchanges) -> Survey:
    """Read created or deleted things again, and return the exchanges of other checks."""
    with suppress(NoAnswerError, TimeIsOverError):
        things = dict(islice(other_exchanges.things.items(), _MOST_THINGS))
        sent = _read(api, things)
        wrong = _wrong(things, sent)
        own = {path: one for path, one in sent.items() if things[path][0] and path not in wrong}
        deleted = _delete_things(api, own)
        wrong |= _wrong(deleted, _read(api, deleted))
        # A device may carry out a request late, but not never.
        if wrong:
            until = max(when for _, when in wrong.values()) + _SETTLES_S
            time.sleep(max(0.0, until - time.monotonic()))
            _read(api, wrong)
    held = {label: status for label, status in api.usual_status.items() if status in HELD}
    if not api.working and held:
        raise NoOccasionError(held_text(held, set(held.values())))
    if not api.working and SOAP not in api.run.contract.classes:
        raise NotPossibleError("no request was answered 2xx; if the device asks for credentials, give them")
    if not other_exchanges.probes:
        raise NoOccasionError("no other check sent a usual request to an operation that works")
    return Survey(tuple(other_exchanges.probes))
