"""The lists of sensors and of navigation services."""

import itertools
import json
from typing import Any

import pytest

from conformance.documents.json_schema import Shape
from conformance.packs.table1.robot.message_shapes import MESSAGE_TYPE, SERVICE_TYPE, read_as
from conformance.packs.table1.robot.message_shapes import SENSORS as SENSORS_SHAPE
from conformance.packs.table1.robot.message_shapes import SERVICES as SERVICES_SHAPE
from conformance.packs.table1.robot.robot import SENSORS, SERVICES, Robot
from conformance.transport.exchange import Exchange
from conformance.verdict.effort import Effort
from conformance.verdict.evidence import Judge

pytestmark = [pytest.mark.phase("reading"), pytest.mark.needs("rest")]


@pytest.mark.requirement(
    "rest-resources/sensors-type",
    "rest-resources/sensors-unique",
    "rest-resources/sensors-named-in-full",
    "rest-resources/sensors-stable",
)
def test_sensors(robot: Robot, judge: Judge, effort: Effort) -> None:
    """Check each reading: {name, topic, type} without duplicates, and the same list each time."""
    _read_often(robot, judge, "sensors", SENSORS, SENSORS_SHAPE, MESSAGE_TYPE, effort.cases(100))


@pytest.mark.requirement(
    "rest-resources/services-type",
    "rest-resources/services-unique",
    "rest-resources/services-named-in-full",
    "rest-resources/services-stable",
)
def test_services(robot: Robot, judge: Judge, effort: Effort) -> None:
    """Check each reading: {name, type} without duplicates, and the same list each time."""
    _read_often(robot, judge, "services", SERVICES, SERVICES_SHAPE, SERVICE_TYPE, effort.cases(100))


def _read_often(robot: Robot, judge: Judge, what: str, path: str, shape: Shape, full: Shape, times: int) -> None:
    fields = "{name, topic, type}" if what == "sensors" else "{name, type}"
    before: list[str] | None = None
    for _ in range(times):
        exchange = robot.get(path)
        entries, problem = read_as(exchange.response, shape)
        holds = judge.check(
            f"rest-resources/{what}-type", not problem, exchange, f"status 200 with a list of {fields}", found=problem
        )
        if not holds:
            continue
        listed = _judge_entries(judge, what, entries, exchange, full)
        if before is not None:
            judge.check(
                f"rest-resources/{what}-stable",
                listed == before,
                exchange,
                "the same list as before",
                found=f"{len(before)} entries, then {len(listed)}; {len(set(before) ^ set(listed))} in one only",
                cause="another list",
            )
        before = listed


def _judge_entries(judge: Judge, what: str, entries: list[Any], exchange: Exchange, full: Shape) -> list[str]:
    """Judge one list, and return its entries as sorted texts."""
    names = ("name", "topic", "type") if what == "sensors" else ("name", "type")
    listed = sorted(json.dumps([entry[name] for name in names]) for entry in entries)
    twice = next((one for one, two in itertools.pairwise(listed) if one == two), "")
    judge.check(
        f"rest-resources/{what}-unique", not twice, exchange, "no entry twice", found=f"twice {twice}", cause="twice"
    )
    short = next((entry["type"] for entry in entries if full.problem(entry["type"])), "")
    judge.check(
        f"rest-resources/{what}-named-in-full",
        not short,
        exchange,
        f"a type named in full, as {'sensor_msgs/msg/LaserScan' if what == 'sensors' else 'nav_msgs/srv/GetPlan'}",
        found=f"type {short!r}",
        cause="not in full",
    )
    return listed
