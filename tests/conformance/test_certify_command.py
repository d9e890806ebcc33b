"""``roaas certify`` against what is no robot: a verdict and an exit code, never a traceback."""

from __future__ import annotations

import json
import subprocess
import sys
import time

import pytest


def _certify(tmp_path, *arguments):
    command = [sys.executable, "-m", "roaas", "certify", *arguments, "--out", str(tmp_path / "out")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert "Traceback" not in done.stdout + done.stderr
    result = tmp_path / "out" / "result.json"
    return done, json.loads(result.read_text(encoding="utf-8")) if result.exists() else None


def test_a_closed_port_is_not_reached(tmp_path, closed_port):
    done, result = _certify(tmp_path, "--rest", closed_port, "--profile", "full")
    assert done.returncode == 3
    assert "could not be reached" in done.stderr
    assert closed_port.removeprefix("http://127.0.0.1:") in result["target"]["rest"]
    assert {item["verdict"] for item in result["requirements"]} == {"error"}


def test_a_server_that_never_answers_is_not_reached(tmp_path, listening):
    url = listening(lambda connection: time.sleep(60) or connection)
    done, result = _certify(tmp_path, "--rest", url, "--timeout", "0.5")
    assert done.returncode == 3
    assert "no answer within 0.5 s" in done.stderr
    assert result["verdict"] == "inconclusive"


def test_a_plain_web_server_does_not_conform(tmp_path, web_server):
    done, result = _certify(tmp_path, "--rest", web_server, "--effort", "quick")
    assert done.returncode == 1
    assert result["verdict"] == "not-conformant"
    assert result["classes"]["rest-resources"] == "fail"
    failed = next(item for item in result["requirements"] if item["id"] == "rest-resources/pose-type")
    assert failed["failures"][0]["request"]["curl"].endswith("/robot/pose/")
    assert (tmp_path / "out" / "certificate.html").exists()
    assert (tmp_path / "out" / "junit.xml").exists()


def test_a_claimed_class_without_its_interface_fails(tmp_path, web_server):
    _, result = _certify(tmp_path, "--rest", web_server, "--class", "soap-delivery")
    verdicts = {item["id"]: item["verdict"] for item in result["requirements"]}
    assert verdicts["soap-delivery/reachable"] == "fail"
    assert result["classes"]["soap-delivery"] == "fail"


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        ([], "no robot is named"),
        (["--rest", "robot:7003"], "'robot:7003'"),
        (["--rest", "http://127.0.0.1:1", "--contract", "/nowhere"], "/nowhere"),
        (["--rest", "http://127.0.0.1:1", "--class", "rest"], "'rest'"),
        (["missing.toml"], "missing.toml"),
        (["--rest", "http://127.0.0.1:1", "--baseline", "missing.toml"], "missing.toml"),
    ],
)
def test_wrong_usage_is_told_by_name(tmp_path, arguments, named):
    done, result = _certify(tmp_path, *arguments)
    assert done.returncode == 2
    assert named in done.stderr
    assert result is None


def test_a_first_statement_is_written_and_can_be_used(tmp_path, web_server):
    statement = tmp_path / "robot.toml"
    command = [sys.executable, "-m", "roaas", "certify", "--init", str(statement), "--rest", web_server]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    done, result = _certify(tmp_path, str(statement), "--effort", "quick")
    assert done.returncode == 1
    assert result["target"]["rest"] == web_server
    again = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert again.returncode == 2
    assert "exists already" in again.stderr
