"""The grid of states on a certificate: from traces and findings; and no grid from what is no trace."""

import gzip
import json

import pytest

from reports.certificate.states_shown import grid

_WALK = {
    "states": ["ready", "run", "running"],
    "operations": {"POST /a": ["ready"], "POST /b": ["running"]},
    "steps": [
        {"operation": "POST /a", "state": "ready", "taken": True},
        {"operation": "POST /a", "state": "run", "taken": True},
        {"operation": "POST /a", "state": "running", "taken": False},
        {"operation": "POST /b", "state": "ready", "taken": False},
    ],
}
_FAILED = {
    "requirements": [{"class": "states", "failures": [{"message": "Expected 4xx for POST /a in run. Got status 200."}]}]
}


def _written(folder, traces):
    (folder / "traces.json.gz").write_bytes(gzip.compress(json.dumps(traces).encode()))
    return grid(folder, _FAILED)


def test_each_operation_has_each_state(tmp_path):
    shown = _written(tmp_path, {"walked": _WALK})
    assert {name: [cell.sign for cell in cells] for name, cells in shown.rows.items()} == {
        "POST /a": ["✓ taken", "✗ taken", "✓ refused"],
        "POST /b": ["✓ refused", "·", "·"],
    }
    assert shown.wrong == 1


@pytest.mark.parametrize(
    "walk", [[], {}, {**_WALK, "steps": [3]}, {**_WALK, "operations": 7}, {**_WALK, "states": None}]
)
def test_what_is_no_walk_gives_no_grid(tmp_path, walk):
    assert _written(tmp_path, {"walked": walk}) is None
