"""Devices that are right and unusual are not blamed for anything; a fault of theirs is found."""

import json
import sys

import pytest
import unusual_devices as devices
from processes import ended

# Stands for the name of a file in the arguments of a device.
_FILE = "FILE"
_DEVICES = [
    (
        devices.unions,
        (),
        {"500 for a name": "robustness/no-server-error", "a text for a number": "description/body-schema"},
    ),
    (
        devices.openapi_3_0,
        ("--call", "POST /tools"),
        {"a bound that is taken": "description/invalid-refused", "null that is not allowed": "description/body-schema"},
    ),
    (
        devices.swagger,
        ("--call", "POST /say"),
        {
            "another basePath": "description/operations",
            "another separator": "description/examples",
            "a form without its field": "description/required",
        },
    ),
    (devices.guarded, (), {}),
    (devices.guarded, ("--token-file", _FILE), {"a number for a boolean": "description/body-schema"}),
    (
        devices.streams,
        (),
        {"frames of another type": "description/media-type", "a member left out": "description/body-schema"},
    ),
    (
        devices.behind_a_proxy,
        (),
        {"no servers": "description/operations", "a status that is not declared": "description/status-declared"},
    ),
]


def _certified(device, arguments, tmp_path, *, fault="", effort="quick", seed=1):
    """Return the result of a run, and the requirements that failed or warned."""
    if device is devices.behind_a_proxy and not devices.HAS_NGINX:
        pytest.fail("nginx is needed: apt-get install nginx-light")
    token, out = tmp_path / "token", tmp_path / "out"
    token.write_text(devices.TOKEN)
    more = [str(token) if one == _FILE else one for one in arguments]
    with device(fault, tmp_path) as url:
        done = ended(
            sys.executable,
            "-m",
            "roaas",
            "certify",
            url,
            "--effort",
            effort,
            "--seed",
            f"{seed}",
            "--out",
            str(out),
            *more,
        )
    assert "Traceback" not in done.stdout + done.stderr
    result = json.loads((out / "result.json").read_text(encoding="utf-8"))
    blamed = {
        one["id"]: one["verdict"] for one in result["requirements"] if one["verdict"] in {"fail", "warn", "error"}
    }
    return done, result, blamed


@pytest.mark.parametrize(("device", "arguments"), [one[:2] for one in _DEVICES])
def test_a_right_device_is_not_blamed(device, arguments, tmp_path):
    done, result, blamed = _certified(device, arguments, tmp_path)
    assert blamed == {}, done.stdout
    # Without its token nothing of the guarded device can be judged.
    decided = device is not devices.guarded or bool(arguments)
    assert done.returncode == (0 if decided else 4), done.stdout
    passed = [one["id"] for one in result["requirements"] if one["verdict"] == "pass"]
    assert "description/file-valid" in passed


@pytest.mark.parametrize(
    ("device", "arguments", "fault", "requirement"),
    [(device, arguments, *one) for device, arguments, faults in _DEVICES for one in faults.items()],
)
def test_a_fault_is_found(device, arguments, fault, requirement, tmp_path):
    done, _, blamed = _certified(device, arguments, tmp_path, fault=fault)
    assert requirement in blamed, done.stdout


@pytest.mark.parametrize("seed", range(1, 4))
def test_a_crash_now_and_then_is_one_finding(seed, tmp_path):
    done, _, blamed = _certified(devices.unions, (), tmp_path, fault="500 now and then", seed=seed)
    assert blamed == {"robustness/no-server-error": "fail"}, done.stdout
