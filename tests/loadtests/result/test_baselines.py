"""Stored results: what is kept, and what a run is compared with."""

import json
from pathlib import Path

import pytest
from click.testing import CliRunner

import loadtests.cli
import roaas
from conformance.commandline.exit_codes import ExitCode
from conformance.commandline.result_command import CommandResult

EXAMPLE = Path(__file__).parents[2] / "reports" / "data" / "latency-example.json"


@pytest.fixture
def load(tmp_path, monkeypatch):
    """Run `roaas load` with a measurement that has been made already."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(roaas.FrontDoor, "render", staticmethod(lambda *_: []))  # its pages have tests of their own

    def run(*options, **changed):
        result = json.loads(EXAMPLE.read_text()) | changed
        (tmp_path / "latency.json").write_text(json.dumps(result))
        measured = CommandResult(ExitCode.PASSED, tmp_path / "latency.json")
        monkeypatch.setattr(loadtests.cli, "_run_load", lambda *_: measured)
        return CliRunner().invoke(roaas.main, ["load", "--rest", "http://robot:1", *options])

    return run


def slowed(factor):
    series = json.loads(EXAMPLE.read_text())["series"]
    for one in series:
        for times in (one["service_ms"], one["response_ms"]):
            times.update({name: value * factor for name, value in times.items() if value is not None})
        for bounds in (one["ci95_ms"], one.get("response_ci95_ms", {})):
            bounds.update({name: [b * factor for b in value] for name, value in bounds.items() if value is not None})
    return series


def test_results_are_stored_and_compared(load):
    first = load("--save", "main", started="2026-11-01T10:00:00.000Z")
    assert first.exit_code == ExitCode.PASSED, first.output
    same = load("--baseline", "main", "--save", "main", started="2026-11-02T10:00:00.000Z")
    assert same.exit_code == ExitCode.PASSED, same.output
    slower = load("--baseline", "main", started="2026-11-03T10:00:00.000Z", series=slowed(2))
    assert (slower.exit_code, "It got slower" in slower.output) == (ExitCode.FAILED, True), slower.output
    folder = Path(".roaas/baselines/main")
    assert sorted(path.name for path in folder.glob("*.json")) == [
        "20261101T100000000Z.json",
        "20261102T100000000Z.json",
    ]


def test_what_is_not_valid_is_not_stored_and_other_loads_are_not_compared(load):
    assert "not stored" in load("--save", "main", valid=False, invalid_because=["the machine was busy"]).output
    assert not Path(".roaas").exists()
    plan = json.loads(EXAMPLE.read_text())["plan"]
    load("--save", "main")
    other = load("--baseline", "main", plan=plan | {"rate": 2 * plan["rate"]})
    assert (other.exit_code, "not compared" in other.output) == (ExitCode.INCONCLUSIVE, True), other.output


@pytest.mark.parametrize(
    ("option", "message"),
    [(["--baseline", "gone"], "there is no baseline"), (["--save", "../up"], "a name consists of letters")],
)
def test_baselines_that_cannot_be(load, option, message):
    refused = load(*option)
    assert (refused.exit_code, message in refused.output) == (ExitCode.USAGE, True), refused.output
