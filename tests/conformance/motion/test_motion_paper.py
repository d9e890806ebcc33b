"""The paper's robot as any device that moves: its map is what its statement declares."""

import tomllib
from pathlib import Path

import msgspec
import pytest
import rover
from driven_device import SimulatedClock
from paper_map import motion_map_of
from simulated import DEVICES, MUTANTS, RULES, Api, cases_of, map_of, played

from conformance.papers_robot.statement import load_robot_statement
from conformance.scenarios.motion.mapped import MappedDevice
from conformance.scenarios.motion.moves import stops
from conformance.statement.motion_map import MotionMap

_ROOT = Path(__file__).parents[3]
_AREA = (66.8, 37.2, 69.8, 40.2)


def _statement(name="statement", **declared):
    found = load_robot_statement(_ROOT / "reference_robot" / f"{name}.toml")
    return msgspec.structs.replace(found, declared=msgspec.structs.replace(found.declared, **declared))


def test_the_example_is_the_reference_robots_map():
    text = (_ROOT / "examples" / "paper_robot" / "paper-robot.toml").read_text(encoding="utf-8")
    example = msgspec.convert(tomllib.loads(text)["motion"], MotionMap)
    assert example == motion_map_of(_statement(goal_m=0.12), _AREA)


@pytest.mark.parametrize(
    ("name", "velocities"),
    [("statement", {"ahead", "turn"}), ("holonomic", {"ahead", "aside", "turn"}), ("ackermann", {"ahead"})],
)
def test_a_map_has_the_velocities_that_a_robot_can_drive_one_by_one(name, velocities):
    assert set(motion_map_of(_statement(name), _AREA).velocity.axes) == velocities


def test_noise_and_undeclared_limits_are_not_held_against_a_robot():
    exact, noisy = (motion_map_of(_statement(name), _AREA) for name in ("statement", "realistic"))
    assert noisy.speed_tolerance("ahead") > exact.speed_tolerance("ahead")
    assert motion_map_of(_statement(linear_m_s=None), _AREA).velocity.beyond_limits == "undefined"


def test_goals_in_another_frame_than_the_odometrys_are_not_described():
    found = _statement()
    elsewhere = msgspec.structs.replace(
        found, motion=msgspec.structs.replace(found.motion, odom_to_map=(1.0, 0.0, 0.0))
    )
    assert motion_map_of(elsewhere, _AREA).goto is None


class _Clock(SimulatedClock):
    """A clock that goes on whenever it is read."""

    def now(self):
        self.sleep(1e-6)
        return super().now()


class _Refusing(rover.Rover):
    """A rover that refuses a stop while it has no goal, as the paper's robot does."""

    def answer(self, method, path, octets):
        if method == "DELETE" and not self.body.moving(self.body.now()):
            return 404, {}
        return super().answer(method, path, octets)


@pytest.mark.parametrize("speed", [0.0, 0.3])
def test_a_stop_that_is_refused_while_no_goal_is_active_leaves_the_device_at_rest(speed):
    clock = _Clock()
    body = rover.Body(rover.LIMITS, clock.now, clock.sleep)
    mapped = MappedDevice(Api(_Refusing(body), clock, lambda: 0.002), map_of(rover.MAP), clock)
    mapped.drive({"ahead": speed})
    assert mapped.leave_at_rest() == ""
    assert not any(body.velocity(clock.now()).values())


def test_a_device_that_takes_up_a_velocity_after_a_stop_is_found_though_its_stop_is_refused_at_rest(monkeypatch):
    monkeypatch.setitem(DEVICES, "rover", (_Refusing, rover.LIMITS, rover.MAP))
    found = {}
    for change in (None, MUTANTS["rover"]["resumes-after-stop"]):
        traces = {scenario: (trace, given) for scenario, trace, given in played("rover", change, effort="quick")}
        rules = [one for one in RULES if one.requirement in {"motion/stop", "motion/stop-lasts"}]
        found[change] = [one.holds for rule in rules for one in cases_of(rule, *traces[stops])]
    assert all(found.pop(None))
    assert not all(found.popitem()[1])
