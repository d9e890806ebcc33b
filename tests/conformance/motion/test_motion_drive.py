"""``roaas certify --drive``: the axes are found by driving, and four questions are answered, without a file."""

import copy
import json
import sys
import tomllib

import pytest
import rover
import winch
from arm import Arm
from body import Body
from judged_devices import stays_within, until
from processes import ended
from rover import Rover, serving_rover
from serving_apps import serving_app
from starlette.responses import JSONResponse
from winch import Winch

from conformance.statement.statement import motion_map_of
from reports.rendering import render


class WokenByReading(Body):
    """A rover that holds its velocity for as long as somebody reads where it is."""

    def said(self, now):
        if any(self.speeds.values()) and now < self.held_until:
            self.held_until = now + rover.HOLD_S
        return super().said(now)


def _driven(url, tmp_path, *more, drive="PUT /velocity"):
    out, saved = tmp_path / "out", tmp_path / "found.toml"
    done = ended(
        sys.executable, "-m", "roaas", "certify", url, "--drive", drive, "--allow-motion", "--yes",
        "--effort", "quick", "--out", out, "--save-map", saved, "--force", *more,
    )  # fmt: skip
    assert "Traceback" not in done.stdout + done.stderr, done.stderr
    result = json.loads((out / "result.json").read_text(encoding="utf-8")) if (out / "result.json").exists() else {}
    if result:
        judged = {one["id"]: one["verdict"] for one in result["requirements"]}
        stays_within(out, saved.read_text(encoding="utf-8"), judged)
    return done, result, [one["answer"] for one in result.get("motion", ())]


def _answered(wanted, url, tmp_path, **more):
    """Run until the first answers are the wanted ones, and no other is "no" meanwhile; return command and result."""
    allowed = [{one, "not seen"} for one in wanted] + [{"yes", "not seen"}] * 4

    def run():
        done, result, given = _driven(url, tmp_path, **more)
        assert all(one in may for one, may in zip(given, allowed, strict=False)), done.stdout
        return done, result, given

    done, result, given = until(lambda *found: found[-1][: len(wanted)] == wanted, run)
    assert given[: len(wanted)] == wanted, done.stdout + done.stderr
    return done, result


def test_the_axes_of_a_rover_are_found_and_the_four_questions_answered(tmp_path):
    saved = tmp_path / "found.toml"
    with serving_rover(Rover(Body(rover.LIMITS, noise=0.001))) as url:
        done, result = _answered(["yes"] * 4, url, tmp_path)
    assert done.stdout.index("Does it move as told?") < done.stdout.index("description"), "the answers come first"
    text = saved.read_text(encoding="utf-8")
    tables = tomllib.loads(text)
    motion = motion_map_of(text.partition("[motion.state]")[1] + text.partition("[motion.state]")[2], "it")
    assert tables["api"]["openapi"] == url
    assert motion.velocity is not None
    ways = {name: motion.state.axes[one.of].at for name, one in motion.velocity.axes.items()}
    assert (motion.state.read, ways) == ("GET /pose", {"ahead": "/pose/0", "left": "/pose/1"})
    assert motion.velocity.axes["left"].limits == (-rover.FASTEST, rover.FASTEST), "as the description declares"
    assert motion.velocity.beyond_limits == "refused"
    assert 0.8 * rover.HOLD_S <= (motion.velocity.hold_s or 0) <= 2 * rover.HOLD_S
    assert {one["picture"] for one in result["motion"][:3]} - {""}
    page = render(tmp_path / "out")[0].read_text(encoding="utf-8")
    assert page.count('class="answer"') == 4


def test_a_rover_that_drives_on_when_its_client_vanishes_is_told(tmp_path):
    with serving_rover(Rover(WokenByReading(rover.LIMITS))) as url:
        done, _ = _answered(["yes", "yes", "no"], url, tmp_path)
    assert done.returncode == 1, "nobody declares that it drives on by design"
    assert "hold_s = 2  # the suite's" in done.stderr


def test_an_arm_that_is_sent_to_positions_is_found_by_the_names_of_its_joints(tmp_path):
    with serving_app(Arm().app()) as url:
        done, _ = _answered(["yes"], url, tmp_path, drive="POST /move")
    assert 'body = { id = "{goto:/id}" }' in done.stderr, "the stop takes what the move told"


class Homing(Winch):
    """A winch that is homed only a while after it was told so, and declares where it wants its lease."""

    HOMES_S = 0.6

    async def _description(self, _):
        key = {"name": "X-Lease", "in": "header", "required": True, "schema": {"type": "string"}}
        paths = copy.deepcopy(winch.DESCRIPTION["paths"])
        for path, item in paths.items():
            for operation in item.values():
                if path in {"/speed", "/enable", "/home", "/disable"}:
                    operation["parameters"] = [key]
        return JSONResponse({**winch.DESCRIPTION, "paths": paths})

    @property
    def mode(self):
        return "ready" if self.home_at and self.body.now() > self.home_at + self.HOMES_S else self.said

    @mode.setter
    def mode(self, word):
        self.said, self.home_at = ("homing", self.body.now()) if word == "ready" else (word, 0.0)


def test_a_winch_gets_a_lease_and_is_enabled_and_homed_before_it_moves_and_is_left_as_it_was(tmp_path):
    device, saved = Homing(), tmp_path / "found.toml"
    with serving_app(device.app()) as url:
        done, _ = _answered(["yes"], url, tmp_path, drive="PUT /speed")
    assert "first sends POST /lease, POST /enable, POST /home" in done.stderr
    motion = tomllib.loads(saved.read_text(encoding="utf-8"))["motion"]
    assert [step["send"] for step in motion["before"]] == ["POST /enable", "POST /home"]
    assert motion["before"][1]["shows"] == "ready", "the state that was seen to follow is awaited"
    assert (motion["lease"]["header"], motion["lease"]["release"]) == ("X-Lease", "DELETE /lease/{lease}")
    assert device.told[-2:] == ["disable", "release"]
    assert not device.is_leased


class Refusing(Rover):
    """A rover that takes velocities, and refuses any of these but 0."""

    def __init__(self, *refused):
        super().__init__()
        self.names = refused

    def answer(self, method, path, octets):
        if (method, path) == ("PUT", "/velocity") and any(json.loads(octets).get(name) for name in self.names):
            return 422, {"detail": f"{' and '.join(self.names)} cannot be actuated"}
        return super().answer(method, path, octets)


def test_what_a_rover_cannot_actuate_stays_0(tmp_path):
    with serving_rover(Refusing("left")) as url:
        done, _ = _answered(["yes"], url, tmp_path)
    assert "left stays 0: PUT /velocity with left 0.05 got status 422" in done.stderr
    assert 'body = { ahead = "{ahead}", left = 0 }' in done.stderr


def test_a_rover_that_refuses_every_velocity_is_told_with_its_words(tmp_path):
    with serving_rover(Refusing("ahead", "left")) as url:
        done, _, given = _driven(url, tmp_path)
    assert (done.returncode, given) == (4, [])
    assert "ahead and left cannot be actuated" in done.stderr


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--drive", "PUT /velocity", "--yes"], "--allow-motion"),
        (["--drive", "PUT /velocity", "--allow-motion"], "--yes"),
        (["--drive", "PUT /velocities", "--allow-motion", "--yes"], "did you mean 'PUT /velocity'"),
        (["--drive", "PUT /velocity", "--read", "GET /poses", "--allow-motion", "--yes"], "did you mean 'GET /pose'"),
        (["--drive", "DELETE /goal", "--allow-motion", "--yes"], "no numbers"),
        (["--drive", "PUT /velocity", "--allow-motion", "--yes", "--never", "PUT /velocity"], "never"),
        (["--drive", "PUT /velocity", "--allow-motion", "--plan"], "--plan"),
        (["--read", "GET /pose"], "--drive"),
    ],
)
def test_what_does_not_fit_is_told_and_nothing_moves(options, said, tmp_path):
    right = Rover(Body(rover.LIMITS))
    with serving_rover(right) as url:
        done = ended(sys.executable, "-m", "roaas", "certify", url, *options, "--out", tmp_path / "out", input="")
    assert (done.returncode, said in done.stderr) == (2, True), done.stderr
    assert right.body.speeds == dict.fromkeys(rover.LIMITS, 0.0)
    assert right.body.moves == 0


class Stuck(Body):
    """A rover that accepts every velocity and never moves."""

    def drive(self, speeds, hold_s, now):
        pass


def test_a_rover_that_never_moves_is_told_so_at_once(tmp_path):
    with serving_rover(Rover(Stuck(rover.LIMITS))) as url:
        done, _, given = _driven(url, tmp_path)
    assert (done.returncode, given) == (4, [])
    assert "was accepted (ahead at 0.05, left at 0.05), and no number" in done.stderr
