"""What is written: right devices of many styles are not blamed, and each fault is found by its requirement."""

from concurrent.futures import ThreadPoolExecutor

import pytest
from written_device import Written, blamed

_AT_ONCE = 8
_STYLES = {"plain": (), "marked": ("marked",)}
_READ, _KEPT, _DEFAULTS = (f"description/{name}" for name in ("written-is-read", "refused-keeps", "defaults"))
_PATCH, _READ_ONLY = "description/patch", "description/read-only"
_GONE, _OWN = "description/deleted-is-gone", "description/own-identifier"
_FAULTS = {
    "built_at by PUT": _READ_ONLY,
    "built_at by PATCH": _READ_ONLY,
    "maker by PUT": _READ_ONLY,
    "default of loud by POST": _DEFAULTS,
    "default of loud by PUT": _DEFAULTS,
    "null keeps": _PATCH,
    "null keeps loud": _PATCH,
    "objects replaced": _PATCH,
    "others reset": _PATCH,
    "steps added": _PATCH,
    "speed cut off": _READ,
    "steps sorted": _READ,
    "note escaped": _READ,
    "refused in part": _KEPT,
    "refused and the first": _KEPT,
    "refused and speed": _KEPT,
    "test ignored": _KEPT,
    "last test ignored": _KEPT,
    "applied in part": _KEPT,
    "failing ignored": _KEPT,
    "patch without effect": _PATCH,
    "added first": _PATCH,
    "code twice by PUT": _OWN,
    "code twice by PATCH": _OWN,
    "lists the deleted": _GONE,
    "lists the deleted by kind": _GONE,
}


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    """Return by what each device is blamed, by style and fault."""
    devices = [(style, "") for style in _STYLES] + [("marked", fault) for fault in _FAULTS]
    folders = [tmp_path_factory.mktemp("written") for _ in devices]

    def lived(device, folder):
        style, fault = device
        return blamed(Written(_STYLES[style], fault), folder)

    with ThreadPoolExecutor(_AT_ONCE) as pool:
        return dict(zip(devices, pool.map(lived, devices, folders), strict=True))


@pytest.mark.parametrize("style", _STYLES)
def test_a_right_device_is_not_blamed(style, found):
    assert found[style, ""] == {}


@pytest.mark.parametrize("fault", _FAULTS)
def test_a_fault_is_found(fault, found):
    assert _FAULTS[fault] in found["marked", fault]
