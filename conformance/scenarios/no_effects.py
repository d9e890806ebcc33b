"""Find values that a request changes although it must not: a safe one, or one that is refused for its header fields.

Such a value is a lamp that the GET of something else switches. In one arm of the experiment the suite waits and then
reads a value, in the other it sends the request before that read. Both arms may begin with a request that acts, so that
an effect that lasts shows again. A request has an effect if the value is the same whenever it is not sent, and another
one each time that it is. What counts or dates requests does not count, nor does what every request changes: a device
may keep records of them (RFC 9110 9.2.1).
"""

from __future__ import annotations

import re
import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field, replace
from itertools import islice, pairwise
from typing import Any, Final

from conformance.api.call_rules import words_of
from conformance.api.rest.applicable import callable_operations
from conformance.api.rest.calls import Call
from conformance.api.rest.inputs import request_of, usual_inputs
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.things import collection_of
from conformance.api.rest.values import Values
from conformance.api.rest.variations import unknown_variations
from conformance.checkers.changes import ENDING
from conformance.documents.json_text import clip, read_json
from conformance.documents.openapi import Operation, is_json
from conformance.documents.security import demands
from conformance.scenarios.creating import created_path
from conformance.scenarios.living import ABSENT
from conformance.scenarios.safe_reads import Watched
from conformance.scenarios.scenario import NoOccasionError, scenario
from conformance.scenarios.singletons import is_free
from conformance.scenarios.stage import Leaves, Need, Stage
from conformance.scenarios.survey import Surveyor
from conformance.scenarios.writing import Writer
from conformance.transport.exchange import Exchange, NoAnswerError, NotPermittedError, Outgoing

# By effort, and for a device that responds slowly: resources whose values are compared, requests that act before that,
# and the time for suspects, s.
_WATCHED: Final = {"slow": 4, "quick": 8, "standard": 16, "deep": 32}
_ACTS: Final = {"slow": 1, "quick": 6, "standard": 8, "deep": 16}
_TIME_S: Final = {"slow": 30.0, "quick": 15.0, "standard": 40.0, "deep": 120.0}
# Of the requests that act, with none first, those after which HEAD and OPTIONS are tried too.
_IN_FULL: Final = 3
# Collections of which a thing is created.
_MADE: Final = 2
# Pauses of the arm that only waits, s; the other arm waits for the shortest one.
_WAITS_S: Final = (0.15, 0.3, 0.6)
# How often a request must have its effect, and the value be as usual without it.
_ROUNDS: Final = 6
# How many times as many reads must show a value that nothing has set: it may change by itself now and then.
_STEADY: Final = 4
# Reads that must alternate between two values, at irregular times.
_ALTERNATING: Final = 12
# A read that takes longer is not repeated again and again, ms.
_LONG_MS: Final = 300.0
_OCTETS: Final = 65_536  # longest response that is compared, bytes
# Digits of a text that may be a time, a count or an identifier.
_DIGITS: Final = re.compile(r"(?:\D*\d){6}")
#: Words in names of values that tell of requests or of time.
RECORDS: Final = frozenset(
    {
        "access", "accessed", "age", "at", "client", "clients", "connected", "connection", "connections", "count",
        "cursor", "date", "etag", "expires", "hits", "last", "left", "limit", "new", "nonce", "opened", "quota", "read",
        "reads", "remaining", "request", "requests", "revision", "seen", "session", "sessions", "stamp", "time",
        "timestamp", "token", "ttl", "unread", "uptime", "version", "viewed", "views", "visited",
    }
)  # fmt: skip
# Words with which the text of an operation says that reading has an effect.
_SAYS: Final = re.compile(
    r"\b(?:acknowledg|clear|consum|de-?queue|drain|empt(?:y|ies)|flush|mark|once|pop|refresh|remov|reset|since the)",
    re.IGNORECASE,
)
# How a write differs from one that is accepted, and the statuses that refuse it for that.
_ANONYMOUS: Final = "without credentials"
_AS_TEXT: Final = "as text/plain"
_REFUSED: Final = {_ANONYMOUS: frozenset({401, 403}), _AS_TEXT: frozenset({415})}
# Number of the write whose values no other check sends.
_TURN: Final = 70
_THERE: Final = ""  # the place whose value is whether the resource exists
_Places = dict[str, Any]


@dataclass(frozen=True)
class _Try:
    """A request that must change nothing.

    Attributes:
        operation: of the description.
        requests: with other values in turn, so that each would change something.
        how: how it differs from one that is accepted, for which it must be refused; empty for a safe one.
    """

    operation: Operation
    requests: tuple[Outgoing, ...]
    how: str = ""


@dataclass(frozen=True)
class _Suspect:
    """A value that has changed while nothing was sent but requests that must change nothing.

    Attributes:
        number: of its resource among those that are watched.
        place: where it is in the response.
        act: the request that was sent before; None if there was none.
    """

    number: int
    place: str
    act: Outgoing | None


@scenario(needs={Need.REST}, leaves=Leaves.UNTOUCHED, stage=Stage.EFFECT)
def no_effects(api: RestInterface, values: Values) -> tuple[Watched, ...]:
    """Read all resources in several orders, after requests that act too, and try safe requests one by one."""
    experiment = _Experiment(Writer(api, values))
    api.run.limit.check()
    with api.run.limit.lift(), suppress(NoAnswerError):  # the survey reports a broken connection
        found = experiment.play()
        if found:
            return tuple(found)
    raise NoOccasionError("no resource has values that reading could change")


@dataclass
class _Experiment:
    """The resources of a device, its safe requests, and requests that act."""

    writer: Writer
    # Paths of things that this run has created, by the template of their GET, with the operation that deletes them.
    _made: dict[str, tuple[str, Operation | None]] = field(default_factory=dict)
    _watched: list[tuple[Operation, Outgoing]] = field(default_factory=list)
    _long: set[str] = field(default_factory=set)  # labels of reads that take long

    def __post_init__(self) -> None:
        self._operations = callable_operations(self.writer.api)
        effort = self.writer.api.run.effort
        self._effort = "slow" if effort.slow else effort.name

    def play(self) -> list[Watched]:
        """Return a record for each resource, with the effect of a safe request on it if there is one."""
        acts: list[Outgoing | None] = [None]
        try:
            self._create()
            self._watch()
            acts += self._acts()
            suspects = dict.fromkeys(one for act in acts for one in self._suspects(act, in_full=act in acts[:_IN_FULL]))
            found: dict[str, Watched] = {}
            until = time.monotonic() + _TIME_S[self._effort]
            for suspect in suspects:
                label = self._watched[suspect.number][0].label
                if time.monotonic() < until and label not in found and (effect := self._judge(suspect)) is not None:
                    found[label] = effect
            for operation, request in self._watched:
                if operation.label not in found:
                    expected = "no value that reading changes"
                    found[operation.label] = Watched(operation.label, self._send(request), expected)
            return list(found.values())
        finally:
            for act in acts:
                if act is not None and words_of(act.target) & ENDING:
                    self._perform(act)
            for template, (path, delete) in self._made.items():
                if delete is not None:
                    self.writer.conditional(delete, self._operations["GET", template], path)

    def _create(self) -> None:
        """Create a thing of some collections, whose values no other client needs."""
        surveyor = Surveyor(self.writer.api, self.writer.values)
        for (method, template), read in self._operations.items():
            create = self._operations.get(("POST", collection_of(template)))
            single = method == "GET" and len(read.parameter("path")) == 1
            if single and create is not None and not create.motion and len(self._made) < _MADE:
                path = created_path(surveyor, create, read)
                if path:
                    self._made[template] = path, self._operations.get(("DELETE", template))

    def _watch(self) -> None:
        """Note the reads that return JSON."""
        reads = [one for (method, _), one in self._operations.items() if method == "GET"]
        for read in sorted(reads, key=lambda one: bool(one.parameter("path"))):
            request = self._request(read)
            found = self._attempt(_Try(read, (request,))) if len(self._watched) < _WATCHED[self._effort] else None
            if found is not None and read.label not in self._long and _values(found):
                self._watched.append((read, request))

    def _request(self, operation: Operation) -> Outgoing:
        """Return the usual request of an operation, to a thing of this run where that is possible."""
        return self._to_own(operation, request_of(operation, usual_inputs(operation, self.writer.values)[0]))

    def _to_own(self, operation: Operation, request: Outgoing) -> Outgoing:
        for template, (path, _) in self._made.items():
            rest = operation.template.rstrip("/").removeprefix(template)
            if rest != operation.template.rstrip("/") and rest[:1] in {"", "/"} and "{" not in rest:
                query = "".join(request.target.partition("?")[1:])
                return replace(request, target=path.rstrip("/") + rest + query)
        return request

    def _acts(self) -> list[Outgoing]:
        """Return requests that act and that this device has accepted: to what has no GET, and to things of this run."""
        found: list[Outgoing] = []
        for call in sorted(self.writer.api.working.values(), key=_place_of):
            operation, template = call.operation, call.operation.template.rstrip("/")
            if operation.method not in {"POST", "PUT"} or ("GET", template) in self._operations:
                continue
            own = any(template.startswith(f"{one}/") for one in self._made)
            if is_free(operation, template) and (own or not operation.parameter("path")):
                found += [self._to_own(operation, request_of(operation, one.inputs)) for one in _variants(call)]
        create = [self._operations["POST", collection_of(template)] for template in self._made]
        return [*found, *map(self._request, create)][: _ACTS[self._effort]]

    def _send(self, request: Outgoing) -> Exchange:
        return self.writer.api.send(request)

    def _read(self, number: int) -> tuple[_Places, Exchange]:
        exchange = self._send(self._watched[number][1])
        return _values(exchange), exchange

    def _tries(self) -> Iterator[_Try]:
        """Yield each GET, each GET of a thing that does not exist, HEAD and OPTIONS, and writes to be refused."""
        gets = (one for (method, _), one in self._operations.items() if method == "GET")
        reads = [one for one in gets if one.label not in self._long]
        for read in reads:
            yield _Try(read, (self._request(read),))
            usual = usual_inputs(read, self.writer.values)[0]
            for unknown in islice(unknown_variations(read, usual), 1):
                yield _Try(read, (request_of(read, unknown.inputs),))
        for read in reads:
            for method in ("HEAD", "OPTIONS"):
                yield _Try(read, (replace(self._request(read), method=method),))
        description = self.writer.api.run.contract.openapi
        for operation in self._operations.values():
            template = operation.template.rstrip("/")
            own = any(f"{template}/".startswith(f"{one}/") for one in self._made)
            if operation.safe or not is_free(operation, template) or not (own or "{" not in template):
                continue
            requests = self._writes(operation)
            if demands(description, operation):
                yield _Try(operation, requests, _ANONYMOUS)
            # A POST that is taken as text would create things.
            if len(requests) > 1 and all(map(is_json, operation.bodies)):
                yield _Try(operation, tuple(one.having_type("text/plain") for one in requests), _AS_TEXT)

    def _writes(self, operation: Operation) -> tuple[Outgoing, ...]:
        """Return the usual request of an operation; for PUT and PATCH one with other values, and then that."""
        bodies = self.writer.bodies(operation, _TURN)[:2] if operation.method in {"PUT", "PATCH"} else []
        made = (self._to_own(operation, self.writer.request(operation, body=body)) for body in bodies)
        return tuple(made) or (self._request(operation),)

    def _suspects(self, act: Outgoing | None, *, in_full: bool) -> Iterator[_Suspect]:
        """Yield what differs between reads that no request but safe ones separates; the order of the reads varies.

        Args:
            act: sent before the reads.
            in_full: whether HEAD and OPTIONS are sent too.
        """
        numbers = range(len(self._watched))
        if act is not None and not self._perform(act):
            return
        pairs = [(self._read(number)[0], self._read(number)[0]) for number in numbers]
        if act is not None:
            self._perform(act)
        back = {number: self._read(number)[0] for number in reversed(numbers)}
        known = {request for _, request in self._watched}
        for one in self._tries():
            if (in_full or one.requests[0].method == "GET") and one.requests[0] not in known:
                self._attempt(one)
        for number in numbers:
            first, second = pairs[number]
            third, last = back[number], self._read(number)[0]
            for before, after in ((first, second), (third, last), (first, third), (second, last)):
                yield from (_Suspect(number, place, act) for place in _changes(before, after, grown=in_full))

    def _attempt(self, one: _Try, turn: int = 0) -> Exchange | None:
        """Send a request that must change nothing; return None if it could not be sent, or was not refused."""
        request = one.requests[turn % len(one.requests)]
        with suppress(NotPermittedError):
            if not one.how:
                exchange = self._send(request)
                is_long = exchange.response.elapsed_ms > _LONG_MS and self._effort != "slow"
                self._long |= {one.operation.label} if is_long else set()
                return exchange
            options: dict[str, Any] = {"headers": request.headers, "body": request.body}
            options["authorized"] = one.how != _ANONYMOUS
            sent = self.writer.api.client.send(request.method, request.target, fresh=True, **options)
            return sent if sent.response.status in _REFUSED[one.how] else None
        return None

    def _perform(self, act: Outgoing | None) -> bool:
        with suppress(NotPermittedError):
            return act is None or self._send(act).response.ok
        return False

    def _judge(self, one: _Suspect) -> Watched | None:
        """Return the effect of a safe request on a value; None if it cannot be told from other changes."""
        waits = _WAITS_S if one.act is not None else _WAITS_S * _STEADY
        # Several requests that act may have added up before the first read.
        _, *arms = (self._arm(one, None, wait_s) for wait_s in (_WAITS_S[0], *waits))
        seen = [value for _, value, _ in arms] + [before for before, _, _ in arms if one.act is None]
        if any(value != seen[0] for value in seen[1:]):
            return None if one.act is not None else self._alternates(one)
        guilty, is_innocent = None, False
        for tried in self._tries():
            if tried.how or not _SAYS.search(tried.operation.text):
                shown = self._effect(one, tried, seen[0])
                is_innocent = is_innocent or shown is None
                guilty = guilty or (shown and (tried, *shown))
            if guilty and is_innocent:
                break
        if not guilty or not is_innocent:
            return None
        tried, exchange, value = guilty
        request = f"{tried.requests[0].method} {tried.requests[0].target} {tried.how}".rstrip()
        read = self._watched[one.number][0]
        act = f", sent after {one.act.method} {one.act.target}" if one.act is not None else ""
        expected = f"{_place_name(one.place, read)} to stay {clip(seen[0])} after {request}{act}"
        fault = f"{clip(value)}, {_ROUNDS} of {_ROUNDS} times, and never when it was not sent"
        return Watched(read.label, exchange, expected, fault, is_safe=not tried.how)

    def _arm(self, one: _Suspect, tried: _Try | None, wait_s: float, turn: int = 0) -> tuple[Any, Any, Exchange | None]:
        """Act, wait, and send a request that must change nothing, or none.

        Returns:
            The value before that, if nothing acts; the value after it; and the exchange of the request.
        """
        before = None if one.act is not None else self._read(one.number)[0].get(one.place)
        self._perform(one.act)
        time.sleep(wait_s)
        sent = self._attempt(tried, turn) if tried is not None else None
        return before, self._read(one.number)[0].get(one.place), sent

    def _effect(self, one: _Suspect, tried: _Try, usual: Any) -> tuple[Exchange, Any] | None:
        """Return a request's exchange and the value after it, if that changes each time, and never without it."""
        sent, value = None, None
        # The search for suspects has sent the first of a write's values.
        for turn in range(1, _ROUNDS + 1):
            before, value, sent = self._arm(one, tried, _WAITS_S[turn % 2], turn)
            was = usual if one.act is not None else before
            if sent is None or not _counts(one.place, was, value, grown=bool(tried.how)):
                return None
            # Without the request, the wait is as long as with it.
            before, alone, _ = self._arm(one, None, _WAITS_S[turn % 2] + sent.response.elapsed_ms / 1000)
            if alone != (usual if one.act is not None else before):
                return None
        return None if sent is None else (sent, value)

    def _alternates(self, one: _Suspect) -> Watched | None:
        """Judge a value that each read of its own resource changes back and forth, whenever that is."""
        read, request = self._watched[one.number]
        if _SAYS.search(read.text):
            return None
        values, exchange = [], None
        for turn in range(_ALTERNATING):
            time.sleep(_WAITS_S[0] * (1 + turn % 3) / 3)
            value, exchange = self._read(one.number)
            values.append(value.get(one.place))
        turns = all(_counts(one.place, *pair) for pair in pairwise(values)) and values[2:] == values[:-2]
        if not turns or exchange is None:
            return None
        expected = (
            f"{_place_name(one.place, read)} to stay the same while only {request.method} {request.target} is sent"
        )
        fault = f"{clip(values[-2])} and {clip(values[-1])} in turn, in {_ALTERNATING} reads at irregular times"
        return Watched(read.label, exchange, expected, fault)


def _place_of(call: Call) -> tuple[bool, bool]:
    """Return the place of a request that acts: a PUT may undo what reading did; what ends an activity comes last."""
    return call.operation.method != "PUT", bool(words_of(call.operation.template) & ENDING)


def _variants(call: Call) -> list[Call]:
    """Return a call with each value of a first boolean in its query or body, or as it is."""
    inputs = call.inputs
    for name, value in inputs.query.items():
        if isinstance(value, bool):
            return [replace(call, inputs=inputs.having("query", name, one)) for one in (value, not value)]
    if isinstance(inputs.body, dict):
        for name, value in inputs.body.items():
            if isinstance(value, bool):
                bodies = ({**inputs.body, name: one} for one in (value, not value))
                return [replace(call, inputs=replace(inputs, body=body)) for body in bodies]
    return [call]


def _values(exchange: Exchange) -> _Places:
    """Return the values of a JSON response by place, lists by their length; empty if there are none to compare."""
    answer = exchange.response
    if answer.status in ABSENT:
        return {_THERE: "gone"}
    if not (answer.ok and is_json(answer.media_type)) or answer.cut or len(answer.body) > _OCTETS:
        return {}
    found = {_THERE: "there", **dict(_leaves("", read_json(answer.body).value))}
    return found if len(found) > 1 else {}


def _leaves(place: str, value: Any) -> Iterator[tuple[str, Any]]:
    if isinstance(value, dict):
        for name, part in value.items():
            yield from _leaves(f"{place}/{name}", part)
    else:
        yield (f"{place}/number of items", len(value)) if isinstance(value, list) else (place, value)


def _changes(before: _Places, after: _Places, *, grown: bool) -> list[str]:
    return [place for place, old in before.items() if place in after and _counts(place, old, after[place], grown=grown)]


def _counts(place: str, old: Any, new: Any, *, grown: bool = False) -> bool:
    """Return whether a change is one that no request of this kind may cause.

    Numbers that grow count something, unless ``grown``, and those with a fraction are measured.
    """
    if old == new or words_of(place.rpartition("/")[2]) & RECORDS:
        return False
    kinds = {type(old), type(new)}
    if kinds == {int}:
        return grown or bool(new < old)
    if kinds <= {str, type(None)}:
        return not any(_DIGITS.match(value) for value in (old, new) if value)
    return kinds <= {bool, type(None)}


def _place_name(place: str, read: Operation) -> str:
    return f"{place.lstrip('/') or 'the resource'} in {read.label}"
