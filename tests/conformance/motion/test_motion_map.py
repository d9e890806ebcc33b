"""Maps: what they permit, what is wrong with them, and what --init proposes."""

import sys
import tomllib
from pathlib import Path

import msgspec
import pytest
import turntable
from arm import DESCRIPTION, MAP, Arm
from judged_devices import judged_by_map
from processes import ended
from serving_apps import serving_app

from conformance.documents.openapi import read_operations
from conformance.engine.first_described import proposed_map
from conformance.statement.motion_map import MotionMap

EXAMPLES = Path(__file__).parents[3] / "examples"


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
    done, judged = judged_by_map(serving_app(arm.app()), MAP.replace("/joints/pan", "/joints/pen"), tmp_path)
    assert (arm.body.moves, "pass" in judged.values()) == (0, False), done.stdout
    assert done.returncode == 4
    assert "/joints/pen" in done.stdout


@pytest.mark.parametrize("path", sorted(EXAMPLES.glob("*/*.toml")), ids=lambda path: path.stem)
def test_the_examples_are_maps(path):
    given = tomllib.loads(path.read_text(encoding="utf-8"))
    if "motion" in given:
        assert len(msgspec.convert(given["motion"], MotionMap).calls) > 1


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


def test_init_proposes_a_read_for_each_axis_of_a_device_whose_paths_have_ids():
    proposed = tomllib.loads("\n".join(proposed_map(read_operations(turntable.DESCRIPTION))))["motion"]
    assert proposed["state"]["read"] == "GET /telescope/{device_number}/azimuth"
    assert proposed["state"]["axes"]["Altitude"]["read"] == "GET /telescope/{device_number}/altitude"
    assert proposed["goto"]["send"] == "PUT /telescope/{device_number}/slew"
    assert proposed["stop"]["send"] == "PUT /telescope/{device_number}/abort"
