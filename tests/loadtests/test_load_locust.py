"""Plain Locust, and workers that come from elsewhere."""

import json
import os
import re
import shlex
import signal
import subprocess
import sys
import urllib.request
from pathlib import Path

import jsonschema
import pytest
import yaml
from processes import ended

from loadtests.cli import load as load_command

ROOT = Path(__file__).parents[2]
LOCUST = [sys.executable, "-m", "locust", "-f", ROOT / "loadtests" / "locustfile.py", "--headless"]
NODE = "from loadtests.node import main; main(sys.argv[1:])"
#: A worker that takes its time between Locust's handshake and listening to our messages.
DAWDLING = """
import gevent, locust.runners
connect = locust.runners.WorkerRunner.connect_to_master
locust.runners.WorkerRunner.connect_to_master = lambda runner: (connect(runner), gevent.sleep(1))
"""


def locust_until(reached, *options, folder):
    """Run Locust until what it prints says enough; returns that and its statistics in the end by name."""
    command = [*LOCUST, "-t", "60s", *options, "--json-file", "found"]
    outputs = {"stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE, "text": True}
    process = subprocess.Popen(command, cwd=folder, **outputs)
    told = ""
    for line in process.stderr:
        told += line
        if reached(told):
            break
    process.send_signal(signal.SIGTERM)
    told += process.communicate(timeout=240)[1]
    return told, {entry["name"]: entry for entry in json.loads((folder / "found.json").read_text())}


def test_plain_locust_calls_everything_over_both_interfaces(toy, tmp_path):
    series = [f"{interface} {client}" for interface in ("rest", "soap") for client in ("wire", "zeep")]
    told, entries = locust_until(
        lambda told: all(name in told for name in series),
        *("-u", "8", "-r", "8", *toy().both(), "--allow-motion"),
        folder=tmp_path,
    )
    assert {name.split(maxsplit=1)[1] for name in entries} == set(series), told
    assert all(entry["num_failures"] == 0 for entry in entries.values())
    times = [float(time) for entry in entries.values() for time in entry["response_times"]]
    assert any(time % 1 for time in times), "Locust's own percentiles have microseconds"


def test_plain_locust_moves_nothing_unasked_and_says_when_it_cannot_begin(toy, tmp_path):
    told, entries = locust_until(
        lambda told: len(re.findall("GET +pose rest", told)) > 2,
        *("-u", "16", "-r", "16", "--rest", toy().url),
        folder=tmp_path,
    )
    assert {name.split()[0] for name in entries} == {"pose"}, told
    assert "cannot begin: no endpoint" in ended(*LOCUST, "-u", "1", "-t", "2s", cwd=tmp_path).stderr


def test_a_worker_from_elsewhere_joins_the_master(toy, load, wait_for, free_port, tmp_path):
    token = tmp_path / "token"
    token.write_text("s3same")
    process, finish = load.begin(
        *toy("--token", "s3same").both(),
        f"--token-file={token} --rate 60 --duration 2 --warmup 0.4 --client wire",
        f"--processes 0 --expect-workers 1 --web-port {free_port}",
    )
    port = wait_for(process, r"master on 127\.0\.0\.1:(\d+)")[1]
    options = f"--worker --master-host 127.0.0.1 --master-port={port} --token-file {token} --trust-host 127.0.0.1"
    with subprocess.Popen([sys.executable, "-c", f"import sys\n{DAWDLING}\n{NODE}", *options.split()]) as worker:
        run = finish()
        assert worker.wait(60) == 0
    result = run.result
    assert [entry["state"] for entry in result["workers"]] == ["finished"]
    plan = result["plan"]
    asked = 60 * plan["blocks"] * (plan["block_s"] - plan["gap_s"])
    assert result["counts"]["asked"] == result["counts"]["sent"] == pytest.approx(asked, abs=4)
    assert all(entry["count"] and not entry["errors"] for entry in result["series"])


def test_the_web_ui_shows_the_runs_numbers(toy, load, free_port):
    process, finish = load.begin(
        f"--rest {toy().url} --rate 60 --duration 3 --warmup 0.2 --client wire --progress lines --web-port {free_port}"
    )
    counts = []
    for line in process.stderr:
        if re.search(r"[1-9]\d* requests answered", line):
            with urllib.request.urlopen(f"http://127.0.0.1:{free_port}/stats/requests", timeout=60) as answer:
                entries = {entry["name"]: entry for entry in json.load(answer)["stats"]}
            counts.append(entries.get("pose rest wire", {"num_requests": 0})["num_requests"])
    assert finish().code in {0, 4}
    assert counts == sorted(counts)
    assert 0 < counts[-1] <= 180


@pytest.mark.parametrize("name", ["loadtest.yaml", "described.yaml", "scenario.yaml"])
def test_a_kubernetes_manifest_is_one_and_gives_options_that_there_are(name):
    folder = ROOT / "deploy" / "kubernetes"
    manifest = yaml.safe_load((folder / name).read_text())
    schema = json.loads((folder / "locusttest.schema.json").read_text())
    operators = jsonschema.Draft202012Validator(schema)
    operators.validate(manifest)
    for wrong in (
        {"workers": 0},
        {"image": 1},
        {"replicas": 2},
        {"worker": {"resources": {"limits": {"memory": "1 GB"}}}},
    ):
        assert not operators.is_valid(manifest | {"spec": manifest["spec"] | wrong}), wrong
    version = re.search(r"chart ([\d.]+)", schema["title"])[1]
    assert f"--version {version} " in (folder / "README.md").read_text(), "the operator is pinned"
    assert f"chart {version}" in (folder / "loadtest.yaml").read_text()
    words = shlex.split(manifest["spec"]["args"])  # as the operator does
    if "--scenario" in words:  # where the operator mounts the file of the ConfigMap
        place = words.index("--scenario") + 1
        assert (manifest["spec"]["locustfile"].keys(), Path(words[place]).parent.name) == ({"configMap"}, "locust")
        words[place] = str(ROOT / "examples" / "scenario" / Path(words[place]).name)
    load_command.make_context("load", list(words), resilient_parsing=False)
    assert words[words.index("--expect-workers") + 1] == str(manifest["spec"]["workers"])
    worker = manifest["spec"]["worker"]
    assert "resources" not in worker or "cpu" not in worker["resources"]["limits"]


def test_the_master_lingers_for_its_result_to_be_fetched():
    run = ended(
        *(sys.executable, "-m", "loadtests.node", "--master", "--expect-workers", "1"),
        env=os.environ | {"ROAAS_LINGER_S": "0.1"},
    )
    assert (run.returncode, "no endpoint" in run.stderr) == (2, True), run.stderr
    assert "kept for 0.1 s" in run.stderr


def test_a_worker_without_a_master_says_so_and_ends(free_port):
    hasty = "import sys, locust.runners as runners\nrunners.CONNECT_TIMEOUT, runners.CONNECT_RETRY_COUNT = 0.1, 1\n"
    words = ["--worker", "--master-host=127.0.0.1", f"--master-port={free_port}"]
    run = ended(sys.executable, "-c", hasty + NODE, *words)
    assert (run.returncode, f"no master responds at 127.0.0.1:{free_port}" in run.stderr) == (3, True), run.stderr


@pytest.mark.parametrize("words", [["--worker"], ["--worker", "--master-port", "1"]])
def test_a_worker_has_to_know_its_master(words):
    run = ended(sys.executable, "-m", "loadtests.node", *words)
    assert (run.returncode, "--master-host" in run.stderr) == (2, True), run.stderr
