"""`roaas judge`: a stored run is judged as it was judged, also where it was cut short, and nothing is sent."""

import asyncio
import gzip
import itertools
import json
import shutil
import signal
import subprocess
import sys

import pytest
from aiohttp import web
from processes import Begun, ended
from small_device import certified, described, reading, small_device

from conformance.contract.pack import Contract
from conformance.engine.robot_under_test import RobotUnderTest
from conformance.engine.stored_result import judge_stored
from conformance.history.events import read_history
from conformance.history.writing import HISTORY_NAME, HistoryWriter
from conformance.statement.statement import empty_statement
from conformance.transport.exchange import Request, Response
from conformance.transport.passage import Heard, Passage
from conformance.verdict.run import Run

_STATE = {"type": "object", "required": ["on"], "properties": {"on": {"type": "boolean"}}}
# What the rules for every response say of this device.
_WRONG = {"http/date-format": "fail", "http/json-unique-names": "warn"}


@pytest.fixture(name="run", scope="module")
def _run(tmp_path_factory):
    """Certify a device that is wrong in one response of three; return the folder and what the run said."""
    out, turns = tmp_path_factory.mktemp("run") / "out", itertools.count(1)

    async def state(_):
        is_wrong = next(turns) % 3 == 0
        headers = {"Last-Modified": "yesterday"} if is_wrong else {}
        body = b'{"on": true, "on": false}' if is_wrong else b'{"on": true}'
        return web.Response(body=body, content_type="application/json", headers=headers)

    with small_device(described({"/state": reading(_STATE)}), {"/state": {"GET": state}}) as url:
        done = certified(url, out)
    return out, done


def _judged(out, *arguments):
    done = ended(sys.executable, "-m", "roaas", "judge", out, *arguments)
    assert "Traceback" not in done.stderr, done.stderr
    return done.returncode, done.stdout


def _line(text, requirement):
    return next(line for line in text.splitlines() if f": {requirement} (" in line)


def test_verdicts_cases_and_causes_are_those_of_the_run(run):
    out, done = run
    before = {one["id"]: one for one in done.result["requirements"]}
    code, text = _judged(out)
    assert code == 1, text
    for id_, value in _WRONG.items():
        one = before[id_]
        assert one["verdict"] == value, done.text
        assert _line(text, id_).startswith(f"{value}: {id_} ({one['cases']} case"), (text, one)
        for failure in one["failures"]:
            assert failure["message"].split(". Expected")[0] in text
    assert f"{done.result['requests']} requests in the history" in text.replace(",", "")


def test_a_class_that_the_run_was_not_for_is_not_judged(tmp_path):
    async def state(_):
        return web.json_response({"on": True}, headers={"Last-Modified": "yesterday"})

    with small_device(described({"/state": reading(_STATE)}), {"/state": {"GET": state}}) as url:
        done = certified(url, tmp_path / "out", "--class", "description")
    assert done.exit_code == 0, done.text
    code, text = _judged(tmp_path / "out")
    assert (code, "http/date-format" in text) == (0, False), text
    assert _judged(tmp_path / "out", "http/date-format")[0] == 1


@pytest.mark.parametrize("crashes", [{"HEAD"}, {"GET", "HEAD"}])
def test_a_crash_is_judged_once_whichever_check_met_it(tmp_path, crashes):
    """A survey's rule judges GET; no scenario records HEAD."""
    turns = itertools.count(1)

    async def state(request):
        is_well = request.method not in crashes or next(turns) % 2
        return web.json_response({"on": True}, status=200 if is_well else 500)

    with small_device(described({"/state": reading(_STATE)}), {"/state": {"GET": state}}) as url:
        done = certified(url, tmp_path / "out")
    one = next(one for one in done.result["requirements"] if one["id"] == "robustness/no-server-error")
    assert one["verdict"] == "fail", done.text
    _, text = _judged(tmp_path / "out", one["id"])
    assert text.startswith(f"fail: {one['id']} ({one['cases']} cases)"), (text, one)


def test_one_requirement_is_told_by_its_id(run):
    code, text = _judged(run[0], "http/field-once")
    assert (code, text.splitlines()[0].startswith("pass: http/field-once (")) == (0, True)
    code, text = _judged(run[0], "http/head-no-body")
    assert (code, text.startswith("nothing judged: ")) == (4, True)


def test_a_run_that_was_killed_is_judged_up_to_then(tmp_path):
    turns = itertools.count(1)

    async def state(_):
        if next(turns) == 60:
            process.send_signal(signal.SIGKILL)
        await asyncio.sleep(0.02)  # so that a good part of the history is written
        return web.json_response({"on": True}, headers={"Last-Modified": "yesterday"})

    with small_device(described({"/state": reading(_STATE)}), {"/state": {"GET": state}}) as url:
        words = ("certify", f"{url}/openapi.json", "--out", tmp_path / "out")
        with Begun(*words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
            assert process.wait(120) == -signal.SIGKILL
    code, text = _judged(tmp_path / "out")
    assert (code, "fail: http/date-format" in text, "which was cut short" in text) == (1, True, True), text


def _stored(out, passages, *, started, withdrawn=()):
    writer = HistoryWriter(out, "1", started)
    numbers = [writer.record(one) for one in passages]
    for number in withdrawn:
        writer.withdraw(numbers[number])
    writer.close()


def test_what_no_check_listened_to_is_not_judged(run, tmp_path):
    out, done = run
    (tmp_path / "description").symlink_to(out / "description")
    (tmp_path / "result.json").write_text(json.dumps(done.result))
    request = Request("GET", f"{done.result['target']['rest']}/state", (("Host", "a"), ("Accept", "*/*")))
    wrong, busy = (
        Response(status, (("Last-Modified", "yesterday"),), b"", 1.0, received_s=1.0) for status in (200, 503)
    )

    def passage(response, heard=Heard.ALWAYS):
        return Passage(request, 1, 1, 1, 1.0, 1.0, 1.0, 10.0, response, heard=heard)

    for passages, withdrawn, expected in (
        ([passage(wrong)], (), 1),
        ([passage(wrong)], (0,), 4),
        ([passage(wrong, Heard.NEVER)], (), 4),
        ([passage(busy, Heard.UNLESS_BUSY)], (), 4),
        ([passage(wrong, Heard.UNLESS_BUSY)], (), 1),
    ):
        _stored(tmp_path, passages, started=done.result["started"], withdrawn=withdrawn)
        assert len(list(read_history(tmp_path / HISTORY_NAME))) == 2 + len(passages) + len(withdrawn)
        code, text = _judged(tmp_path, "http/date-format")
        assert code == expected, (passages, text)


def test_the_history_of_another_run_is_refused(run, tmp_path):
    shutil.copytree(run[0], tmp_path / "out")
    _stored(tmp_path / "out", (), started="2026-11-28T00:00:00.000000Z")
    done = ended(sys.executable, "-m", "roaas", "judge", tmp_path / "out")
    assert done.returncode == 2, done.stdout
    assert "the history of another run: it began at 2026-11-28T00:00:00.000000Z" in " ".join(done.stderr.split())


def test_a_trace_of_an_earlier_version_is_named_and_the_rest_is_judged(run, tmp_path):
    shutil.copytree(run[0], tmp_path / "out")
    traces = json.loads(gzip.decompress((tmp_path / "out" / "traces.json.gz").read_bytes()))
    traces["survey"] = {"probes": [{"of": "another version"}]}
    (tmp_path / "out" / "traces.json.gz").write_bytes(gzip.compress(json.dumps(traces).encode()))
    done = ended(sys.executable, "-m", "roaas", "judge", tmp_path / "out")
    assert (done.returncode, "fail: http/date-format (" in done.stdout) == (1, True), done.stdout
    assert "the trace of survey: not judged" in done.stderr


@pytest.mark.parametrize(
    ("path", "body", "requirement"),
    [
        ("/robot/pose/", b"[]", "rest-resources/pose-type"),
        ("/robot/velocity/", b'{"linear": 1}', "rest-resources/velocity-type"),
        ("/robot/sensors/", b'[{"name": "l", "topic": "/l", "type": "L"}]', "rest-resources/sensors-named-in-full"),
    ],
)
def test_a_pack_s_own_clauses_are_judged_from_a_history(tmp_path, path, body, requirement):
    contract = Contract.load()
    run = Run(empty_statement(contract), contract, claims=tuple(contract.classes))
    request = Request("GET", f"http://robot{path}", (("Host", "robot"), ("Accept", "*/*")))
    response = Response(200, (("Content-Type", "application/json"),), body, 1.0, received_s=1.0)
    _stored(tmp_path, [Passage(request, 1, 1, 1, 1.0, 1.0, 1.0, 10.0, response, heard=Heard.ALWAYS)], started="now")
    document = {"started": "now", "target": {"rest": "http://robot"}}
    judged = judge_stored(RobotUnderTest(run), document, tmp_path)
    part = run.judge.of(requirement)
    assert (part.failures, run.judge.faults) == (1, {}), judged
