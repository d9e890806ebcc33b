"""A device whose heading is a quaternion and that takes a velocity in several ways: right, and wrong in one of them."""

import math

import carriage
import msgspec
import pytest
from carriage import Carriage
from simulated import DEVICES, RULES, cases_of, map_of, played

from conformance.scenarios.motion.templates import NoValueError, angle_of, positions_at, quaternion_of
from conformance.statement.motion_map import Axis


def _failed(monkeypatch, fault="", **more):
    """Return the rules that a carriage breaks, and those that judged it."""
    monkeypatch.setitem(DEVICES, "carriage", (lambda body: Carriage(body, fault), carriage.LIMITS, carriage.MAP))
    cases = {}
    for scenario, trace, given in played("carriage", **more):
        for rule in (one for one in RULES if scenario in one.on):
            cases.setdefault(rule.requirement, []).extend(cases_of(rule, trace, given))
    return {id_ for id_, found in cases.items() if not all(one.holds for one in found)}, {
        one for one in cases if cases[one]
    }


def _turned(by):
    """Return what turns a carriage before it is seen."""

    def change(body):
        body.start = body.target = {"x": 0.0, "heading": by}

    return change


@pytest.mark.parametrize("effort", ["quick", "standard"])
@pytest.mark.parametrize("heading", [0.0, 3.1, -3.1, 40.0])
def test_a_right_carriage_is_not_blamed_whichever_way_it_looks(heading, effort, monkeypatch):
    failed, judged = _failed(monkeypatch, mutant=_turned(heading), noise=0.004, effort=effort)
    assert failed == set()
    assert {"motion/reaches", "motion/velocity", "motion/watchdog", "motion/hold", "motion/agrees"} <= judged


@pytest.mark.parametrize("fault", carriage.FAULTS)
def test_a_fault_of_one_way_to_command_is_found(fault, monkeypatch):
    assert _failed(monkeypatch, fault, noise=0.004, effort="standard")[0]


def test_at_quick_each_way_has_its_turn(monkeypatch):
    faults = {"xml-lost", "form-halved", "xml-runs-on", "ahead-lost"}
    found = {one for one in faults for seed in range(4) if _failed(monkeypatch, one, seed=seed, effort="quick")[0]}
    assert found == faults


@pytest.mark.parametrize(("unit", "whole"), [("rad", math.tau), ("deg", 360.0), ("h", 24.0)])
@pytest.mark.parametrize("angle", ["roll", "pitch", "yaw"])
@pytest.mark.parametrize("value", [-3.0, -1.2, 0.0, 0.7, 1.5, 3.1])
def test_a_quaternion_that_is_sent_is_the_angle_that_is_read(angle, value, unit, whole):
    turned = math.remainder(value, math.pi) if angle == "pitch" else value
    if angle == "pitch" and abs(turned) > math.pi / 2:
        turned = math.copysign(math.pi, turned) - turned
    axis = Axis("/a", (-3, 3), unit=unit, angle=angle)
    parts = list(quaternion_of("it", turned * whole / math.tau, axis).values())
    named = dict(zip("xyzw", parts, strict=True))
    for written in (parts, named, [-one for one in parts], {name: 3 * one for name, one in named.items()}):
        assert angle_of(written, angle) == pytest.approx(turned, abs=1e-9)
        read = positions_at({"a": written}, {"it": "/a"}, {"it": axis})["it"]
        assert read == pytest.approx(turned * whole / math.tau, abs=1e-7)


@pytest.mark.parametrize("wrong", [{}, [0, 0, 0], [0, 0, 0, 0], {"x": 0, "y": 0, "z": 0}, [0, 0, 0, math.nan], "w"])
def test_what_is_no_quaternion_has_no_angle(wrong):
    with pytest.raises(NoValueError):
        angle_of(wrong, "yaw")


@pytest.mark.parametrize(
    ("one", "other", "apart"), [(3.1, -3.1, 6.2 - math.tau), (13.0, 0.5, 12.5 - 2 * math.tau), (1, 0, 1)]
)
def test_what_turns_is_apart_by_the_shorter_way(one, other, apart):
    axis = Axis("/a", (-3, 3), angle="yaw")
    assert axis.apart(one, other) == pytest.approx(apart)
    assert axis.near(one, other) == pytest.approx(other + apart)
    degrees = Axis("/a", (-170, 170), unit="deg", angle="yaw")
    assert degrees.apart(math.degrees(one), math.degrees(other)) == pytest.approx(math.degrees(apart))
    assert Axis("/a", (-3, 3)).apart(one, other) == one - other


@pytest.mark.parametrize(("unit", "moved"), [("deg", 9.0), ("°", 9.0), ("rad", 351 % math.tau - math.tau), ("m", 351)])
def test_an_angle_that_begins_anew_has_not_moved_a_whole_turn(unit, moved):
    """A telescope that goes from 359 degrees to 8 has moved by 9, whether its map says `angle` or not."""
    assert Axis("/a", (10, 50), unit=unit).distance(8.0, 359.0) == pytest.approx(abs(moved))


def test_a_unit_without_a_whole_turn_is_told():
    with pytest.raises(ValueError, match=r"unit = 'gon' of what turns must be one of rad, deg"):
        Axis("/a", (10, 50), unit="gon", angle="yaw")


@pytest.mark.parametrize(
    ("right", "wrong", "told"),
    [
        ('root = "velocity"\n', "", "root names the root element"),
        ('{ahead}"\n', '{forwards}"\n', "no {ahead}"),
        ("{heading:/z}", "{heading:/v}", "heading:/v"),
        ('angle = "yaw", ', "", "no {heading}"),
        ('angle = "yaw"', 'angle = "jaw"', "jaw"),
    ],
)  # fmt: skip
def test_a_wrong_way_or_angle_is_told(right, wrong, told):
    assert right in carriage.MAP
    with pytest.raises(msgspec.ValidationError, match=told.replace("{", r"\{")):
        map_of(carriage.MAP.replace(right, wrong))
