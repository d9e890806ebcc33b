"""Scenarios beside a real robot: compare a gateway's responses with messages that the suite receives on ROS."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from conformance.observe.clock import WALL_CLOCK
from conformance.scenarios.ros.definition import Definition
from conformance.scenarios.ros.gateway import Gateway
from conformance.scenarios.ros.robot import Heard
from conformance.scenarios.scenario import NoOccasionError, NotSeenError, partial_trace, scenario
from conformance.scenarios.stage import Leaves, Need, Stage
from conformance.statement.ros_map import Reads
from conformance.transport.exchange import Exchange
from conformance.verdict.effort import Effort

_READS: Final = {"quick": 5, "standard": 15, "deep": 60}
_AT_ONCE: Final = 2
# Delay beyond the declared one from which a message is late, s.
_LATE_S: Final = 2.5
# A message may be on its way to the suite while the gateway has it already, s.
_COMES_S: Final = 0.5


@dataclass(frozen=True)
class Look:
    """One read: the time of its request, and the response."""

    sent: float
    exchange: Exchange


@dataclass(frozen=True)
class Watched:
    """A topic as the gateway returns it, and as the suite heard it.

    Attributes:
        operation: the operation.
        topic: its topic.
        definition: of its type.
        looks: in order.
        heard: its messages, in order, from so long before the first look that none need be older.
        reliable: whether no message is lost on the way to the suite.
    """

    operation: str
    topic: str
    definition: Definition
    looks: tuple[Look, ...]
    heard: tuple[Heard, ...]
    reliable: bool


@scenario(needs=(Need.REST,), leaves=Leaves.UNTOUCHED, stage=Stage.SETTLING)
def topic_watches(gateway: Gateway, effort: Effort) -> tuple[Watched, ...]:
    """Read topics through the gateway while a robot publishes on them, and hear them as well."""
    if gateway.plays:
        raise NoOccasionError("the suite is the robot, and publishes itself")
    found: list[Watched] = []
    silent: list[str] = []
    with partial_trace(lambda: tuple(found)):
        for call, reads in gateway.of(Reads):
            with gateway.robot.publishing(reads.topic):
                seen = _watch_topic(gateway, call, reads, _READS[effort.name])
            if seen is None:
                silent.append(f"{reads.topic} ({reads.type})")
            else:
                found.append(seen)
        if silent and not found:
            raise NotSeenError(f"no message came on {', '.join(silent)} in ROS domain {gateway.ros.domain}")
    return tuple(found)


def _watch_topic(gateway: Gateway, call: str, reads: Reads, number: int) -> Watched | None:
    """Return the reads and messages of a topic, or None if it is silent."""
    robot, clock = gateway.robot, WALL_CLOCK
    definition, within_s = gateway.definition(reads.type), reads.max_age_s or reads.within_s
    for _ in range(2):
        best_effort = robot.tell("listen", topic=reads.topic, type=reads.type)["best_effort"]
        if heard := robot.take_heard(reads.topic, 1, reads.within_s):
            break
        # Publishers that were found meanwhile may be of best effort, which a reliable subscriber does not hear.
        robot.tell("forget", name=reads.topic)
    else:
        return None
    # From now on, what the gateway has must be one that was heard.
    clock.sleep(within_s)
    looks: list[Look] = []
    for _ in range(number):
        # At once, so that one that goes back shows; and for so long that one that stands still does.
        for _ in range(_AT_ONCE):
            sent = clock.now()
            looks.append(Look(sent, gateway.read(call, reads)))
        clock.sleep((within_s + _LATE_S) / number)
    clock.sleep(_COMES_S)
    heard += robot.take_heard(reads.topic)
    return Watched(call, reads.topic, definition, tuple(looks), tuple(heard), not best_effort)
