"""A camera that is moved by ONVIF, over HTTP: a right one is not blamed, and a wrong map is refused."""

import dome
from body import Body
from dome import Dome
from judged_devices import judged_by_map, passed_but
from soap_devices import PASSWORD, USER, serving

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
