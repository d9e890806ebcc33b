"""FLEET.toml: what is read of it, and what is refused by name before any robot is asked."""

import pytest

from conformance.contract.pack import Contract
from conformance.fleet.fleet_file import FleetError, load_fleet, refuse_same_identity

REST = 'endpoints = {{ rest = "http://127.0.0.1:{}" }}'


@pytest.fixture
def fleet(tmp_path):
    (tmp_path / "courier.toml").write_text('[robot]\nname = "C"\n[endpoints]\nrest = "http://127.0.0.1:1"\n')
    (tmp_path / "nowhere.toml").write_text('[robot]\nname = "N"\n')

    def written(text):
        path = tmp_path / "fleet.toml"
        path.write_text(text)
        return path

    return written


def test_statements_and_addresses_make_a_fleet(fleet, tmp_path):
    path = fleet(
        "time_limit_s = 60\n"
        '[[robot]]\nstatement = "courier.toml"\nbaseline = "known.toml"\n'
        f'[[robot]]\nname = "kiosk"\nallow_motion = false\ntime_limit_s = 5\n{REST.format(2)}\n'
        '[[robot]]\nname = "lift"\nendpoints = { publishers_wsdl = "lift.wsdl", token_file = "token" }\n'
    )
    courier, kiosk, lift = load_fleet(path, Contract.load())
    assert (courier.name, courier.statement, courier.time_limit_s) == ("courier", tmp_path / "courier.toml", 60)
    assert (courier.baseline, courier.movable) == (tmp_path / "known.toml", True)
    assert (kiosk.statement, kiosk.movable, kiosk.time_limit_s) == (None, False, 5)
    assert [member.identity for member in (courier, kiosk)] == [("C", ""), ("kiosk", "")]
    assert lift.endpoints.token_file == str(tmp_path / "token"), "files are looked for beside the fleet's file"
    assert lift.endpoints.publishers_wsdl == str(tmp_path / "lift.wsdl")


def test_a_robot_that_describes_itself_is_a_member(fleet, tmp_path):
    (tmp_path / "lamp.toml").write_text(
        '[api]\nopenapi = "http://127.0.0.1:4/openapi.json"\n[calls]\nallow = ["lamp"]\n'
    )
    (lamp,) = load_fleet(fleet('[[robot]]\nstatement = "lamp.toml"'), Contract.load())
    assert (lamp.name, lamp.statement) == ("lamp", tmp_path / "lamp.toml")
    assert lamp.endpoints.rest == "http://127.0.0.1:4/openapi.json"


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("", "names no robot"),
        ("robots = []", "unknown key 'robots'"),
        ("[[robot]]", "number 1 must have one of the two"),
        (f'[[robot]]\nstatement = "courier.toml"\n{REST.format(2)}', "must have one of the two"),
        ('[[robot]]\nstatement = "missing.toml"', "missing.toml"),
        ('[[robot]]\nstatement = "nowhere.toml"', "nowhere) has no address"),
        (f"[[robot]]\n{REST.format(2)}", "name = ''"),
        (f'[[robot]]\nname = "../up"\n{REST.format(2)}', "name = '../up'"),
        (f'[[robot]]\nname = "a/b"\n{REST.format(2)}', "name = 'a/b'"),
        ('[[robot]]\nname = "x"\nendpoints = { http = "y" }', "unknown key 'http'"),
        ('[[robot]]\nstatement = "courier.toml"\ntime_limit_s = 0', "time_limit_s = 0 must be a positive number"),
        (f'[[robot]]\nname = "a"\n{REST.format(2)}\n[[robot]]\nname = "A"\n{REST.format(3)}', "both called 'a'"),
        (f'[[robot]]\nname = "a"\n{REST.format(2)}\n[[robot]]\nname = "b"\n{REST.format(2)}', "have the same address"),
    ],
)
def test_what_does_not_fit_is_refused_by_name(fleet, text, named):
    with pytest.raises(FleetError, match=r"fleet\.toml") as refused:
        load_fleet(fleet(text), Contract.load())
    assert named in str(refused.value)


def test_two_robots_of_one_name_are_judged_and_not_signed(fleet, tmp_path):
    (tmp_path / "twin.toml").write_text('[robot]\nname = "C"\n[endpoints]\nrest = "http://127.0.0.1:9"\n')
    path = fleet('[[robot]]\nstatement = "courier.toml"\n[[robot]]\nstatement = "twin.toml"')
    members = load_fleet(path, Contract.load())
    with pytest.raises(FleetError, match=r"number 1 and number 2 would be signed as the same robot, 'C'"):
        refuse_same_identity(path, members)
    refuse_same_identity(path, members[:1])
