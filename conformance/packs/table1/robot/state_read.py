"""Compare a value over SOAP with the values over REST before and after it: states may change between reads."""

import json
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Any, Final

import msgspec

from conformance.api.soap.service import SoapService
from conformance.documents.json_schema import is_number
from conformance.documents.json_shape import Shape
from conformance.documents.json_text import clip
from conformance.documents.representation import from_element
from conformance.measures.samples import FARTHEST
from conformance.packs.table1.robot.message_shapes import ODOMETRY, TWIST
from conformance.packs.table1.robot.robot import GOAL_PATH, POSE, VELOCITY, Robot
from conformance.packs.table1.robot.soap_services import ask, returns
from conformance.transport.exchange import Exchange
from conformance.verdict.evidence import Case


@dataclass(frozen=True)
class Slack:
    """How far a number may lie outside the two numbers read before and after it, when those two differ."""

    absolute: float = 0.02
    relative: float = 0.05


def disagreement(before: Any, between: Any, after: Any, slack: Slack, where: str = "") -> str:
    """Return a description of where ``between`` differs from both neighbours, or an empty text.

    Only fields that all three values have are compared. The caller must remove stamps, which advance between reads.
    """
    if isinstance(before, dict) and isinstance(after, dict):
        return _in_fields(before, between, after, slack, where)
    if isinstance(before, list) and isinstance(after, list):
        return _in_lists(before, between, after, slack, where)
    if is_number(before) and is_number(after):
        low, high = sorted((float(before), float(after)))
        # A value that did not change is exactly the same double over every interface (contract.md#equivalence).
        room = 0.0 if low == high else slack.absolute + slack.relative * max(abs(low), abs(high))
        if not is_number(between) or not low - room <= float(between) <= high + room:
            wanted = f"{low!r}" if low == high else f"{low!r} to {high!r}"
            return f"{where} is {clip(between)} for {wanted}"
        return ""
    return "" if between in (before, after) else f"{where} is {clip(between)} for {clip(before)}"


def _in_fields(before: dict[str, Any], between: Any, after: dict[str, Any], slack: Slack, where: str) -> str:
    for name, value in before.items():
        first = value
        if name not in after or (name == "stamp" and first != after[name]):
            continue
        path = f"{where}.{name}" if where else name
        last = after[name]
        if name == "orientation" and isinstance(between, dict):
            # A quaternion and its negative are the same orientation: compare the nearer one.
            first, last = _nearer_sign(first, between.get(name)), _nearer_sign(last, between.get(name))
        if not isinstance(between, dict) or name not in between:
            return f"{path} is missing"
        problem = disagreement(first, between[name], last, slack, path)
        if problem:
            return problem
    return ""


def _nearer_sign(quaternion: Any, like: Any) -> Any:
    """Return a quaternion or its negative, whichever is nearer to ``like``; return other values unchanged."""
    try:
        aside = sum(float(quaternion[axis]) * float(like[axis]) for axis in "xyzw") < 0
        return {**quaternion, **{axis: -quaternion[axis] for axis in "xyzw"}} if aside else quaternion
    except (TypeError, KeyError, ValueError):
        return quaternion


def _in_lists(before: list[Any], between: Any, after: list[Any], slack: Slack, where: str) -> str:
    lengths = {len(before), len(after)}
    if not isinstance(between, list) or len(between) not in lengths:
        return f"{where} has {len(between) if isinstance(between, list) else 'no'} items for {len(before)}"
    if len(lengths) > 1:
        return ""
    for index, triple in enumerate(zip(before, between, after, strict=True)):
        problem = disagreement(*triple, slack, f"{where}[{index}]")
        if problem:
            return problem
    return ""


def without_stamps(value: Any) -> Any:
    """Return a copy of a message without timestamps, which may legitimately differ between responses."""
    if isinstance(value, dict):
        return {name: without_stamps(item) for name, item in value.items() if name != "stamp"}
    return [without_stamps(item) for item in value] if isinstance(value, list) else value


def stamp_of(message: Any) -> tuple[float, float]:
    """Return the timestamp (sec, nanosec) in a message's header; zeros where it cannot be read."""
    header = message.get("header") if isinstance(message, dict) else None
    stamp = header.get("stamp") if isinstance(header, dict) else None
    if not isinstance(stamp, dict) or not is_number(stamp.get("sec")) or not is_number(stamp.get("nanosec")):
        return 0.0, 0.0
    return float(stamp["sec"]), float(stamp["nanosec"])


def entries_of(listed: list[Any], names: tuple[str, ...]) -> list[str]:
    """Return the given fields of each list entry as sorted texts, so that lists compare equal in any order."""
    return sorted(json.dumps([entry.get(name) for name in names]) for entry in listed)


_SLACK: Final = Slack()
# Two samples are farther apart than this, ns.
_SAMPLES_APART_NS: Final = 1000
#: Path, operation and shape of each state.
STATES: Final[dict[str, tuple[str, str, Shape]]] = {
    "pose": (POSE, "GetPose", ODOMETRY),
    "velocity": (VELOCITY, "GetVelocity", TWIST),
}


@dataclass(frozen=True)
class StateRead:
    """A state that was read over SOAP, and over REST before and after it.

    Attributes:
        name: "pose", "velocity" or "goal".
        exchange: request and response over SOAP.
        broken: what would not be right a moment later either; empty if nothing.
        differs: where SOAP's value is not between those of REST; empty if nowhere.
    """

    name: str
    exchange: Exchange
    broken: str
    differs: str

    @property
    def cases(self) -> Iterator[Case]:
        """Yield the readings as judged cases."""
        path = GOAL_PATH if self.name == "goal" else STATES[self.name][0]
        expected = f"what GET {path} gives just before and after"
        for problem in (self.broken, self.differs) if self.broken else (self.differs,):
            cause = problem.split(" is ", maxsplit=1)[0].split("[", maxsplit=1)[0]
            yield Case(not problem, self.exchange, expected, problem, cause)


def value_in(exchange: Exchange, shape: Shape) -> tuple[Any, str]:
    """Return the value in a SOAP response, and the fault of a response without one."""
    found, problem = returns(exchange)
    if problem or len(found) != 1:
        return None, problem or f"{len(found)} return elements"
    return from_element(found[0], shape.schema), ""


def _always() -> bool:
    return True


def _nothing() -> None:
    """Do nothing before a request."""


def read_state(
    robot: Robot,
    subscribers: SoapService,
    name: str,
    apart_s: float,
    lasted: Callable[[], bool] = _always,
    *,
    first: Callable[[], object] = _nothing,
) -> StateRead | None:
    """Read a state over REST, SOAP and REST, ``apart_s`` apart; ``first`` is called just before SOAP's.

    Return None where REST has no value, which the checkers have judged, and where SOAP's differs although the state
    has not ``lasted``: it may have changed to and fro.
    """
    path, operation, shape = STATES[name]
    before, _ = robot.read(path, shape)
    robot.clock.sleep(apart_s)
    first()
    exchange = ask(subscribers, operation)
    between, problem = value_in(exchange, shape)
    robot.clock.sleep(apart_s)
    after, _ = robot.read(path, shape)
    if before is None or after is None:
        return None
    steady, broken = lasted(), ""
    if not problem:
        broken = shape.problem(between) or stamp_fault(between, before, after) or contradiction(between, before, after)
    problem = problem or disagreement(before, between, after, _slack(robot))
    if not problem and name == "pose" and not stamp_of(before) <= stamp_of(between) <= stamp_of(after):
        problem = f"stamp {stamp_of(between)}, which is not between {stamp_of(before)} and {stamp_of(after)}"
    return usable(StateRead(name, exchange, broken, problem), lasted=steady)


def usable(read: StateRead, *, lasted: bool) -> StateRead | None:
    """Return a reading that counts, without its difference if the state changed meanwhile; None if none is left."""
    if lasted or not read.differs:
        return read
    return replace(read, differs="") if read.broken else None


def stamp_fault(message: Any, *others: Any) -> str:
    """Return how a stamp differs from another's by less than a sample: the same stamp, written wrongly."""
    sec, nanosec = stamp_of(message)
    for other in map(stamp_of, others):
        apart_ns = 1e9 * (sec - other[0]) + nanosec - other[1]
        if 0 < abs(apart_ns) < _SAMPLES_APART_NS:
            return f"stamp {(sec, nanosec)}, {apart_ns:+g} ns from that of the same message, {other}"
    return ""


def contradiction(message: Any, before: Any, after: Any) -> str:
    """Return how a SOAP message differs from the REST message with the same stamp, before or after it."""
    of_one_sample = stamp_of(before) == stamp_of(message) == stamp_of(after) != (0.0, 0.0)
    if not of_one_sample or disagreement(before, after, before, _SLACK):
        return ""
    return disagreement(before, message, after, _SLACK)


def _slack(robot: Robot) -> Slack:
    """Return how far a sample may lie outside its neighbours because of noise."""
    noise = robot.limits.noise
    return Slack(_SLACK.absolute + FARTHEST * max(msgspec.structs.astuple(noise)), _SLACK.relative)


def compare(
    robot: Robot,
    subscribers: SoapService,
    name: str,
    renew: Callable[[], object] = lambda: None,
    lasted: Callable[[], bool] = _always,
    *,
    first: Callable[[], object] = _nothing,
) -> list[StateRead]:
    """Compare a state over both interfaces, repeatedly, as one may lag behind by an odometry message.

    Args:
        robot: the robot over REST.
        subscribers: its SOAP service.
        name: "pose" or "velocity".
        renew: called before each try to keep the state as it is.
        lasted: returns whether it certainly has been kept.
        first: called just before each reading over SOAP.
    """

    def tries() -> Iterator[StateRead | None]:
        for apart_s in (0.0, robot.sample_s, robot.sample_s):
            renew()
            yield read_state(robot, subscribers, name, apart_s, lasted, first=first)

    return best_of(tries())


def best_of(tries: Iterable[StateRead | None]) -> list[StateRead]:
    """Return the first try without a difference, or the last one, with the differences that time cannot explain."""
    reads: list[StateRead] = []
    for read in tries:
        reads = for_good(reads)
        reads += [] if read is None else [read]
        if read is None or not read.differs:
            break
    return reads


def for_good(reads: Iterable[StateRead]) -> list[StateRead]:
    """Return the readings that are broken by themselves, without the differences that time may explain."""
    return [replace(read, differs="") for read in reads if read.broken]
