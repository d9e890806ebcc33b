"""Devices that keep things, settings and values: right ones of many styles are not blamed, each fault is found."""

import pytest
import written_device
from settings_device import FIRST, Settings, lived
from things_device import Things, blamed
from written_device import Written

pytestmark = pytest.mark.side_by_side(8)
_STYLES = {
    "plain": (),
    "eventual": ("later",),
    "merging": ("merging", "normal"),
    "sensors": ("sensors", "crowd"),
    "jobs": ("jobs",),
    "timers": ("timers",),
    "ring": ("ring",),
    "tags": ("tags",),
    "locking": ("tags", "locking"),
    "named": ("named",),
    "named later": ("named", "later", "sensors"),
    "primary": ("primary",),
    "actions": ("actions",),
    "actions later": ("actions", "later"),
    "passing": ("actions", "passing"),
    "pages by link": ("paged", "link"),
    "pages by link and cursor": ("paged", "link", "cursor"),
    "pages by cursor": ("paged", "cursor"),
    "pages by offset": ("paged", "offset"),
    "pages by number": ("paged", "page"),
    "pages with a total": ("paged", "total", "offset"),
    "filtered": ("state",),
    "lists the newest": ("newest",),
    "lists the oldest": ("oldest",),
}
_THERE, _KEPT, _GONE = "description/created-is-there", "description/written-is-read", "description/deleted-is-gone"
_REFUSED = "description/refused-keeps"
_OWN = "description/own-identifier"
_CRASH = "robustness/no-server-error"
_FAULTS = [
    ("GET mixes up after a DELETE", (), _OWN),
    ("GET after a refusal is the last read", ("named",), _OWN),
    ("DELETE takes the neighbour", (), _THERE),
    ("unknown DELETE deletes the last", (), _REFUSED),
    ("an identifier twice", (), _THERE),
    ("creation overwrites", (), _KEPT),
    ("creation restores", (), _KEPT),
    ("PUT writes all", (), _KEPT),
    ("PATCH the last one too", ("sensors",), _KEPT),
    ("DELETE revives", (), _GONE),
    ("list keeps the deleted", ("paged", "cursor"), _GONE),
    ("list without the third", ("paged", "offset"), _THERE),
    ("list without the third", ("paged", "cursor"), _THERE),
    ("list stale after a refusal", (), _THERE),
    ("lost after a refusal", (), _THERE),
    ("invalid applies the valid", (), _REFUSED),
    ("invalid clears", ("later",), _REFUSED),
    ("invalid creates", (), _REFUSED),
    ("415 applies", (), _REFUSED),
    ("second DELETE fails", (), _CRASH),
    ("created again with 200", ("named",), _THERE),
    ("cancel without effect", ("actions",), _KEPT),
    ("cancel resets the others", ("actions",), _KEPT),
]


@pytest.mark.parametrize("style", _STYLES)
def test_a_right_device_is_not_blamed(style, tmp_path):
    assert blamed(*Things(_STYLES[style], "").description(), tmp_path) == {}


@pytest.mark.parametrize(("fault", "style", "requirement"), _FAULTS)
def test_a_fault_is_found(fault, style, requirement, tmp_path):
    assert requirement in blamed(*Things(style, fault).description(), tmp_path)


_SETTINGS = [(), ("patch",), ("later",), ("wrapped",), ("sensors",), ("locking",), ("strict",), ("acting",)]
_LOST = [
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


@pytest.mark.parametrize("style", _SETTINGS)
def test_right_settings_are_not_blamed_and_left_as_they_were(style, tmp_path):
    device = Settings(style, "")
    assert lived(device, tmp_path) == []
    # The last request has restored what was there; how the device is reached was not touched.
    assert {**FIRST, **device.written[-1]} == FIRST
    assert {one.get("ssid", "home") for one in device.written} == {"home"}


@pytest.mark.parametrize(("fault", "style"), _LOST)
def test_a_lost_value_is_found(fault, style, tmp_path):
    assert lived(Settings(style, fault), tmp_path) != []


_BROKEN = {
    "read-only": ("built_at by PUT", "built_at by PATCH"),
    "defaults": ("default of loud by POST", "default of loud by PUT"),
    "patch": ("null keeps", "objects replaced", "steps added", "patch without effect"),
    "written-is-read": ("speed cut off", "steps sorted", "note escaped"),
    "refused-keeps": ("refused in part", "last test ignored", "applied in part"),
    "own-identifier": ("code twice by PATCH",),
    "deleted-is-gone": ("lists the deleted by kind",),
}
_BY_FAULT = {fault: f"description/{name}" for name, faults in _BROKEN.items() for fault in faults}


@pytest.mark.parametrize("style", [(), ("marked",)])
def test_right_values_are_not_blamed(style, tmp_path):
    assert written_device.blamed(Written(style, ""), tmp_path) == {}


@pytest.mark.parametrize("fault", _BY_FAULT)
def test_a_fault_of_written_values_is_found(fault, tmp_path):
    assert _BY_FAULT[fault] in written_device.blamed(Written(("marked",), fault), tmp_path)
