"""Requests that command nothing: they neither renew a velocity nor end it, and spoil no command just after them."""

import random
from collections.abc import Callable
from typing import Final

from conformance.api.soap.callable_services import SoapServices
from conformance.contract.classes import Interface
from conformance.packs.table1.robot.delivery import Delivery, path_of
from conformance.packs.table1.robot.geometry import Pose
from conformance.packs.table1.robot.goal import goal_body, put_goal
from conformance.packs.table1.robot.robot import (
    ACCEPT_JSON,
    GOAL_PATH,
    JSON_BODY,
    LINEAR,
    SENSORS,
    VELOCITY,
    Robot,
    Velocity,
)
from conformance.packs.table1.robot.soap_services import ask, send_delivery

_NOT_ACCEPTABLE: Final = (("Accept", "image/png"),)
_BEYOND: Final = Velocity(angular_z=1e4)
# Quaternions off by more than 2e-3 are refused (contract.md#poses).
_NO_UNIT: Final = 2.0
_NO_DELIVERY: Final = Delivery(0, *map(float, range(6)))
_MALFORMED: Final = b'{"linear": '
_NO_NUMBER: Final = ("3", "1", "2", "3", "4", "5", "abc")


def refuse_goal(robot: Robot) -> object:
    """PUT a goal that the robot must refuse."""
    return put_goal(robot, goal_body(Pose(0.0, 0.0, 0.0), "map", length=_NO_UNIT))


def no_commands(robot: Robot, soap: SoapServices, seed: str) -> list[Callable[[], object]]:
    """Return requests that are refused or only read, some of another client, in an order set by the seed.

    Args:
        robot: the robot.
        soap: its SOAP services.
        seed: of the order.
    """
    away = soap.run.unreachable
    publishers = None if Interface.PUBLISHERS in away else soap.publishers
    subscribers = None if Interface.SUBSCRIBERS in away else soap.subscribers
    rest = robot.rest
    found: list[Callable[[], object]] = [
        lambda: robot.put_velocity(_BEYOND),
        lambda: robot.put_linear(_BEYOND._replace(linear_x=1e3, angular_z=0.0)),
        lambda: refuse_goal(robot),
        lambda: rest.send("PUT", path_of(*_NO_NUMBER)),
        lambda: rest.send("GET", VELOCITY, headers=_NOT_ACCEPTABLE),
        lambda: rest.send("HEAD", VELOCITY),
        lambda: rest.send("OPTIONS", LINEAR),
        lambda: rest.send("GET", SENSORS),
        lambda: rest.send("PUT", VELOCITY, headers=JSON_BODY, body=_MALFORMED, fresh=True),
        lambda: rest.send("PUT", GOAL_PATH, headers=JSON_BODY, body=_MALFORMED, fresh=True),
        lambda: rest.send("GET", VELOCITY, headers=ACCEPT_JSON, fresh=True),
    ]
    if publishers is not None:
        found.append(lambda: send_delivery(publishers, _NO_DELIVERY))
    if subscribers is not None:
        found.append(lambda: ask(subscribers, "GetVelocity"))
        found.append(lambda: ask(subscribers, "GetPose"))
    random.Random(f"{seed}/no commands").shuffle(found)  # noqa: S311 - no secret
    return found
