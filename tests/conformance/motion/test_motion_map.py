"""The class motion of devices with a map, over HTTP: right ones are not blamed, wrong ones are found."""

import json
import sys
import tomllib

import msgspec
import mutants
import pytest
import rover
from arm import DESCRIPTION, LIMITS, MAP, Arm
from body import Body
from processes import ended
from rover import Rover, serving_rover
from serving_apps import serving_app

from conformance.documents.openapi import read_operations
from conformance.engine.first_motion import proposed_map
from conformance.statement.motion_map import MotionMap


def _judged(serving, motion, tmp_path):
    """Return what a run says of a device, by requirement of the class motion."""
    statement, out = tmp_path / "device.toml", tmp_path / "out"
    with serving as url:
        statement.write_text(f'[api]\nopenapi = "{url}/openapi.json"\n{motion}', encoding="utf-8")
        more = ["--allow-motion", "--effort", "quick", "--class", "motion", "--out", str(out)]
        done = ended(sys.executable, "-m", "roaas", "certify", str(statement), *more)
    assert "Traceback" not in done.stdout + done.stderr, done.stderr
    result = json.loads((out / "result.json").read_text(encoding="utf-8"))
    return done, {one["id"]: one["verdict"] for one in result["requirements"] if one["id"].startswith("motion/")}


def _of_arm(arm, tmp_path):
    quick = MAP.replace("seconds = 0.5", "seconds = 0.25").replace("speed = 4", "speed = 8")
    return _judged(serving_app(arm.app()), quick, tmp_path)


def test_a_right_arm_is_not_blamed(tmp_path):
    done, judged = _of_arm(Arm(Body(LIMITS, noise=0.003)), tmp_path)
    undeclared = {"unauthorised-still", "velocity", "velocity-stop", "watchdog", "hold", "switches"}
    missing = {f"motion/{name}" for name in undeclared}
    assert {id_ for id_, verdict in judged.items() if verdict != "pass"} == missing, done.stdout
    # Its moves are stored, and can be judged again without it.
    again = ["replay", "--recorded", str(tmp_path / "out"), "--statement", str(tmp_path / "device.toml")]
    told = ended(sys.executable, "-m", "roaas", *again)
    assert (told.returncode, "motion/stop-lasts passes" in told.stdout) == (0, True), told.stdout + told.stderr


def test_a_right_rover_that_clamps_and_takes_one_move_at_a_time_is_not_blamed(tmp_path):
    done, judged = _judged(serving_rover(Rover(Body(rover.LIMITS, noise=0.004))), rover.MAP, tmp_path)
    undeclared = {"unauthorised-still", "agrees", "action-runs", "action-succeeds", "action-canceled"}
    missing = {f"motion/{name}" for name in undeclared}
    assert {id_ for id_, verdict in judged.items() if verdict != "pass"} == missing, done.stdout


@pytest.mark.parametrize(("fault", "requirement"), [("mixes", "one-client"), ("incomplete-moves", "incomplete-still")])
def test_a_fault_of_the_arm_is_found(fault, requirement, tmp_path):
    done, judged = _of_arm(Arm(fault=fault), tmp_path)
    assert judged[f"motion/{requirement}"] == "fail", done.stdout


def test_without_permission_nothing_moves(tmp_path):
    arm = Arm()
    with serving_app(arm.app()) as url:
        statement = tmp_path / "arm.toml"
        statement.write_text(f'[api]\nopenapi = "{url}/openapi.json"\n{MAP}', encoding="utf-8")
        ended(
            sys.executable,
            "-m",
            "roaas",
            "certify",
            str(statement),
            "--effort",
            "quick",
            "--out",
            str(tmp_path / "out"),
        )
    assert arm.body.moves == 0


@pytest.mark.parametrize(
    ("right", "wrong", "told"),
    [
        ("settle_s", "settles", "settles"),
        ("POST /move", "POST /moves", "did you mean 'POST /move'"),
        ('tilt = "{tilt}"', "tilt = 0.0", "no {tilt}"),
        ("{goto:/id}", "{id}", "{id}"),
    ],
)
def test_a_wrong_map_is_refused_and_nothing_moves(right, wrong, told, tmp_path):
    arm, statement = Arm(), tmp_path / "arm.toml"
    with serving_app(arm.app()) as url:
        changed = MAP.replace(right, wrong)
        statement.write_text(f'[api]\nopenapi = "{url}/openapi.json"\n{changed}', encoding="utf-8")
        more = ["--allow-motion", "--out", str(tmp_path / "out")]
        done = ended(sys.executable, "-m", "roaas", "certify", str(statement), *more)
    assert (done.returncode, arm.body.moves) == (2, 0)
    assert told in done.stderr


def test_a_device_that_the_map_cannot_see_is_not_moved(tmp_path):
    arm = Arm()
    done, judged = _judged(serving_app(arm.app()), MAP.replace("/joints/pan", "/joints/pen"), tmp_path)
    assert (arm.body.moves, "pass" in judged.values()) == (0, False), done.stdout
    assert done.returncode == 4
    assert "/joints/pen" in done.stdout


def test_init_proposes_a_map_that_the_names_suggest():
    proposed = tomllib.loads("\n".join(proposed_map(read_operations(DESCRIPTION))))["motion"]
    motion = msgspec.convert(proposed, MotionMap)
    given = tomllib.loads(MAP)["motion"]
    assert (motion.state.read, set(motion.state.axes)) == ("GET /state", {"pan", "tilt"})
    assert motion.state.axes["tilt"].limits == (-0.4, 0.6)
    assert motion.goto is not None
    assert (motion.goto.send, motion.goto.body) == (given["goto"]["send"], given["goto"]["body"])
    assert motion.stop is not None
    assert motion.stop.send == "POST /stop"


def test_the_certificate_draws_how_it_moved(tmp_path):
    """A stop that is ignored: its picture stands first."""
    body = Body(LIMITS)
    mutants.of_arm()["stop-ignored"](body)
    done, judged = _of_arm(Arm(body), tmp_path)
    assert judged["motion/stop"] == "fail", done.stdout
    page = (tmp_path / "out" / "certificate.html").read_text(encoding="utf-8")
    first = page.index('<figure class="move')
    assert "A stop of pan under way" in page[first : page.index("</figcaption>", first)]
    assert page.count('<polyline class="way"') > 10
