"""The pictures of a certificate show what was commanded, however it is measured."""

import gzip
import json

from reports.certificate.moves_drawn import pictures

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
