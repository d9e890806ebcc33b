"""What is judged of a device can be chosen; known failures are accepted; the terminal says all in one vocabulary."""

import datetime as dt
import json
import os
import pty
import re
import subprocess
import sys

import pytest
from small_device import answers, certified, constant, described, small_device

from reports.formats.catalogue import annotations, sarif

_SCHEMA = {"type": "object", "required": ["name"]}
# The 404 of an unknown parameter's value is declared nowhere, and the object lacks its member.
_PATHS = {"/state": {"get": {"responses": {"200": answers(_SCHEMA)}}}}
_BROKEN = "description/body-schema"


@pytest.fixture(scope="module")
def device():
    with small_device(described(_PATHS), {"/state": constant({})}) as url:
        yield f"{url}/openapi.json"


def verdicts(outcome):
    return {one["id"]: one["verdict"] for one in outcome.result["requirements"]}


def judged(outcome):
    return {id_ for id_, verdict in verdicts(outcome).items() if verdict in {"pass", "fail", "warn"}}


def test_a_selection_is_judged_and_certifies_nothing(device, tmp_path):
    chosen = certified(device, tmp_path, "--select", "http", "--exclude", "http/allow*")
    assert chosen.exit_code == 0, chosen.text
    assert chosen.result["verdict"] == "inconclusive"
    assert judged(chosen)
    assert all(id_.startswith("http/") and "allow" not in id_ for id_ in judged(chosen))
    assert judged(chosen) <= set(chosen.result["selected"])


def test_what_failed_is_judged_again_and_the_run_ends_at_the_first(device, tmp_path):
    missing = certified(device, tmp_path, "--last-failed")
    assert (missing.exit_code, "--last-failed: there is no" in missing.text) == (2, True)
    whole = certified(device, tmp_path, "--class", "description")
    assert whole.exit_code == 1
    failed = {id_ for id_, verdict in verdicts(whole).items() if verdict == "fail"}
    again = certified(device, tmp_path, "--last-failed", "-x")
    assert again.exit_code == 1
    assert set(again.result["selected"]) == failed
    first = certified(device, tmp_path / "first", "-x", "--class", "description")
    assert (first.exit_code, first.result["requests"] < whole.result["requests"]) == (1, True)
    assert re.search(r", \d+ inconclusive[,;]", first.text), first.text
    assert any("the run ended at its first finding (-x)" in one["reason"] for one in first.result["requirements"])


def test_a_pattern_that_fits_nothing_is_told_with_the_nearest(device, tmp_path):
    wrong = certified(device, tmp_path, "--select", "http/dat")
    assert (wrong.exit_code, "did you mean http/date?" in wrong.text) == (2, True), wrong.text


def test_a_baseline_is_written_asked_for_reasons_and_told_when_it_is_stale(device, tmp_path):
    known = tmp_path / "known.toml"
    first = certified(device, tmp_path, "--class", "description", "--write-baseline", known)
    text = known.read_text(encoding="utf-8")
    assert first.exit_code == 1
    assert f'requirement = "{_BROKEN}"' in text
    days = {dt.date.fromisoformat(day) for day in re.findall("expires = (.*)", text)}
    assert dt.datetime.now(dt.UTC).date() - max(days) <= dt.timedelta(days=1), "midnight may have passed"
    refused = certified(device, tmp_path, "--baseline", known)
    assert (refused.exit_code, "has no reason" in refused.text) == (2, True)
    assert certified(device, tmp_path, "--write-baseline", known).exit_code == 2, "it is not overwritten"
    day = "expires = 2999-12-31"
    text = re.sub("expires = .*", day, text.replace('reason = ""', 'reason = "ticket 7"'))
    known.write_text(text, encoding="utf-8")
    accepted = certified(device, tmp_path, "--class", "description", "--baseline", known)
    assert (accepted.exit_code, "until 2999-12-31: ticket 7" in accepted.text) == (0, True), accepted.text
    known.write_text(re.sub("operations = .*", 'operations = ["GET /other"]', text), encoding="utf-8")
    elsewhere = certified(device, tmp_path, "--class", "description", "--baseline", known)
    assert (elsewhere.exit_code, "its baseline entry does not name GET /" in elsewhere.text) == (1, True), (
        elsewhere.text
    )
    passing = next(id_ for id_, verdict in verdicts(first).items() if verdict == "pass")
    entry = f'[[expected]]\nrequirement = "{passing}"\nreason = "ticket 8"\n{day}\n'
    known.write_text(f"{text}\n{entry}", encoding="utf-8")
    stale = certified(device, tmp_path, "--class", "description", "--baseline", known)
    assert stale.exit_code == 1
    assert stale.result["stale"] == [passing]
    assert f"The baseline expects {passing} to fail, and it passes: delete the entry." in stale.text
    assert f"but the baseline expects {passing} to fail, so the exit code is 1" in stale.text


def on_terminal(command, columns):
    """Run a command with a terminal of some width as its stdout; return what it wrote there, and to stderr."""
    master, slave = pty.openpty()
    environment = os.environ | {"COLUMNS": str(columns), "TERM": "xterm"}
    process = subprocess.Popen(command, stdout=slave, stderr=subprocess.PIPE, text=True, env=environment)
    os.close(slave)
    parts = []
    while True:
        try:
            part = os.read(master, 65536)
        except OSError:  # the other end is closed
            break
        if not part:
            break
        parts.append(part)
    os.close(master)
    return b"".join(parts).decode(), process.communicate(timeout=60)[1]


def test_words_wrap_at_the_width_and_the_bar_counts_as_the_summary_does(device, tmp_path):
    command = [sys.executable, "-m", "roaas", "certify", device, "--effort", "quick", "--out", str(tmp_path)]
    text, progress = on_terminal(command, 72)
    plain = re.sub(r"\x1b\[[0-9;]*m", "", text)
    words = [line for line in plain.splitlines() if not line.startswith(("  replay: ", "result: ", "report: "))]
    assert max(map(len, words)) <= 72
    summary = re.search(r"(\d+ fail)(?:, (\d+ warn))?", plain)
    last = progress.strip().splitlines()[-1]
    assert all(part in last for part in summary.groups() if part), (summary.groups(), last)


def test_findings_point_at_the_line_of_the_description(device, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    description = tmp_path / "api.yaml"
    base = device.removesuffix("/openapi.json")
    description.write_text(
        f"openapi: 3.0.3\ninfo: {{title: device, version: '1'}}\nservers: [{{url: '{base}'}}]\npaths:\n  /state:\n"
        "    get:\n      responses:\n        '200':\n          description: ok\n          content:\n"
        "            application/json:\n              schema: {type: object, required: [name]}\n",
        encoding="utf-8",
    )
    certified("api.yaml", tmp_path / "out", "--select", _BROKEN)
    certified(device, tmp_path / "url", "--select", _BROKEN)
    for folder, file in (("out", "api.yaml"), ("url", "url/description/openapi.json")):
        result = json.loads((tmp_path / folder / "result.json").read_text(encoding="utf-8"))
        run = json.loads(sarif(result))["runs"][0]
        found = next(one for one in run["results"] if one["ruleId"] == _BROKEN)
        place = found["locations"][0]["physicalLocation"]
        assert place["artifactLocation"]["uri"] == file
        line = (tmp_path / file).read_text(encoding="utf-8").splitlines()[place["region"]["startLine"] - 1]
        assert re.match(r'\s*"?get"?:', line), line
        assert f"file={file},line={place['region']['startLine']}," in annotations(result)
