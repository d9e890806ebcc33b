"""PUTs whose Accept header excludes all formats: the robot must either reject them with 406 or apply them.

A PUT answered 406 must have no effect, and a PUT answered 2xx must have one (RFC 9110 9.3.4).
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any, Final

from conformance.api.rest.calls import JSON
from conformance.api.rest.interface import RestInterface
from conformance.packs.table1.robot.message_shapes import body_of
from conformance.packs.table1.robot.robot import GOAL_PATH, LINEAR, VELOCITY, Robot, Velocity
from conformance.packs.table1.robot.stopping import bring_to_rest
from conformance.packs.table1.robot.taken import goal_has_effect, turned_goal, velocity_has_effect
from conformance.scenarios.scenario import scenario
from conformance.scenarios.stage import Need, Stage
from conformance.transport.exchange import Exchange

# No robot has its responses in this format.
_NO_FORMAT: Final = "image/png"


@dataclass(frozen=True)
class NotAcceptable:
    """A PUT whose Accept header excludes all formats.

    Attributes:
        path: the resource.
        exchange: request and response.
        has_effect: whether an accepted PUT had its effect; None: not accepted, or the usual PUT has no effect either.
    """

    path: str
    exchange: Exchange
    has_effect: bool | None = None


@scenario(needs={Need.REST, Need.MOTION}, stage=Stage.MOTION)
def not_acceptable(api: RestInterface, robot: Robot) -> tuple[NotAcceptable, ...]:
    """PUT velocities and a goal with an Accept header that excludes all formats, at rest."""
    return tuple(_put_each(api, robot))


def put_unacceptable(robot: Robot, path: str, value: dict[str, Any]) -> Exchange:
    """PUT JSON with an Accept header that excludes all formats."""
    fields = (("Content-Type", JSON), ("Accept", _NO_FORMAT))
    return robot.rest.send("PUT", path, headers=fields, body=body_of(value))


def _put_each(api: RestInterface, robot: Robot) -> Iterator[NotAcceptable]:
    fast = robot.share_of_limits(0.6, 0.4)
    straight = Velocity(*fast[:3])
    tried: list[tuple[str, dict[str, Any], Callable[[], bool | None]]] = [
        (VELOCITY, fast.twist, lambda: _velocity_has_effect(api, robot, VELOCITY, fast, fast.twist)),
        (LINEAR, fast.linear, lambda: _velocity_has_effect(api, robot, LINEAR, straight, fast.linear)),
    ]
    here = robot.map_pose()
    if here is not None:
        puts = partial(put_unacceptable, robot, GOAL_PATH), partial(robot.put, GOAL_PATH)
        tried.append((GOAL_PATH, turned_goal(robot, here), lambda: goal_has_effect(api, *puts)))
    for path, value, has_effect in tried:
        exchange = put_unacceptable(robot, path, value)
        effect = None
        if exchange.response.ok:
            bring_to_rest(api)
            effect = has_effect()
        yield NotAcceptable(path, exchange, effect)


def _velocity_has_effect(
    api: RestInterface, robot: Robot, path: str, wanted: Velocity, value: dict[str, Any]
) -> bool | None:
    put = partial(put_unacceptable, robot, path, value)
    return velocity_has_effect(api, wanted, put, partial(robot.put, path, value))
