"""The survey of a described API: each operation that may be called is sent valid, invalid and odd requests."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Final

from conformance.api.rest.applicable import allows
from conformance.api.rest.calls import Call
from conformance.api.rest.inputs import Inputs, request_of, usual_inputs
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.invalid_variations import unacceptable, undeclared_types
from conformance.api.rest.samples import fits
from conformance.api.rest.statuses import HELD, differ
from conformance.api.rest.things import collection_of
from conformance.api.rest.validity import UNCLEAR, VALID, Validity, validity
from conformance.api.rest.values import Values
from conformance.api.rest.variations import UNKNOWN, Kind, Variation, least_inputs, most_references
from conformance.checkers.untouched import ALONE, OFTEN
from conformance.documents.json_text import read_json
from conformance.documents.openapi import Operation, is_json, known_path, operations_of
from conformance.documents.patterns import SlowPatternError
from conformance.documents.representation import flat
from conformance.scenarios.drawing import draw_requests, has_input, order_of
from conformance.scenarios.lists import Paged
from conformance.scenarios.reaching import CONFLICT, WANTS_CONDITION, Reaching
from conformance.scenarios.scenario import NotPossibleError, PartialTraceError, scenario
from conformance.scenarios.stage import Leaves, Need, Stage
from conformance.transport.exchange import (
    Attempt,
    Exchange,
    NoAnswer,
    NoAnswerError,
    NotPermittedError,
    Outgoing,
    Unanswered,
)
from conformance.verdict.effort import Effort
from conformance.verdict.time_limit import TimeIsOverError

# Members of a refused request that are sent alone.
_MOST_PARTS: Final = 24
_TRIED = 3  # refused requests that are tried again in other states
_STATES = 2  # states in which they are tried
#: Timed sends of the usual request before other groups and after each, at standard effort: a failure in one of twenty
#: is found.
TIMED: Final = 5
# One request in this many opens a new connection.
_FRESH: Final = 5
# A device may work until the run's deadline and then respond: that is no hang.
_GRACE: Final = 1.25
# How often a thing is created and deleted.
_CYCLES: Final = 24
# Statuses of an operation that does not exist.
_NOT_FOUND: Final = 404
_SUCCESS: Final = range(200, 300)
_NOT_THERE: Final = frozenset({_NOT_FOUND, 405, 501})
# A charset means nothing for JSON (RFC 8259 11), so no device should refuse it (RFC 2045 5).
_CHARSET: Final = "header Content-Type"
#: Statuses that refuse a request for its content, or for the thing's state.
REFUSALS: Final = frozenset({400, 404, 405, 409, 411, 412, 413, 415, 422})
_DOUBTED: Final = frozenset({400, 409, 422})  # statuses that may refuse a second thing with the same name
# Requests that must be accepted.
_ACCEPTED: Final = frozenset({Kind.EXAMPLE, Kind.DEFAULT, Kind.ENUM, Kind.OPTIONAL, Kind.BOUND, Kind.GENERATED})
# Kinds of requests that generated requests cover too, so they need not be sent again.
_JUDGED: Final = frozenset({Kind.OPTIONAL, Kind.BOUND, Kind.INVALID, Kind.MISSING})
REPEATS: Final = 200  # repeats of one request at standard effort; never below FEWEST_REPEATS
FEWEST_REPEATS: Final = 60
#: Cases of Schemathesis for an operation: that cover its schema, and that are drawn.
COVERAGE: Final = 150
FUZZED: Final = 40
# Multiple of an exploration's time that one operation may take, so that a slow one does not take the whole run.
BUDGETS: Final = 3
# Share of a time limit after which the survey sends only usual requests.
SURVEY_SHARE: Final = 0.5


@dataclass(frozen=True)
class Probe:
    """One request of the survey and its outcome.

    Attributes:
        operation: method and path template.
        kind: what the request shows.
        says: what is special about it, as a noun phrase.
        place: the parameter or member that is special.
        exchange: the request with its response; None without a response.
        unanswered: the request without a response; None with one.
        validity: valid, invalid or unclear: the request by the description, read back as it was written.
        why: what is invalid in it.
        invents: whether a refusal may be right: it refers to something, by an id or a cursor, that the device has not
            named, or creates what may be there only once.
    """

    operation: str
    kind: Kind
    says: str = ""
    place: str = ""
    exchange: Exchange | None = None
    unanswered: Unanswered | None = None
    validity: str = UNCLEAR
    why: str = ""
    invents: bool = False

    @property
    def attempt(self) -> Attempt:
        """The request with its response, or with the reason for a missing one."""
        found = self.exchange or self.unanswered
        if found is None:
            raise ValueError("a probe has neither a response nor a reason for a missing one")
        return found

    @property
    def status(self) -> int:
        """The status code; 0 without a response."""
        return self.exchange.response.status if self.exchange else 0

    @property
    def ok(self) -> bool:
        """Whether the status is 2xx."""
        return self.exchange is not None and self.exchange.response.ok


@dataclass(frozen=True)
class Survey:
    """All requests of a survey, in the order in which they were sent.

    Attributes:
        probes: the requests.
        repeats: response times of one request that was sent again and again, ms.
        repeated: the last of these exchanges, or None.
        elsewhere: for operations whose usual request was answered 404, a GET of a path beside it that is not described.
        paged: lists below a thing, in parts.
    """

    probes: tuple[Probe, ...] = ()
    repeats: tuple[float, ...] = ()
    repeated: Exchange | None = None
    elsewhere: Mapping[str, Exchange] = field(default_factory=dict)
    paged: tuple[Paged, ...] = ()

    def of(self, operation: str, *kinds: Kind) -> list[Probe]:
        """Return the probes of one operation, of these kinds or of all."""
        return [probe for probe in self._by_operation.get(operation, ()) if not kinds or probe.kind in kinds]

    @cached_property
    def _by_operation(self) -> dict[str, list[Probe]]:
        found: dict[str, list[Probe]] = {}
        for probe in self.probes:
            found.setdefault(probe.operation, []).append(probe)
        return found

    def is_held(self, label: str) -> bool:
        """Return whether the device's state kept it from acting on each usual request of an operation."""
        statuses = {probe.status for probe in self.of(label, Kind.USUAL) if not probe.invents}
        return bool(statuses) and statuses <= HELD and not any(probe.ok for probe in self.of(label))

    def lacks(self, operation: Operation) -> bool:
        """Return whether the device answered each usual request as if it did not have the operation.

        A declared 404, or one for an identifier in the path, says that something else is not there. So does a 404 for
        values in query or body, if others were accepted, or if a path that nobody describes is answered otherwise.
        """
        if has_input(operation) and any(probe.ok for probe in self.of(operation.label)):
            return False
        named = bool(operation.parameter("path") or {"404", "4XX", "4xx"} & operation.responses.keys())
        absent = _NOT_THERE - {_NOT_FOUND} if named else _NOT_THERE
        usual = self.of(operation.label, Kind.USUAL)
        unknown = self.elsewhere.get(operation.label)
        if unknown is not None and any(probe.exchange and differ(probe.exchange, unknown) for probe in usual):
            return False
        return bool(usual) and all(probe.status in absent for probe in usual)


@dataclass
class Surveyor:
    """Sends the requests of a survey and records them."""

    api: RestInterface
    values: Values
    probes: list[Probe] = field(default_factory=list)
    usual: dict[str, Inputs] = field(default_factory=dict)
    given_up: set[str] = field(default_factory=set)
    elsewhere: dict[str, Exchange] = field(default_factory=dict)
    paged: list[Paged] = field(default_factory=list)

    @cached_property
    def reaching(self) -> Reaching:
        """What makes requests succeed."""
        return Reaching(self.api, self.values)

    @property
    def trace(self) -> Survey:
        """Return the record so far."""
        return Survey(tuple(self.probes), elsewhere=self.elsewhere, paged=tuple(self.paged))

    def send(
        self, operation: Operation, variation: Variation, request: Outgoing | None = None, *, fresh: bool | None = None
    ) -> Probe:
        """Send one request and record it.

        Args:
            operation: that it is for.
            variation: what is special about it.
            request: as it is written; None means by the variation's inputs.
            fresh: on a connection of its own; None means the usual requests, and one of several others.

        Raises:
            PartialTraceError: the device does not respond any more.
        """
        by_inputs = request is None
        request = request or self.reaching.request(operation, variation)
        probe, losses = self._probe_of(operation, variation, request), self.api.run.losses
        try:
            # A device may handle the first request on a connection differently.
            if fresh is None:
                fresh = variation.kind is Kind.USUAL or len(self.probes) % _FRESH == 0
            exchange = self._send_recorded(request, fresh=fresh)
        except (NotPossibleError, TimeIsOverError) as refused:
            raise PartialTraceError(self.trace) from refused
        except NoAnswerError as none:
            if none.kind in {NoAnswer.TIMEOUT, NoAnswer.CIRCUIT_OPEN, NoAnswer.HURRIED}:
                self.given_up.add(operation.label)
                self.api.streams.add(operation.label)
            probe = replace(probe, unanswered=none.unanswered)
            goes_on = self.api.alive()
            if self.api.run.losses == losses:
                self.probes.append(probe)
            else:
                # The loss is a finding of its own, and a request that caused one is not sent again.
                self.given_up.add(operation.label)
                self.api.streams.add(operation.label)
            if not goes_on:
                raise PartialTraceError(self.trace) from none
            return probe
        doubted = exchange.response.status in _DOUBTED and variation.kind in _ACCEPTED and self._is_single(operation)
        is_held = exchange.response.status == CONFLICT and operation.label in self.api.working
        trial = self.usual.get(operation.label, variation.inputs) if doubted else variation.inputs
        is_tried = by_inputs and (doubted or (is_held and variation.kind in _ACCEPTED))
        if is_tried and self.reaching.finds_new(operation, trial):
            return self.send(operation, variation, fresh=fresh)
        self.probes.append(replace(probe, exchange=exchange, invents=probe.invents or doubted))
        self._note(operation, variation.kind, request, exchange)
        return self.probes[-1]

    def _note(self, operation: Operation, kind: Kind, request: Outgoing, exchange: Exchange) -> None:
        """Remember a response's values for later requests."""
        status = exchange.response.status
        if operation.safe and kind in _JUDGED:
            self.api.judged.add(request)
        if exchange.response.cut:
            # A second endless response would show nothing new and cost as much time.
            self.given_up.add(operation.label)
            self.api.streams.add(operation.label)
        if exchange.response.ok:
            self.values.learn(operation, exchange)
            self.values.remember(operation, request)
        elif status in REFUSALS:
            self.reaching.keep_refused(status, operation, request)
        if not operation.safe and status not in REFUSALS - WANTS_CONDITION:
            self.reaching.forget_tags()

    def _is_single(self, operation: Operation) -> bool:
        """Return whether a creation that succeeded is refused the second time, as where names are unique."""
        label, usual = operation.label, self.usual.get(operation.label)
        succeeds = operation.method == "POST" and label in self.api.working
        if succeeds and usual is not None and label not in self.api.single:
            with suppress(NotPossibleError, TimeIsOverError, NoAnswerError):
                self.api.single[label] = self.api.send(request_of(operation, usual)).response.status in _DOUBTED
        return self.api.single.get(label, False)

    def _probe_of(self, operation: Operation, variation: Variation, request: Outgoing) -> Probe:
        """Return a probe of a request that is not sent yet."""
        said = validity(
            self.api.run.contract, request.method, request.target, request.content_type, request.body, request.headers
        )
        if said.slow:
            self.api.run.judge.fault(operation.label, SlowPatternError(said.slow))
        own = said if said.operation == operation else Validity(UNCLEAR)
        invents = self.values.invents(operation, request)
        given = operation.label, variation.kind, variation.says, variation.place
        return Probe(*given, validity=own.verdict, why=own.why, invents=invents)

    def _send_recorded(self, request: Outgoing, *, fresh: bool) -> Exchange:
        """Send a request whose exchange becomes a probe and that no checker judges.

        Raises:
            NoAnswerError: no HTTP response was received.
        """
        self.api.is_recorded = True
        try:
            return self.api.send(request, fresh=fresh, timeout_s=_GRACE * self.api.client.connection.timeout_s)
        finally:
            self.api.is_recorded = False

    def look_elsewhere(self, operation: Operation) -> None:
        """If all usual requests of an operation were answered 404, GET an undescribed path next to it."""
        if not has_input(operation) or self.api.usual_status.get(operation.label) != _NOT_FOUND:
            return
        usual = [probe for probe in self.probes if probe.kind is Kind.USUAL and probe.operation == operation.label]
        if any(probe.status != _NOT_FOUND for probe in usual):
            return
        path = f"{operation.template.partition('{')[0].rstrip('/').rpartition('/')[0]}/{UNKNOWN}"
        path = f"{path}/{UNKNOWN}" if known_path(self.api.run.contract, path) else path
        with self.api.run.limit.lift(), suppress(NoAnswerError):
            self.elsewhere[operation.label] = self.api.client.send("GET", path)

    def begin(self, operation: Operation) -> None:
        """Find a valid request that the device accepts, and keep it as the usual one."""
        for inputs in self._candidates(operation):
            self.usual.setdefault(operation.label, inputs)
            probe = self.send(operation, Variation(Kind.USUAL, "", "", inputs))
            self.api.usual_status[operation.label] = probe.status
            if probe.ok and probe.exchange is not None:
                self.usual[operation.label] = inputs
                if operation.label not in self.given_up:
                    self._note_working(operation, inputs, probe.exchange)
                return
            if operation.label in self.given_up:
                return

    def _candidates(self, operation: Operation) -> Iterator[Inputs]:
        """Yield inputs of the usual request; last those with a required condition, a new thing, or an existing one."""
        tried, statuses = usual_inputs(operation, self.values)[:4], self.api.usual_status
        yield from tried
        if statuses.get(operation.label) in WANTS_CONDITION and not operation.safe:
            self.reaching.wants_tag.add(operation.label)
            yield tried[0]
        if statuses.get(operation.label) == CONFLICT and self.reaching.finds_new(operation, tried[0]):
            yield usual_inputs(operation, self.values)[0]
        yield from self._as_read(operation, tried[0])

    def _as_read(self, operation: Operation, inputs: Inputs) -> Iterator[Inputs]:
        """Yield inputs of a PUT with what a read of the same path shows, which no rule in words forbids."""
        first, body = self.api.first.get(f"GET {operation.template}"), operation.bodies.get(inputs.media_type)
        if operation.method == "PUT" and first is not None and body is not None and is_json(inputs.media_type):
            value, parts = read_json(first.response.body).value, flat(body.schema).get("properties", {})
            there = value.items() if isinstance(value, dict) else ()
            made = {name: one for name, one in there if name in parts and not flat(parts[name]).get("readOnly")}
            if made and fits(body.schema, made):
                yield replace(inputs, body=made)

    def cut_short(self, what: str) -> None:
        """Count a request that time did not allow."""
        told = self.api.run.tally.cut_short
        told[what] = told.get(what, 0) + 1

    def _note_working(self, operation: Operation, inputs: Inputs, exchange: Exchange) -> None:
        """Keep a request that was answered 2xx for other checks, if it needs no header or cookie of its own."""
        if not inputs.headers and not inputs.cookies:
            self.api.working[operation.label] = Call(operation, inputs).bare
            self.api.first.setdefault(operation.label, exchange)

    def explore(self, operation: Operation, *, again: bool = False) -> Iterator[None]:
        """Send the usual request of an operation, and others group by group; yield after each group.

        With ``again``, the others only if the usual request was refused before, and is not now.
        """
        run, label = self.api.run, operation.label
        was_taken = self._is_taken(operation)
        if again and (label in self.given_up or (was_taken and not operation.safe)):
            return
        try:
            self.begin(operation)
            if run.limit.has_limit:
                self.look_elsewhere(operation)
            yield
            is_new = not was_taken and self._is_taken(operation)
            if label not in self.given_up and (is_new or not again):
                yield from self.vary(operation, run.effort, run.seed)
        except (NoAnswerError, NotPossibleError, NotPermittedError, PartialTraceError):
            raise
        except Exception as error:  # noqa: BLE001 - one schema that cannot be read leaves the others to be judged
            run.judge.fault(label, error)
            self.given_up.add(label)

    def _is_taken(self, operation: Operation) -> bool:
        return self.api.usual_status.get(operation.label, 0) in _SUCCESS

    def vary(self, operation: Operation, effort: Effort, seed: int) -> Iterator[None]:
        """Send requests that differ from the usual one in one thing, and then the usual one again."""
        usual = self.usual[operation.label]
        groups, parts = draw_requests(operation, usual, self.values, effort, seed, self.api.slow), _MOST_PARTS
        left = BUDGETS * effort.budget_s
        self._time(operation, usual, effort, time.monotonic() + left)
        for variations in groups:
            began = time.monotonic()
            until = began + left
            self.api.run.tally.planned += len(variations)
            for variation in variations:
                if operation.label in self.given_up:
                    return
                if time.monotonic() > until:
                    self.cut_short(f"survey of {operation.label}")
                    continue
                sent = self.send(operation, variation)
                for part in variation.parts if sent.ok else ():
                    self.probes.append(replace(sent, kind=part.kind, says=part.says, place=part.place))
                for part in variation.parts[:parts] if sent.status in REFUSALS else ():
                    parts -= 1
                    self.send(operation, part)
            self._time(operation, usual, effort, until)
            left -= time.monotonic() - began
            yield
        self._end(operation, usual)

    def _end(self, operation: Operation, usual: Inputs) -> None:
        """Send as many references as a list may have, the usual request with a charset, and again unchanged."""
        is_usable = operation.label not in self.given_up
        for fewer, most in most_references(operation, usual, self.values) if is_usable else ():
            # If the device accepts all members but one, and accepts that one alone, it knows each.
            if self.send(operation, Variation(Kind.AGAIN, "", "", fewer)).ok:
                self.send(operation, most)
        if is_json(usual.media_type) and operation.label not in self.given_up:
            shown = Variation(Kind.OPTIONAL, "with a charset", _CHARSET, usual)
            request = self.reaching.request(operation, shown).having_type(f"{usual.media_type}; charset=utf-8")
            self.send(operation, shown, request)
        for media_type in undeclared_types(operation, self.api.run.effort.name) if is_usable else ():
            other = Variation(Kind.INVALID, f"{media_type}, which is not declared, with 415 declared", _CHARSET, usual)
            self.send(operation, other, self.reaching.request(operation, other).having_type(media_type))
        for refused in unacceptable(operation, usual) if is_usable else ():
            self.send(operation, refused)
        # Optional inputs then have their defaults, more than once.
        least = least_inputs(operation, usual)
        for inputs in [usual] if least is None else [least] * 2:
            self.send(operation, Variation(Kind.AGAIN, "", "", inputs))

    def create_and_delete(self, operations: Sequence[Operation]) -> None:
        """At standard, create things and delete them, so often that a failure in one call of twenty is met."""
        if self.api.run.effort.name == "quick":
            return
        by_label = {item.label: item for item in operations}
        for operation in operations:
            collection = collection_of(operation.template)
            maker = by_label.get(f"POST {collection}") or by_label.get(f"POST {collection}/")
            if operation.method != "DELETE" or maker is None or not operation.parameter("path"):
                continue
            until = time.monotonic() + self.api.run.effort.budget_s
            for _ in range(_CYCLES):
                if time.monotonic() > until or {operation.label, maker.label} & self.given_up:
                    break
                made = self.send(maker, Variation(Kind.AGAIN, "", "", self.usual[maker.label])).ok
                which = operation.parameter("path")[-1]
                known = self.values.known_ids(operation, which)
                if made and known:
                    deleted = self.usual[operation.label].having("path", which.name, known[0])
                    self.send(operation, Variation(Kind.AGAIN, "", "", deleted))

    def try_again(self, operations: Sequence[Operation]) -> None:
        """Send refused valid requests again in another state, after settings next to them were changed."""
        by_label = {item.label: item for item in operations}
        enums = [probe for probe in self.probes if probe.ok and probe.kind is Kind.ENUM and probe.operation in by_label]
        refused = [
            probe for probe in self.probes if probe.kind in {Kind.BOUND, Kind.ENUM} and probe.status in {400, 422}
        ]
        for probe in [one for one in refused if one.validity == VALID and one.operation in by_label][:_TRIED]:
            operation = by_label[probe.operation]
            settings = [by_label[other.operation] for other in enums]
            near = [
                (item, other)
                for item, other in zip(settings, enums, strict=True)
                if item is not operation and not item.safe and _is_near(item.template, operation.template)
            ]
            for item, other in near[:_STATES]:
                self.send(item, Variation(Kind.AGAIN, "", "", self.usual[item.label]), self._again(other))
                again = Variation(probe.kind, probe.says, probe.place, self.usual[operation.label])
                self.send(operation, again, self._again(probe))
            for item in dict.fromkeys(item for item, _ in near[:_STATES]):
                self.send(item, Variation(Kind.AGAIN, "", "", self.usual[item.label]))

    def refuse_again(self, operations: Sequence[Operation]) -> None:
        """Send creations that were refused though they are valid a few times, each between two reads of the list."""
        lists = {item.template.rstrip("/") for item in operations if item.method == "GET"}
        valid = (probe for probe in self.probes if probe.status in _DOUBTED and probe.validity == VALID)
        refused = {probe.operation: self._again(probe) for probe in valid if probe.operation.startswith("POST ")}
        for request in [refused[item.label] for item in operations if item.label in refused and item.template in lists]:
            read = Outgoing("GET", request.target.partition("?")[0])
            with suppress(NoAnswerError):
                for sent in (*[read] * ALONE, *(read, request) * OFTEN, read):
                    self.api.send(sent)

    def _again(self, probe: Probe) -> Outgoing:
        """Return the request of a probe, to be sent again."""
        request = probe.attempt.request
        fields = tuple(pair for pair in request.headers if pair[0].lower() in {"content-type", "accept"})
        return Outgoing(request.method, request.url.removeprefix(self.api.client.base_url), fields, request.body)

    def _time(self, operation: Operation, usual: Inputs, effort: Effort, until: float) -> None:
        """Send the usual request a few times, to compare response times; DELETE would find nothing the second time."""
        for _ in range(0 if effort.name == "quick" or operation.method == "DELETE" else TIMED):
            if operation.label not in self.given_up and time.monotonic() < until:
                self.send(operation, Variation(Kind.AGAIN, "", "", usual))


def _is_near(template: str, other: str) -> bool:
    """Return whether one path is below the other, or both have the same parent."""
    above = template.rstrip("/").rpartition("/")[0]
    return other.startswith(f"{template}/") or (bool(above) and f"{other}/".startswith(f"{above}/"))


@scenario(needs={Need.REST}, leaves=Leaves.UNTOUCHED, stage=Stage.READING)
def survey(api: RestInterface, values: Values) -> Survey:
    """Send each operation that may be called its usual request, and many that differ from it in one thing."""
    run = api.run
    operations = [item for item in operations_of(run.contract) if allows(api, item)]
    if not operations:
        raise NotPossibleError("no operation of the description may be called")
    surveyor = Surveyor(api, values)
    api.values = values
    first = sorted((item for item in operations if item.method != "DELETE"), key=order_of)
    steps = {operation.label: surveyor.explore(operation) for operation in first}
    # By now things and files exist. Explore other operations with them before DELETE removes them.
    needing = [item for item in first if item.parameter("path") or not item.safe]
    later = {f"{item.label} again": surveyor.explore(item, again=True) for item in needing}
    deletes = sorted((item for item in operations if item.method == "DELETE"), key=lambda item: -len(item.template))
    behind = later | {operation.label: surveyor.explore(operation) for operation in deletes}
    steps |= behind
    is_complete = run.limit.in_turns(steps, SURVEY_SHARE, behind)
    if is_complete:
        surveyor.create_and_delete(operations)
        surveyor.try_again(operations)
        surveyor.refuse_again(operations)
        gone = {operation.template for operation in deletes}
        # Other checks read existing things: store a deleted file again, and choose another thing as the usual one.
        stored = [item for item in first if item.method == "PUT" and not collection_of(item.template)]
        for operation in (*stored, *(item for item in first if item.method == "GET")):
            if operation.template in gone and operation.label not in surveyor.given_up:
                surveyor.begin(operation)
    for operation in operations:
        surveyor.look_elsewhere(operation)
    return _repeat_quickest(surveyor, operations)


def _repeat_quickest(surveyor: Surveyor, operations: list[Operation]) -> Survey:
    """Send the quickest usual request many times, and return the finished survey."""
    quickest = [
        (probe.exchange.response.elapsed_ms, probe.operation)
        for probe in surveyor.probes
        if probe.kind is Kind.USUAL and probe.exchange and probe.ok and probe.operation.startswith("GET ")
    ]
    times: list[float] = []
    last: Exchange | None = None
    for _, label in sorted(quickest)[:1]:
        operation = next(item for item in operations if item.label == label)
        request = request_of(operation, surveyor.usual[label])
        for _ in range(max(FEWEST_REPEATS, surveyor.api.run.effort.cases(REPEATS))):
            if surveyor.api.run.limit.is_past(SURVEY_SHARE):
                break
            try:
                last = surveyor.api.send(request)
            except NoAnswerError as none:
                losses = surveyor.api.run.losses
                goes_on = surveyor.api.alive()
                if surveyor.api.run.losses == losses:
                    surveyor.probes.append(Probe(label, Kind.AGAIN, "", "", None, none.unanswered))
                if not goes_on:
                    raise PartialTraceError(
                        Survey(tuple(surveyor.probes), tuple(times), last, surveyor.elsewhere)
                    ) from none
                break
            times.append(last.response.elapsed_ms)
    return Survey(tuple(surveyor.probes), tuple(times), last, surveyor.elsewhere)
