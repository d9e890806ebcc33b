"""What a map can say of a device's calls: ids, forms, errors inside a 200, leases, sequences, directions."""

import sys

import pytest
import turntable
import winch
from judged_devices import blamed_for, judged_by_map, passed_but
from processes import ended
from serving_apps import serving_app
from turntable import Turntable
from winch import Winch

from conformance.scenarios.motion.templates import fill
from conformance.statement.motion_calls import covers, named_by, written_out

_LABELS = ["PUT /robots/{id}/velocity", "GET /robots/{id}", "GET /robots/status", "PUT /goal/{x}/{y}"]
_UNDECLARED = {"unauthorised-still", "action-runs", "action-succeeds", "action-canceled"}


@pytest.mark.parametrize(
    ("call", "named"),
    [
        ("PUT /robots/7/velocity", {"PUT /robots/{id}/velocity"}),
        ("PUT /robots/{which}/velocity", {"PUT /robots/{id}/velocity"}),
        ("GET /robots/status", {"GET /robots/status"}),
        ("GET /robots/7?verbose=1", {"GET /robots/{id}"}),
        ("PUT /goal/{a}/0", {"PUT /goal/{x}/{y}"}),
        ("PUT /robots/7", set()),
        ("PUT /robots/7/velocity/x", set()),
    ],
)
def test_a_call_names_an_operation_with_values_in_its_path(call, named):
    assert named_by([call], _LABELS) == named


def test_a_call_with_a_value_permits_no_other_value():
    assert covers("PUT /robots/7/velocity", "PUT /robots/7/velocity")
    assert not covers("PUT /robots/7/velocity", "PUT /robots/8/velocity")
    assert covers("PUT /goal/{x}/{y}", "PUT /goal/0.1/-2")


def test_values_and_directions_are_written_out():
    given = {
        "state": {"read": "GET /robots/{id}/{x}", "axes": {"x": {}}},
        "velocity": {
            "send": "PUT /robots/{id}/v",
            "body": {"v": "{x}"},
            "direction": {"at": "/way/d", "positive": 0, "negative": 1},
        },
    }
    made = written_out(given, {"id": ("a b",), "x": (1,)})
    assert made["state"]["read"] == "GET /robots/a%20b/{x}", "the name of an axis stays"
    assert fill(made["velocity"]["body"], {"x": -0.5}) == {"v": 0.5, "way": {"d": 1}}
    assert fill(made["velocity"]["body"], {"x": 0.0}) == {"v": 0.0, "way": {"d": 0}}
    assert fill(made["velocity"]["body"], {"x": "far"}) == {"v": "far", "way": {"d": 0}}


def test_a_turntable_with_ids_and_forms_and_errors_inside_a_200_is_not_blamed(tmp_path):
    device = Turntable()
    no_velocity = {"velocity", "velocity-stop", "hold", "watchdog", "speed", "agrees", "stamp", "switches"}
    passed_but(_UNDECLARED | no_velocity, lambda: judged_by_map(serving_app(device.app()), turntable.MAP, tmp_path))
    assert device.media_types == {"application/x-www-form-urlencoded"}, "never JSON where it is not declared"


class MovesAndFails(Turntable):
    """One that moves for what it says to have failed."""

    def slew(self, media_type, octets):
        answer = super().slew(media_type, octets)
        if b"1025" in answer.body:
            self.body.go({"azimuth": 0.3, "altitude": 0.1}, 0.1)
        return answer


def test_a_turntable_that_fails_with_a_200_and_moves_is_blamed(tmp_path):
    only = ["refused-still"]
    blamed_for(only, lambda: judged_by_map(serving_app(MovesAndFails().app()), turntable.MAP, tmp_path, only=only))


def test_a_winch_with_a_lease_is_made_ready_and_given_back(tmp_path):
    device = Winch()
    targets = {"reaches", "stays", "way", "speed", "stop", "stop-lasts", "new-target", "last-of-many", "repeated"}
    undeclared = (_UNDECLARED - {"unauthorised-still"}) | targets | {"fresh", "stamp", "agrees", "switches"}
    passed_but(undeclared, lambda: judged_by_map(serving_app(device.app()), winch.MAP, tmp_path))
    assert device.told[:3] == ["acquire", "enable", "home"]
    assert device.told[-2:] == ["disable", "release"]
    assert "renew" in device.told
    assert not device.is_leased


@pytest.mark.parametrize(
    ("right", "wrong", "told"),
    [
        ('Azimuth = "{azimuth}"', 'Azimuth = "{azimuth}", ClientID = "me"', "the description forbids"),
        ("/telescope/3/slew", "/telescope/three/slew", "the description forbids"),
        ("/telescope/3/slew", "/telescopes/3/slew", "did you mean"),
    ],
)
def test_what_the_description_forbids_is_the_fault_of_the_map(right, wrong, told, tmp_path):
    device, statement = Turntable(), tmp_path / "device.toml"
    text = turntable.MAP.replace(", ClientID = 1", "").replace(right, wrong)
    with serving_app(device.app()) as url:
        statement.write_text(f'[api]\nopenapi = "{url}/openapi.json"\n{text}', encoding="utf-8")
        more = ["--allow-motion", "--out", str(tmp_path / "out")]
        done = ended(sys.executable, "-m", "roaas", "certify", str(statement), *more)
    assert (done.returncode, device.body.moves) == (2, 0), done.stdout + done.stderr
    assert told in done.stderr
    if told.startswith("the"):
        line = next(n for n, one in enumerate(statement.read_text().splitlines(), 1) if one == "[motion.goto]")
        assert f"line {line}" in done.stderr
