"""Read the lists of sensors and of navigation services; a checker judges the entries of every read."""

import pytest

from conformance.documents.json_shape import Shape
from conformance.packs.table1.robot.agreement import entries_of
from conformance.packs.table1.robot.message_shapes import SENSORS as SENSORS_SHAPE
from conformance.packs.table1.robot.message_shapes import SERVICES as SERVICES_SHAPE
from conformance.packs.table1.robot.message_shapes import read_as
from conformance.packs.table1.robot.robot import SENSORS, SERVICES, Robot
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
    _read_often(robot, judge, "sensors", SENSORS, SENSORS_SHAPE, effort.cases(100))


@pytest.mark.requirement(
    "rest-resources/services-type",
    "rest-resources/services-unique",
    "rest-resources/services-named-in-full",
    "rest-resources/services-stable",
)
def test_services(robot: Robot, judge: Judge, effort: Effort) -> None:
    """Check each reading: {name, type} without duplicates, and the same list each time."""
    _read_often(robot, judge, "services", SERVICES, SERVICES_SHAPE, effort.cases(100))


def _read_often(robot: Robot, judge: Judge, what: str, path: str, shape: Shape, times: int) -> None:
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
        listed = entries_of(entries, tuple(shape.schema["items"]["properties"]))
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
