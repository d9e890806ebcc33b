"""Devices that are right and unusual are not blamed for anything; faults of theirs are found."""

import pytest
import unusual_devices as devices
from small_device import certified

# Of each device: its arguments, and the faults of each of its runs with the requirements that they break.
_DEVICES = [
    (
        devices.unions,
        (),
        [{"500 for a name": "robustness/no-server-error", "a text for a number": "description/body-schema"}],
    ),
    (
        devices.swagger,
        ("--call", "POST /say"),
        [
            {"another basePath": "description/operations"},
            {"another separator": "description/examples", "a form without its field": "description/required"},
        ],
    ),
    (
        devices.streams,
        (),
        [{"frames of another type": "description/media-type", "a member left out": "description/body-schema"}],
    ),
    (
        devices.behind_a_proxy,
        (),
        [{"no servers": "description/operations"}, {"a status that is not declared": "description/status-declared"}],
    ),
]


def _certified(device, arguments, tmp_path, faults=(), seed=1):
    if device is devices.behind_a_proxy and not devices.HAS_NGINX:
        pytest.fail("nginx is needed: apt-get install nginx-light")
    with device(faults, tmp_path) as url:
        return certified(url, tmp_path / "out", *arguments, seed=seed)


@pytest.mark.parametrize(("device", "arguments"), [one[:2] for one in _DEVICES])
def test_a_right_device_is_not_blamed(device, arguments, tmp_path):
    done = _certified(device, arguments, tmp_path)
    assert done.blamed == {}, done.text
    assert done.exit_code == 0, done.text
    assert done.requirement("description/file-valid")["verdict"] == "pass"


@pytest.mark.side_by_side
@pytest.mark.parametrize(
    ("device", "arguments", "faults"),
    [(device, arguments, faults) for device, arguments, runs in _DEVICES for faults in runs],
)
def test_faults_are_found(device, arguments, faults, tmp_path):
    selected = [f"--select={id_}" for id_ in sorted({*faults.values()})]
    done = _certified(device, (*arguments, *selected), tmp_path, faults)
    assert done.blamed.keys() == set(faults.values()), done.text


@pytest.mark.parametrize("seed", [1, 2])
def test_a_crash_now_and_then_is_one_finding(seed, tmp_path):
    done = _certified(devices.unions, ("--class", "robustness"), tmp_path, {"500 now and then"}, seed)
    assert done.blamed == {"robustness/no-server-error": "fail"}, done.text
