"""The class motion of devices with a map, over HTTP: right ones are not blamed, wrong ones are found."""

import json
import sys

import pytest
import rover
from arm import MAP, Arm
from processes import ended
from rover import Rover, serving_rover
from serving_apps import serving_app


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
    done, judged = _of_arm(Arm(noise=0.003), tmp_path)
    assert {id_ for id_, verdict in judged.items() if verdict != "pass"} == {"motion/unauthorised-still"}, done.stdout


def test_a_right_rover_that_clamps_and_takes_one_move_at_a_time_is_not_blamed(tmp_path):
    done, judged = _judged(serving_rover(Rover(noise=0.004)), rover.MAP, tmp_path)
    missing = {"motion/unauthorised-still", "motion/incomplete-still"}
    assert {id_ for id_, verdict in judged.items() if verdict != "pass"} == missing, done.stdout


@pytest.mark.parametrize(("fault", "requirement"), [("mixes", "one-client"), ("incomplete-moves", "incomplete-still")])
def test_a_fault_of_the_arm_is_found(fault, requirement, tmp_path):
    done, judged = _of_arm(Arm(fault), tmp_path)
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
    assert arm.moves == 0


def test_a_map_with_an_unknown_key_is_refused(tmp_path):
    statement = tmp_path / "arm.toml"
    with serving_app(Arm().app()) as url:
        wrong = MAP.replace("settle_s", "settles")
        statement.write_text(f'[api]\nopenapi = "{url}/openapi.json"\n{wrong}', encoding="utf-8")
        done = ended(sys.executable, "-m", "roaas", "certify", str(statement), "--out", str(tmp_path / "out"))
    assert done.returncode == 2
    assert "settles" in done.stderr
