"""What is written: right devices of many styles are not blamed, and each fault is found by its requirement."""

from concurrent.futures import ThreadPoolExecutor

import pytest
from written_device import Written, blamed

_AT_ONCE = 8
_STYLES = {"plain": (), "marked": ("marked",)}
_BROKEN = {
    "read-only": ("built_at by PUT", "built_at by PATCH"),
    "defaults": ("default of loud by POST", "default of loud by PUT"),
    "patch": ("null keeps", "objects replaced", "steps added", "patch without effect"),
    "written-is-read": ("speed cut off", "steps sorted", "note escaped"),
    "refused-keeps": ("refused in part", "last test ignored", "applied in part"),
    "own-identifier": ("code twice by PATCH",),
    "deleted-is-gone": ("lists the deleted by kind",),
}
_FAULTS = {fault: f"description/{name}" for name, faults in _BROKEN.items() for fault in faults}


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
