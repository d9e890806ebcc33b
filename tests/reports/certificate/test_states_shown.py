"""What a certificate shows of traces: the grid of states, and pictures of what was commanded, however measured."""

import gzip
import json

import pytest

from reports.certificate.moves_drawn import grid, pictures

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


RESULT = {"requirements": [{"class": "motion", "failures": [{"message": "Expected (turn 0.2)."}]}]}


def reading(at, **told):
    return {"sent": at, "received": at + 0.01, **told}


def drive(what, wanted, readings):
    sent = {"sent": 0.0, "targets": wanted, "exchange": {"response": {"status": 200}}}
    return {"what": what, "wanted": wanted, "commands": [sent], "under_way": readings, "after": []}


def drawn(tmp_path, *drives):
    (tmp_path / "traces.json.gz").write_bytes(gzip.compress(json.dumps({"velocities": list(drives)}).encode()))
    return pictures(tmp_path, RESULT)


def test_a_velocity_that_an_axis_tells_is_drawn_by_that_axis(tmp_path):
    told = [reading(at / 10, values={"yaw": at / 50}, speeds={"ahead": 0.0}) for at in range(10)]
    (picture,) = drawn(tmp_path, drive("turn 0.2", {"ahead": 0.0, "turn": 0.2}, told))
    assert [line.name for line in picture.lines] == ["yaw", "ahead"]
    assert picture.lines[0].wanted == (), "a velocity is no position"
    assert picture.failed


def test_a_velocity_that_is_told_is_drawn_with_what_was_commanded(tmp_path):
    told = [reading(at / 10, values={"x": at / 50}, speeds={"ahead": 0.2}) for at in range(10)]
    (picture,) = drawn(tmp_path, drive("ahead 0.2", {"ahead": 0.2}, told))
    assert [line.name for line in picture.lines] == ["ahead"]
    assert len(picture.lines[0].wanted) == 1
