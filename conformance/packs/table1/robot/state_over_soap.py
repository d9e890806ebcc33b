"""Compare a state read over SOAP with readings of the same state over REST before and after it."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Any, Final

import msgspec

from conformance.api.soap.service import SoapService
from conformance.documents.json_shape import Shape
from conformance.documents.representation import from_element
from conformance.measures.samples import FARTHEST
from conformance.packs.table1.robot.agreement import Slack, disagreement, stamp_of
from conformance.packs.table1.robot.message_shapes import ODOMETRY, TWIST
from conformance.packs.table1.robot.robot import GOAL_PATH, POSE, VELOCITY, Robot
from conformance.packs.table1.robot.soap_services import ask, returns
from conformance.transport.exchange import Exchange
from conformance.verdict.evidence import Case

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
