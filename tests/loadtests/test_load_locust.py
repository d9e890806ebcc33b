"""Plain Locust, and workers that come from elsewhere."""

import json
import os
import re
import socket
import subprocess
import sys
import urllib.request
from pathlib import Path

import pytest
import yaml

from loadtests.cli import load as load_command

ROOT = Path(__file__).parents[2]
LOCUST = [sys.executable, "-m", "locust", "-f", ROOT / "loadtests" / "locustfile.py"]


def test_plain_locust_calls_everything_over_both_interfaces(toy, tmp_path):
    run = subprocess.run(
        [*LOCUST, "--headless", "-u", "8", "-r", "8", "-t", "3s", *toy().both(), "--allow-motion", "--json"],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
        cwd=tmp_path,
    )
    entries = {entry["name"]: entry for entry in json.loads(run.stdout[run.stdout.index("[") :])}
    names = set(entries)
    assert {name.split()[1] + name.split()[2] for name in names} == {"restwire", "soapwire", "restzeep", "soapzeep"}, (
        run
    )
    assert all(entry["num_failures"] == 0 for entry in entries.values())
    times = [float(time) for entry in entries.values() for time in entry["response_times"]]
    assert any(time % 1 for time in times), "Locust's own percentiles have microseconds"


def test_plain_locust_moves_nothing_unasked_and_says_when_it_cannot_begin(toy, tmp_path):
    robot = toy()
    run = subprocess.run(
        [*LOCUST, "--headless", "-u", "16", "-r", "16", "-t", "4s", "--rest", robot.url, "--json"],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
        cwd=tmp_path,
    )
    assert "pose rest" in run.stdout
    assert "delivery" not in run.stdout
    lost = subprocess.run(
        [*LOCUST, "--headless", "-u", "1", "-t", "2s"],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
        cwd=tmp_path,
    )
    assert "cannot begin: no endpoint" in lost.stderr


def test_a_worker_from_elsewhere_joins_the_master(toy, load, tmp_path):
    token = tmp_path / "token"
    token.write_text("s3same")
    robot = toy("--token", "s3same")
    process, finish = load.begin(
        *robot.both(),
        "--token-file",
        token,
        "--rate",
        "60",
        "--duration",
        "2",
        "--warmup",
        "0.4",
        "--client",
        "wire",
        "--processes",
        "0",
        "--expect-workers",
        "1",
        "--web-port",
        free_port(),
    )
    port = next(found[1] for line in process.stderr if (found := re.search(r"master on 127\.0\.0\.1:(\d+)", line)))
    worker = subprocess.Popen(
        [
            sys.executable,
            "-m",
            "loadtests.node",
            "--worker",
            "--master-host",
            "127.0.0.1",
            f"--master-port={port}",
            "--token-file",
            token,
            "--rate",
            "60",
        ],
        stderr=subprocess.PIPE,
        text=True,
    )
    run = finish()
    assert worker.wait(20) == 0, worker.stderr.read()
    worker.stderr.close()
    result = run.result
    assert [entry["state"] for entry in result["workers"]] == ["finished"]
    assert result["generator"]["scheduled"] == result["generator"]["started"] == 120
    assert all(entry["count"] and not entry["errors"] for entry in result["series"])


def test_the_web_ui_shows_the_runs_numbers(toy, load):
    port = free_port()
    process, finish = load.begin(
        "--rest",
        toy().url,
        "--rate",
        "60",
        "--duration",
        "3",
        "--warmup",
        "0.2",
        "--client",
        "wire",
        "--web-port",
        port,
    )
    counts = []
    for line in process.stderr:
        if re.search(r"[1-9]\d* requests answered", line):
            with urllib.request.urlopen(f"http://127.0.0.1:{port}/stats/requests", timeout=5) as answer:
                entries = {entry["name"]: entry for entry in json.load(answer)["stats"]}
            counts.append(entries.get("pose rest wire", {"num_requests": 0})["num_requests"])
    run = finish()
    assert run.code in {0, 4}
    assert counts == sorted(counts)
    assert 0 < counts[-1] <= 180


def test_the_kubernetes_manifest_gives_options_that_there_are():
    manifest = yaml.safe_load((ROOT / "deploy" / "kubernetes" / "loadtest.yaml").read_text())
    assert (manifest["apiVersion"], manifest["kind"]) == ("locust.io/v1", "LocustTest")
    words = manifest["spec"]["args"].split()
    load_command.make_context("load", list(words), resilient_parsing=False)
    assert words[words.index("--expect-workers") + 1] == str(manifest["spec"]["workers"])
    assert not any(
        "resources" in role and "cpu" in role["resources"]["limits"] for role in (manifest["spec"]["worker"],)
    )


def test_the_master_lingers_for_its_result_to_be_fetched():
    run = subprocess.run(
        [sys.executable, "-m", "loadtests.node", "--master", "--expect-workers", "1"],
        capture_output=True,
        text=True,
        timeout=30,
        check=False,
        env=os.environ | {"ROAAS_LINGER_S": "0.1"},
    )
    assert run.returncode == 2
    assert "no endpoint" in run.stderr
    assert "kept for 0.1 s" in run.stderr


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


@pytest.mark.parametrize("words", [["--worker"], ["--worker", "--master-port", "1"]])
def test_a_worker_has_to_know_its_master(words):
    run = subprocess.run(
        [sys.executable, "-m", "loadtests.node", *words], capture_output=True, text=True, timeout=30, check=False
    )
    assert run.returncode == 1
    assert "--master-host" in run.stderr
