"""Judge goal, velocity and lists that are read over SOAP, as XML or by HEAD, by JSON reads before and after."""

import itertools
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from http import HTTPStatus
from typing import Any, Final

from conformance.documents.json_shape import Shape
from conformance.documents.representation import UnreadableError, from_element, read
from conformance.packs.table1.limits import Limits
from conformance.packs.table1.robot.goal import difference
from conformance.packs.table1.robot.message_shapes import GOAL, MESSAGE_TYPE, SERVICE_TYPE, TWIST, read_as
from conformance.packs.table1.robot.message_shapes import SENSORS as SENSORS_SHAPE
from conformance.packs.table1.robot.message_shapes import SERVICES as SERVICES_SHAPE
from conformance.packs.table1.robot.robot import GOAL_PATH, SENSORS, SERVICES, VELOCITY, Velocity, is_near
from conformance.packs.table1.robot.soap_services import returns
from conformance.packs.table1.robot.state_read import entries_of, value_in
from conformance.transport.exchange import SAFE_METHODS, Attempt, Exchange
from conformance.verdict.evidence import Case, case

_OFTEN: Final = 2  # how often an interface must lag behind the other to fail
_BEHIND_S: Final = 0.5  # how long after a change an interface may lag, s
_XML: Final = "application/xml"
_LARGE: Final = 100_000
_UNREAD: Final = object()  # marks a value that was not read yet
_THERE: Final = object()  # marks a value that exists, as a HEAD showed, and was not read
_HEAD: Final = "http/head"


@dataclass
class _State:
    """The readings of one state so far.

    Attributes:
        name: the name of the state.
        shape: the shape of its value.
        over_soap, as_xml: what is broken where SOAP, or XML, shows another value.
        differs: returns where a value differs from another one, or an empty text; None if there is no such state.
        before: the value as JSON that was read last since anything may have changed it.
        since: values over SOAP and as XML since then, with their exchanges and requirements.
    """

    name: str
    shape: Shape
    over_soap: str
    differs: Callable[[Any, Any], str]
    as_xml: str = "rest-formats/same-values"
    before: Any = _UNREAD
    since: list[tuple[Any, Exchange, str]] = field(default_factory=list)


class AcrossInterfaces:
    """Compares one state over interfaces and formats, in all exchanges of a run.

    Args:
        url: returns the URL of a path.
        limits: the robot's limits.

    Attributes:
        suspects: whether a value was another one for the first time, so that another look will tell.
    """

    def __init__(self, url: Callable[[str], str], limits: Limits) -> None:
        def faster(one: Any, other: Any) -> str:
            near = is_near(limits, Velocity.of(one), Velocity.of(other), 2)
            return "" if near else f"{Velocity.of(one)} for {Velocity.of(other)}"

        self._settle_s = limits.settle_s
        velocity = _State("GetVelocity", TWIST, "equivalence/pose", faster)
        goal = _State("GetGoal", GOAL, "equivalence/goal", difference)
        self._states = {velocity.name: velocity, goal.name: goal}
        self._by_url = {url(VELOCITY): velocity, url(GOAL_PATH): goal}
        self._acted_s = self._received_s = 0.0
        self._others: Counter[tuple[str, str]] = Counter()
        self.suspects = self._acted_by_hand = False

    def __call__(self, attempt: Attempt) -> Iterator[Case]:
        """Take one exchange of the run."""
        if isinstance(attempt, Exchange):
            yield from self._judge_read(attempt)
        elif attempt.request.method not in SAFE_METHODS:  # the request may have been carried out
            self._forget(self._received_s)

    def _judge_read(self, exchange: Exchange) -> Iterator[Case]:
        request, response = exchange.request, exchange.response
        if self._acted_by_hand:
            self._acted_by_hand = False
            self._forget(response.received_s)
        sent_s = response.received_s - response.elapsed_ms / 1000
        crossed, self._received_s = sent_s < self._received_s, max(self._received_s, response.received_s)
        state = self._by_url.get(request.url)
        if request.method == "POST":
            named = [one for name, one in self._states.items() if f"{name}Response".encode() in response.body]
            asked = [one for name, one in self._states.items() if b":%s" % name.encode() in request.body]
            if crossed or not asked:
                self._forget(response.received_s if crossed or b":Get" not in request.body else self._acted_s)
            elif response.ok or (asked[0].shape is GOAL and b"Fault" in response.body):
                found, problem = value_in(exchange, asked[0].shape) if named else (None, "")
                nothing = bool(problem) or found is None or bool(asked[0].shape.problem(found))
                if asked[0].shape is GOAL or not nothing:
                    asked[0].since.append((None if nothing else found, exchange, asked[0].over_soap))
        elif request.method not in SAFE_METHODS or crossed:
            self._forget(response.received_s)
        elif request.method == "HEAD" and state is not None and state.shape is GOAL:
            state.since.append((None if response.status == HTTPStatus.NOT_FOUND else _THERE, exchange, _HEAD))
        elif request.method == "GET" and state is not None and len(response.body) < _LARGE:
            yield from self._read(state, exchange)

    def forget(self, *, deletes: bool) -> None:  # noqa: ARG002 - see CheckerListener
        """Forget readings before a raw request, whose effect is unknown."""
        self._acted_by_hand = True

    def _forget(self, at_s: float) -> None:
        """Forget earlier values, because a request may have changed the states."""
        self._acted_s = at_s
        for state in self._states.values():
            state.before, state.since = _UNREAD, []

    def _read(self, state: _State, exchange: Exchange) -> Iterator[Case]:
        """Take a value over REST."""
        response = exchange.response
        value: Any = None
        if response.status == HTTPStatus.NOT_FOUND and state.shape is GOAL:
            is_json = "xml" not in response.media_type
        elif response.ok and response.media_type in {"application/json", _XML}:
            is_json = response.media_type != _XML
            try:
                value = read(response.media_type, response.body, state.shape.schema)
            except UnreadableError:
                return
            if state.shape.problem(value):
                return
        else:
            return
        if not is_json:
            state.since.append((value, exchange, state.as_xml))
            return
        if state.before is not _UNREAD and not _differs(state, state.before, value):
            for other, one, requirement in state.since:
                yield from self._compare(state, (other, one, requirement), value)
        state.before, state.since = value, []

    def _compare(self, state: _State, read_otherwise: tuple[Any, Exchange, str], value: Any) -> Iterator[Case]:
        """Judge a value that was read over SOAP or as XML between two equal ones."""
        other, exchange, requirement = read_otherwise
        if state.shape is TWIST and exchange.response.received_s < self._acted_s + self._settle_s + _BEHIND_S:
            return
        found = _differs(state, other, value)
        key = state.name, requirement
        self._others[key] += bool(found)
        self.suspects = bool(found) and self._others[key] < _OFTEN
        soon = exchange.response.received_s < self._acted_s + _BEHIND_S and requirement != _HEAD
        yield case(
            requirement,
            not found or soon or self._others[key] < _OFTEN,
            exchange,
            "the value that GET as JSON returned before and after it",
            found=f"{found}; {self._others[key]} times",
            cause=f"{state.name} now and then",
        )


def _differs(state: _State, one: Any, other: Any) -> str:
    if one is None or other is None:
        return "" if one is other else "none" if one is None else "one where there is none"
    return "" if one is _THERE else state.differs(one, other)


#: For each member of the SOAP response: REST path, shape of the list, shape of a named type, requirement.
_LISTS: Final[Mapping[bytes, tuple[str, Shape, Shape, str]]] = {
    b"GetSensorsResponse": (SENSORS, SENSORS_SHAPE, MESSAGE_TYPE, "equivalence/sensors"),
    b"GetNavigationServicesResponse": (SERVICES, SERVICES_SHAPE, SERVICE_TYPE, "equivalence/services"),
}
# Lists over SOAP that wait for the next one over REST.
_MOST: Final = 20


@dataclass
class _Seen:
    """The readings of one list so far.

    Attributes:
        path, shape, full, requirement: as above.
        listed: the entries over REST, as read last; None if not read yet.
        received_s: when they were received, s of the monotonic clock.
        others: entries over SOAP since then, the newest.
    """

    path: str
    shape: Shape
    full: Shape
    requirement: str
    listed: list[str] | None = None
    received_s: float = 0.0
    others: list[tuple[list[str], Exchange]] = field(default_factory=list)

    @property
    def names(self) -> tuple[str, ...]:
        """Return the names of an entry's fields."""
        return tuple(self.shape.schema["items"]["properties"])


class Lists:
    """Judges the lists in all exchanges of one run.

    One over SOAP that differs counts where REST shows the same entries before and after it: a robot's graph may change.
    """

    def __init__(self, url: Callable[[str], str]) -> None:
        self._seen = {name: _Seen(*what) for name, what in _LISTS.items()}
        self._by_url = {url(seen.path): seen for seen in self._seen.values()}

    def __call__(self, attempt: Attempt) -> Iterator[Case]:
        """Process one exchange of the run, if it contains a list."""
        if not isinstance(attempt, Exchange):
            return
        request, response = attempt.request, attempt.response
        if request.method == "GET" and request.url in self._by_url and response.media_type == "application/json":
            yield from self._over_rest(self._by_url[request.url], attempt)
        elif request.method == "POST" and response.ok:
            for name, seen in self._seen.items():
                if name in response.body:
                    self._over_soap(seen, attempt)

    def _over_rest(self, seen: _Seen, exchange: Exchange) -> Iterator[Case]:
        value, problem = read_as(exchange.response, seen.shape)
        if problem:
            return
        yield from self._judge_entries(seen, value, exchange)
        listed, (others, seen.others) = entries_of(value, seen.names), (seen.others, [])
        for entries, other in others if listed == seen.listed else ():
            if _sent_s(exchange) < other.response.received_s:
                continue
            odd = sorted(set(entries) ^ set(listed)) or ["an entry twice"]
            yield case(
                seen.requirement,
                holds=entries == listed,
                exchange=other,
                expected=f"the entries of GET {seen.path} before and after it",
                found=f"{len(entries)} entries for {len(listed)}; in only one of them: {', '.join(odd[:3])}",
                cause="other entries",
            )
        seen.listed, seen.received_s = listed, exchange.response.received_s

    def _judge_entries(self, seen: _Seen, entries: list[Any], exchange: Exchange) -> Iterator[Case]:
        """Judge that no entry of a list is there twice, and that each type is named in full."""
        listed, what = entries_of(entries, seen.names), seen.requirement.rpartition("/")[2]
        twice = next((one for one, two in itertools.pairwise(listed) if one == two), "")
        yield case(
            f"rest-resources/{what}-unique",
            not twice,
            exchange,
            "no entry twice",
            found=f"twice {twice}",
            cause="twice",
        )
        short = next((entry["type"] for entry in entries if seen.full.problem(entry["type"])), "")
        yield case(
            f"rest-resources/{what}-named-in-full",
            not short,
            exchange,
            f"a type named in full, as {'sensor_msgs/msg/LaserScan' if what == 'sensors' else 'nav_msgs/srv/GetPlan'}",
            found=f"type {short!r}",
            cause="not in full",
        )

    def _over_soap(self, seen: _Seen, exchange: Exchange) -> None:
        found, problem = returns(exchange)
        if problem or seen.listed is None or _sent_s(exchange) < seen.received_s:
            return
        schema = seen.shape.schema["items"]
        entries = entries_of([from_element(element, schema) for element in found], seen.names)
        seen.others = [*seen.others[1 - _MOST :], (entries, exchange)]


def _sent_s(exchange: Exchange) -> float:
    return exchange.response.received_s - exchange.response.elapsed_ms / 1000
