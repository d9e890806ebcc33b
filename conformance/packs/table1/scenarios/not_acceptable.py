"""PUTs whose Accept header excludes all formats: the robot must either reject them with 406 or apply them.

A PUT answered 406 must have no effect, and a PUT answered 2xx must have one (RFC 9110 9.3.4).
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from http import HTTPStatus
from typing import Any, Final

from conformance.api.rest.calls import JSON
from conformance.api.rest.interface import RestInterface
from conformance.packs.table1.robot.drive import Drive
from conformance.packs.table1.robot.message_shapes import body_of
from conformance.packs.table1.robot.robot import GOAL_PATH, LINEAR, VELOCITY, Robot, Velocity
from conformance.packs.table1.robot.standstill import Standstill, watch_rest
from conformance.packs.table1.robot.stopping import bring_to_rest
from conformance.packs.table1.robot.taken import goal_has_effect, turned_goal, velocity_has_effect
from conformance.scenarios.scenario import scenario
from conformance.scenarios.stage import Need, Stage
from conformance.transport.exchange import Exchange
from conformance.verdict.evidence import Case

_AFTER: Final = "PUTs that were answered 406"
# No robot has its responses in this format.
_NO_FORMAT: Final = "image/png"


@dataclass(frozen=True)
class NotAcceptable:
    """A PUT whose Accept header excludes all formats.

    Attributes:
        path: the resource.
        exchange: request and response.
        has_effect: whether an accepted PUT had its effect; None: not accepted, or the usual PUT has no effect either.
        rest: readings after a PUT that was answered 406, else None.
    """

    path: str
    exchange: Exchange
    has_effect: bool | None = None
    rest: Case | None = None


@scenario(needs={Need.REST, Need.MOTION}, stage=Stage.STANDSTILL)
def not_acceptable(api: RestInterface, robot: Robot, standstill: Standstill) -> tuple[NotAcceptable, ...]:
    """PUT velocities and a goal with an Accept header that excludes all formats, at rest."""
    puts = _put_each(api, robot, 0.0)
    rests = [one.rest for one in puts if one.rest is not None]
    if rests:
        seconds = robot.limits.settle_s
        repeat = partial(_repeat, api, robot)
        standstill.attempted("http/not-acceptable-undone", _AFTER, repeat, seconds=seconds, goal=True)
    if not all(rest.holds for rest in rests):
        # By this attempt, or by an earlier one: each is repeated alone.
        standstill.watch()
    return puts


def _repeat(api: RestInterface, robot: Robot) -> list[Case]:
    """Send the same PUTs again, and watch the robot for the settle time after each."""
    return [one.rest for one in _put_each(api, robot, robot.limits.settle_s) if one.rest is not None]


def _put(robot: Robot, path: str, value: dict[str, Any]) -> Exchange:
    """PUT JSON with an Accept header that excludes all formats."""
    fields = (("Content-Type", JSON), ("Accept", _NO_FORMAT))
    return robot.rest.send("PUT", path, headers=fields, body=body_of(value))


def _put_each(api: RestInterface, robot: Robot, watched_s: float) -> tuple[NotAcceptable, ...]:
    """PUT velocities and a goal, and watch the robot for ``watched_s`` after each 406, until it moves."""
    fast = robot.share_of_limits(0.6, 0.4)
    straight = Velocity(*fast[:3])
    tried: list[tuple[str, dict[str, Any], Callable[[], bool | None]]] = [
        (VELOCITY, fast.twist, lambda: _velocity_has_effect(api, robot, VELOCITY, fast, fast.twist)),
        (LINEAR, fast.linear, lambda: _velocity_has_effect(api, robot, LINEAR, straight, fast.linear)),
    ]
    here = robot.map_pose()
    if here is not None:
        puts = partial(_put, robot, GOAL_PATH), partial(robot.put, GOAL_PATH)
        tried.append((GOAL_PATH, turned_goal(robot, here), lambda: goal_has_effect(api, *puts)))
    done: list[NotAcceptable] = []
    for path, value, has_effect in tried:
        exchange = _put(robot, path, value)
        effect, rest = None, None
        if exchange.response.ok:
            bring_to_rest(api)
            effect = has_effect()
        if exchange.response.status == HTTPStatus.NOT_ACCEPTABLE:
            rest = watch_rest(Drive(robot), f"PUT {path} that was answered 406", watched_s, goal=True)
        done.append(NotAcceptable(path, exchange, effect, rest))
        if rest is not None and not rest.holds:
            if watched_s:
                bring_to_rest(api)
            break
    return tuple(done)


def _velocity_has_effect(
    api: RestInterface, robot: Robot, path: str, wanted: Velocity, value: dict[str, Any]
) -> bool | None:
    return velocity_has_effect(api, wanted, partial(_put, robot, path, value), partial(robot.put, path, value))
