"""Devices with settings: right ones of many styles are not blamed and left as they were; lost values are found."""

from concurrent.futures import ThreadPoolExecutor

import pytest
from settings_device import FIRST, Settings, lived

_STYLES = {
    "plain": (),
    "by PATCH": ("patch",),
    "eventual": ("later",),
    "wrapped": ("wrapped",),
    "sensors": ("sensors",),
    "locking": ("locking",),
    "strict": ("strict",),
    "acting": ("acting",),
}
_FAULTS = [
    ("zero", ()),
    ("zero", ("patch",)),
    ("false", ("wrapped",)),
    ("empty list", ()),
    ("maximum", ("locking",)),
    ("one of an enumeration", ()),
    ("every write", ()),
    ("another connection reads the old", ()),
    ("another connection reads the old", ("sensors",)),
]


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    """Return each device with what was found, by fault and style."""
    keys = [("", style) for style in _STYLES.values()] + _FAULTS
    devices = [Settings(style, fault) for fault, style in keys]
    folders = [tmp_path_factory.mktemp("settings") for _ in devices]
    with ThreadPoolExecutor(len(devices)) as pool:
        return dict(zip(keys, zip(devices, pool.map(lived, devices, folders), strict=True), strict=True))


@pytest.mark.parametrize("style", _STYLES)
def test_a_right_device_is_not_blamed(style, found):
    device, blamed = found["", _STYLES[style]]
    assert blamed == []
    # The last request has restored what was there; how the device is reached was not touched.
    assert {**FIRST, **device.written[-1]} == FIRST
    assert {one.get("ssid", "home") for one in device.written} == {"home"}


@pytest.mark.parametrize(("fault", "style"), _FAULTS)
def test_a_lost_value_is_found(fault, style, found):
    assert found[fault, style][1] != []
