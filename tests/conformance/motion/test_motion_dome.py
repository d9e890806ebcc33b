"""A camera that is moved by ONVIF, over HTTP: a right one is not blamed, and a wrong map is refused."""

import sys
import tomllib

import dome
import pytest
from body import Body
from dome import Dome
from driven_device import SimulatedClock
from judged_devices import judged_by_map, passed_but
from processes import ended
from simulated import Api, map_of
from soap_devices import PASSWORD, USER, serving

from conformance.api.call_rules import CallRules
from conformance.documents.openapi import read_operations
from conformance.documents.wsdl_pack import with_messages
from conformance.engine.finding import plan_of
from conformance.engine.found_positions import PositionFinder
from conformance.engine.found_velocities import VelocityFinder
from conformance.scenarios.motion.binding import SoapBinding
from conformance.statement.statement import motion_map_of

_NOT_DECLARED = {"agrees", "action-runs", "action-succeeds", "action-canceled", "switches"}


def _judged(body, tmp_path, motion=dome.MAP):
    secret = tmp_path / "user"
    secret.write_text(f"{USER}:{PASSWORD}", encoding="utf-8")
    api = f'wsdl = "{{url}}/onvif.wsdl"\n[endpoints]\nusername_token_file = "{secret}"\n'
    return judged_by_map(serving(Dome(body)), motion, tmp_path, api)


def test_a_right_camera_is_not_blamed(tmp_path):
    passed_but(_NOT_DECLARED, lambda: _judged(Body(dome.LIMITS, noise=0.003), tmp_path))


def test_a_right_camera_that_takes_ways_is_not_blamed(tmp_path):
    missing = _NOT_DECLARED | {"new-target", "last-of-many", "repeated"}
    passed_but(missing, lambda: _judged(Body(dome.LIMITS), tmp_path, dome.RELATIVE))


def test_an_element_that_the_message_has_not_is_named(tmp_path):
    done, _ = _judged(None, tmp_path, dome.MAP.replace('ProfileToken = "main", Position', 'Profile = "main", Position'))
    assert done.returncode == 2
    assert "POST /PTZPort/AbsoluteMove: AbsoluteMove has no Profile, but Position, ProfileToken, Speed" in done.stderr


_VELOCITY = {"ProfileToken": "main", "Velocity": {"PanTilt": {"@x": "{PanTilt_x}", "@y": "{PanTilt_y}"}}}
_POSITION = {"ProfileToken": "main", "Position": {"PanTilt": {"@x": "{PanTilt_x}", "@y": "{PanTilt_y}"}}}


@pytest.mark.parametrize(
    ("drive", "finder", "body"),
    [("ContinuousMove", VelocityFinder, _VELOCITY), ("AbsoluteMove", PositionFinder, _POSITION)],
)
def test_the_axes_of_a_camera_are_found_by_driving_it(drive, finder, body):
    clock = SimulatedClock()
    api, messages = Api(Dome(Body(dome.LIMITS, clock.now, clock.sleep)), clock, lambda: 0.002), dome.messages_of()
    operations = read_operations(with_messages(messages.found, messages.values), closed=True)
    plan = plan_of(operations, f"POST /PTZPort/{drive}", None, CallRules())
    motion = map_of("\n".join(finder(api, SoapBinding(api, messages), plan, clock).find().lines))
    assert motion.state.read == "POST /PTZPort/GetStatus"
    assert {axis.at for axis in motion.state.axes.values()} == {f"/PTZStatus/Position/PanTilt/@{one}" for one in "xy"}
    # A zoom, which not every camera has, is left out.
    assert (motion.velocity or motion.goto).body == body
    if motion.velocity is not None:
        assert motion.velocity.hold_s == pytest.approx(dome.HOLD_S, abs=0.1)
        assert motion.velocity.axes["PanTilt_x"].scale == pytest.approx(dome.FULL_SPEED, rel=0.15)


def test_init_proposes_the_map_of_a_camera(tmp_path):
    statement = tmp_path / "camera.toml"
    with serving(Dome(Body(dome.LIMITS))) as url:
        done = ended(sys.executable, "-m", "roaas", "certify", "--init", str(statement), f"{url}/onvif.wsdl")
    assert done.returncode == 0, done.stderr
    text = statement.read_text(encoding="utf-8")
    assert tomllib.loads(text)["api"] == {"wsdl": f"{url}/onvif.wsdl"}
    lines = [line.removeprefix("# ") for line in text.splitlines()]
    motion = motion_map_of("\n".join(lines[lines.index("[motion.state]") : lines.index("[values]")]), "it")
    assert [motion.state.read, motion.goto.send, motion.velocity.send, motion.stop.send] == [
        f"POST /PTZPort/{name}" for name in ("GetStatus", "AbsoluteMove", "ContinuousMove", "Stop")
    ]


def test_a_camera_that_refuses_to_be_read_is_driven_no_farther(tmp_path):
    with serving(Dome(Body(dome.LIMITS))) as url:
        drive = ["--wsdl", f"{url}/onvif.wsdl", "--drive", "POST /PTZPort/ContinuousMove", "--allow-motion", "--yes"]
        done = ended(sys.executable, "-m", "roaas", "certify", *drive, "--out", str(tmp_path / "out"))
    assert "PanTilt_x        no limits declared; tried at 0.1" in done.stderr
    assert "Read meanwhile: POST /PTZPort/GetStatus." in done.stderr
    # Without a token, it answers each message with a fault.
    assert done.returncode == 4, done.stderr
    assert "POST /PTZPort/GetStatus got status 400" in done.stderr
