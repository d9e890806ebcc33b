"""``roaas certify`` against what is no robot: a verdict and an exit code, never a traceback."""

import hashlib
import json
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path
from urllib.error import HTTPError
from urllib.request import urlopen

import pytest
from processes import Begun, ended, independent_robot
from toy_server import Handler, server_of

from conformance.contract.pack import Contract
from conformance.contract.requirement_sets import current, load_set
from conformance.papers_robot.statement import CONTRACT_DIR
from proof.table1 import independent_robots
from reports.attestation.envelope import ENVELOPE_NAME, open_envelope, statement_in
from reports.attestation.keys import PRIVATE_NAME, PUBLIC_NAME, generate
from reports.attestation.statement import seed_of

_INDEPENDENT_ROBOTS = Path(independent_robots.__file__).parent


def _certify(tmp_path, *arguments):
    command = [sys.executable, "-m", "roaas", "certify", *arguments, "--out", str(tmp_path / "out")]
    done = ended(*command)
    assert "Traceback" not in done.stdout + done.stderr
    result = tmp_path / "out" / "result.json"
    return done, json.loads(result.read_text(encoding="utf-8")) if result.exists() else None


def test_a_closed_port_is_not_reached(tmp_path, closed_port):
    done, result = _certify(tmp_path, "--rest", closed_port, "--profile", "full")
    assert done.returncode == 3
    assert done.stderr.startswith("error: the robot could not be reached"), "nothing stands before the reason"
    assert closed_port.removeprefix("http://127.0.0.1:") in result["target"]["rest"]
    assert {item["verdict"] for item in result["requirements"]} == {"error"}


def test_what_the_run_was_given_stands_in_the_result(tmp_path, closed_port):
    statement, baseline = tmp_path / "robot.toml", tmp_path / "known.toml"
    statement.write_text(f'[endpoints]\nrest = "{closed_port}"\n')
    baseline.write_text("")
    generate(tmp_path / "keys")
    options = ["--nonce", "monday, 9:00", "--sign", str(tmp_path / "keys" / PRIVATE_NAME)]
    done, result = _certify(tmp_path, str(statement), "--baseline", str(baseline), *options)
    assert done.returncode == 3
    opened = open_envelope((tmp_path / "out" / ENVELOPE_NAME).read_bytes())
    assert statement_in(opened).predicate.properties == []
    assert (result["nonce"], result["seed"]) == ("monday, 9:00", seed_of("monday, 9:00")), "both rooms derive it alike"
    assert result["digests"]["statement"] == f"sha256:{hashlib.sha256(statement.read_bytes()).hexdigest()}"
    assert result["baseline"] == {"digest": f"sha256:{hashlib.sha256(b'').hexdigest()}"}
    assert result["requirement_set"] == current(Contract.load(), Contract.load().ledger).facts
    openapi = (CONTRACT_DIR / "openapi.yaml").read_bytes()
    assert result["digests"]["contract"]["openapi.yaml"] == f"sha256:{hashlib.sha256(openapi).hexdigest()}"


def test_a_key_that_cannot_sign_is_told_before_the_run(tmp_path, closed_port):
    generate(tmp_path / "keys")
    done, result = _certify(tmp_path, "--rest", closed_port, "--sign", str(tmp_path / "keys" / PUBLIC_NAME))
    assert (done.returncode, "not a private key" in done.stderr) == (2, True), done.stderr
    assert result is None


def test_a_server_that_never_answers_is_not_reached(tmp_path, listening):
    url = listening(lambda connection: time.sleep(60) or connection)
    done, result = _certify(tmp_path, "--rest", url, "--timeout", "0.5")
    assert (done.returncode, "no response within 0.5 s" in done.stderr) == (3, True), done.stderr
    assert result["verdict"] == "inconclusive"


def test_a_plain_web_server_does_not_conform(tmp_path, web_server):
    done, result = _certify(tmp_path, "--rest", web_server, "--effort", "quick", "--timeout", "4")
    assert (done.returncode, result["verdict"]) == (1, "not-conformant")
    assert result["classes"]["rest-resources"] == "fail"
    failed = next(item for item in result["requirements"] if item["id"] == "rest-resources/pose-type")
    assert failed["failures"][0]["request"]["curl"].endswith("/robot/pose/")
    assert (tmp_path / "out" / "certificate.html").exists()
    assert (tmp_path / "out" / "junit.xml").exists()


def test_a_server_of_one_page_leaves_nothing_in_error(tmp_path):
    class _Page(Handler):
        protocol_version = "HTTP/1.0"

        def answer(self):
            if self.command != "GET":
                self.send_error(501)
                return
            self.send_response(200)
            self.send_header("Content-Type", "text/html")
            self.end_headers()
            self.wfile.write(b"<html>welcome</html>")

    with server_of(_Page, handle_error=lambda *_: None) as server:  # clients that break off are no news
        done, result = _certify(tmp_path, "--rest", server.url, "--effort", "quick", "--class", "http")
    assert done.returncode == 1
    assert "error" not in {item["verdict"] for item in result["requirements"]}


def test_a_claimed_class_without_its_interface_fails(tmp_path, web_server):
    _, result = _certify(tmp_path, "--rest", web_server, "--class", "soap-delivery")
    verdicts = {item["id"]: item["verdict"] for item in result["requirements"]}
    assert (verdicts["soap-delivery/reachable"], result["classes"]["soap-delivery"]) == ("fail", "fail")


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        ([], "no robot is named"),
        (["--rest", "robot:7003"], "'robot:7003'"),
        (["--rest", "http://127.0.0.1:1", "--contract", "/nowhere"], "/nowhere"),
        (["--rest", "http://127.0.0.1:1", "--class", "rest"], "'rest'"),
        (["missing.toml"], "missing.toml"),
        (["--rest", "http://127.0.0.1:1", "--baseline", "missing.toml"], "missing.toml"),
        (["--rest", "http://127.0.0.1:1", "--requirements", "0.9"], "'0.9'"),
        (["--rest", "http://127.0.0.1:1", "--nonce", "a", "--seed", "1"], "--nonce"),
        (["--rest", "http://127.0.0.1:1", "--nonce", " "], "--nonce"),
        (["--rest", "http://127.0.0.1:1", "--nonce", "\n"], "--nonce"),
    ],
)
def test_wrong_usage_is_told_by_name(tmp_path, arguments, named):
    done, result = _certify(tmp_path, *arguments)
    assert (done.returncode, named in done.stderr) == (2, True), done.stderr
    assert result is None


def test_a_first_statement_is_written_and_can_be_used(tmp_path, web_server):
    statement = tmp_path / "robot.toml"
    command = [sys.executable, "-m", "roaas", "certify", "--init", str(statement), "--rest", web_server]
    done = ended(*command)
    assert (done.returncode, done.stderr) == (0, "")
    done, result = _certify(tmp_path, str(statement), "--effort", "quick", "--select", "rest-resources/pose-type")
    assert (done.returncode, result["target"]["rest"]) == (1, web_server)
    again = ended(*command)
    assert (again.returncode, "exists already" in again.stderr) == (2, True), again.stderr


@contextmanager
def _independent_robot(name):
    with independent_robot(name) as (process, rest, soap):
        services = ["--publishers-wsdl", soap, "--subscribers-wsdl", soap.replace("publisher", "subscriber")]
        yield process, rest, [str(_INDEPENDENT_ROBOTS / name / f"{name}.toml"), "--rest", rest, *services]


def _until(process, text):
    for line in process.stderr:
        if text in line:
            return
    pytest.fail(f"the run ended without {text!r}")


def _broken_off(tmp_path, where, break_off):
    """A run that something happens to while the robot moves: its exit code and its result."""
    words = ["certify", *where, "--allow-motion", "--out", tmp_path, "--wait", "2", "--effort", "quick"]
    with Begun(*words, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as run:
        _until(run, "| goal drives")
        break_off(run)
        said, errors = run.communicate(timeout=240)
    assert "Traceback" not in said + errors
    return run.returncode, json.loads((tmp_path / "result.json").read_text(encoding="utf-8"))


def test_a_robot_that_dies_in_mid_run_is_judged_as_far_as_it_came(tmp_path):
    with _independent_robot("baroque") as (robot, _, where):
        code, result = _broken_off(tmp_path, where, lambda _: robot.kill())
    assert code == 4
    verdicts = {item["id"]: item for item in result["requirements"]}
    assert verdicts["rest-resources/pose-type"]["verdict"] == "pass"
    assert verdicts["xml-security/doctype"]["verdict"] == "error"
    assert "stopped responding" in verdicts["xml-security/doctype"]["reason"]


def test_an_interrupted_run_keeps_what_it_has_and_stops_the_robot(tmp_path):
    with _independent_robot("baroque") as (_, rest, where):
        code, result = _broken_off(tmp_path, where, lambda run: run.send_signal(signal.SIGINT))
        assert code == 130
        assert result["interrupted"]
        assert {"pass", "error"} <= {item["verdict"] for item in result["requirements"]}
        with pytest.raises(HTTPError) as none:
            urlopen(rest + "/robot/navigation/action/goal/")  # noqa: S310 - our own robot
        assert none.value.code == 404
        with urlopen(rest + "/robot/velocity/") as answer:  # noqa: S310 - our own robot
            twist = json.load(answer)
        assert max(abs(value) for part in ("linear", "angular") for value in twist[part].values()) < 0.02


def test_the_suite_runs_in_somebody_elses_project(tmp_path):
    (tmp_path / "test_own.py").write_text("def test_own(): pass\n", encoding="utf-8")
    with _independent_robot("plain") as (_, rest, _):
        command = [sys.executable, "-m", "pytest", "-q", "-p", "roaas_pytest", "--pyargs", "conformance", "test_own.py"]
        command += ["--robot-rest", rest, "--robot-class", "rest-formats", "--robot-effort", "quick"]
        done = ended(*command, cwd=tmp_path)
    assert (done.returncode, "passed" in done.stdout) == (0, True), done.stdout


def test_a_frozen_set_is_what_a_run_is_scored_by(tmp_path, closed_port):
    _, result = _certify(tmp_path, "--rest", closed_port, "--requirements", "1.2")
    assert result["requirement_set"] == load_set(Contract.load(), "1.2").facts
