"""Scenarios with a real robot: compare a gateway's responses with messages that the suite receives on ROS."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass
from typing import Final

from conformance.observe.clock import WALL_CLOCK
from conformance.scenarios.ros.definition import Definition
from conformance.scenarios.ros.gateway import Gateway
from conformance.scenarios.ros.robot import Heard, Robot
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
        definition: the definition of its type.
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
    robot, watched = gateway.robot, dict(gateway.of(Reads))
    looks: dict[str, list[Look]] = {call: [] for call in watched}
    heard: dict[str, list[Heard]] = {}
    reliable: dict[str, bool] = {}

    def watches() -> tuple[Watched, ...]:
        WALL_CLOCK.sleep(_COMES_S)
        for topic, messages in heard.items():
            heard[topic] = [*messages, *robot.take_heard(topic)]
        return tuple(
            Watched(
                call, topic, gateway.definition(reads.type), tuple(looks[call]), tuple(heard[topic]), reliable[topic]
            )
            for call, reads in watched.items()
            if heard.get(topic := reads.topic)
        )

    with ExitStack() as stack, partial_trace(watches):
        for reads in watched.values():
            if reads.topic not in heard:
                stack.enter_context(robot.publishing(reads.topic))
                heard[reads.topic], reliable[reads.topic] = _listen(robot, reads)
        if not any(heard.values()):
            silent = dict.fromkeys(f"{reads.topic} ({reads.type})" for reads in watched.values())
            raise NotSeenError(f"no message came on {', '.join(silent)} in ROS domain {gateway.ros.domain}")
        within_s = max(reads.max_age_s or reads.within_s for reads in watched.values())
        # From now on, what the gateway has must be one that was heard.
        WALL_CLOCK.sleep(within_s)
        for _ in range(_READS[effort.name]):
            # At once, so that one that goes back shows; and for so long that one that stands still does.
            for call in [call for call, reads in watched.items() if heard[reads.topic] for _ in range(_AT_ONCE)]:
                looks[call].append(Look(WALL_CLOCK.now(), gateway.read(call, watched[call])))
            WALL_CLOCK.sleep((within_s + _LATE_S) / _READS[effort.name])
        return watches()


def _listen(robot: Robot, reads: Reads) -> tuple[list[Heard], bool]:
    """Listen to a topic; return the first messages, and whether all of them arrive."""
    for _ in range(2):
        best_effort = robot.tell("listen", topic=reads.topic, type=reads.type)["best_effort"]
        if heard := robot.take_heard(reads.topic, 1, reads.within_s):
            return heard, not best_effort
        # New publishers may be best effort, and a reliable subscriber does not receive their messages.
        robot.tell("forget", name=reads.topic)
    return [], False
