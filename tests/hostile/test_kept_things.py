"""Devices that keep things: right ones of many styles are not blamed, and each fault is found by its requirement."""

from concurrent.futures import ThreadPoolExecutor

import pytest
from things_device import Things, blamed

# Most of a life is waiting.
_AT_ONCE = 12
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


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    """Return by what each device is blamed, by fault and style."""
    devices = [("", style) for style in _STYLES.values()] + [(fault, style) for fault, style, _ in _FAULTS]
    folders = [tmp_path_factory.mktemp("things") for _ in devices]

    def lived(device, folder):
        fault, style = device
        return blamed(*Things(style, fault).description(), folder)

    with ThreadPoolExecutor(_AT_ONCE) as pool:
        return dict(zip(devices, pool.map(lived, devices, folders), strict=True))


@pytest.mark.parametrize("style", _STYLES)
def test_a_right_device_is_not_blamed(style, found):
    assert found["", _STYLES[style]] == {}


@pytest.mark.parametrize(("fault", "style", "requirement"), _FAULTS)
def test_a_fault_is_found(fault, style, requirement, found):
    assert requirement in found[fault, style]
