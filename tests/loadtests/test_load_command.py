"""`roaas load` as people start it, against robots that behave and robots that do not."""

import json
import re
import signal
import socket

import psutil
import pytest

from conformance.papers_robot.statement import CONTRACT_DIR

SHORT = "--rate 60 --duration 2 --warmup 0.4"


def test_a_good_robot_is_measured(toy, load, tmp_path):
    statement = tmp_path / "statement.toml"
    statement.write_text("[slo.pose]\np50_ms = 5000\n")
    operations = "--allow-motion --operation delivery --operation coffee --operation pose"
    run = load(statement, *toy().both(), SHORT, operations)
    result = run.result
    assert run.code == (0 if result["valid"] else 4), run.out + run.err
    wanted = {(o, i, c) for o in ("delivery", "coffee", "pose") for i in ("rest", "soap") for c in ("wire", "zeep")}
    assert {(entry["operation"], entry["interface"], entry["client"]) for entry in result["series"]} == wanted
    for entry in result["series"]:
        assert entry["count"] > 0
        assert entry["errors"] == 0
        assert entry["spans_ms"]["server"]["p50"] == pytest.approx(0.015, abs=0.001)
    assert result["counts"]["asked"] == result["counts"]["sent"]
    assert result["counts"]["asked"] == pytest.approx(60 * sum(block["length_s"] for block in result["blocks"]), abs=2)
    assert result["generator"]["resends"] == 0
    assert [level["outcome"] for level in result["slo"]] == ["kept", "kept"]
    assert result["environment"]["robot"]["servers"] == {"rest": "toy/1", "soap": "toy/1"}
    assert "toy_robot.py" in result["environment"]["robot_command"]
    assert 0 < result["environment"]["robot_cpu_share"] < 1.1
    assert str(tmp_path) not in json.dumps(result), "no path of the generator's machine"
    assert (run.folder / "pose-soap-wire-response.hgrm").read_text().count("\n") > 5
    assert "SOAP takes" in run.out


def test_a_slow_robot_is_seen_to_be_slow_and_breaks_its_service_level(toy, load, tmp_path):
    statement = tmp_path / "statement.toml"
    statement.write_text("[slo.pose]\np50_ms = 30\n")
    robot = toy("--delay", "0.04", "--silent")
    run = load(statement, "--rest", robot.url, SHORT, "--client wire")
    result = run.result
    series = run.series("pose", "rest")
    assert series["service_ms"]["p50"] >= 40
    assert series["spans_ms"]["server"] is None, "the robot does not say"
    assert series["service_ms"]["p99"] is None
    assert "needs 1000" in series["reasons"]["p99"]
    assert (result["slo"][0]["outcome"], result["comparisons"]) == ("broken", [])
    assert run.code == (1 if result["valid"] else 4)
    assert result["plan"]["block_s"] >= 0.099, "long beside an answer"


def test_a_quick_robot_is_asked_in_shorter_blocks(toy, load):
    robot = toy()
    runs = (load(*robot.both(), "--rate 400 --duration 1 --warmup 0 --client wire") for _ in range(20))
    assert any(run.result["plan"]["block_s"] < 0.03 for run in runs), "a busy machine may delay the first answers"


def test_a_stall_is_seen_by_every_request_that_it_meets(toy, load):
    robot = toy("--stall", "1.5", "--stall-at", "2", "--ready-after", "60")
    run = load(*robot.both(), "--rate 100 --duration 6 --warmup 0.5 --client wire")
    result = run.result
    worst = max(entry["response_ms"]["p95"] for entry in result["series"])
    assert worst > 900, "a stall of 1.5 s in 6 s met a quarter of the requests"
    points = [point for entry in result["time_series"]["series"] for point in entry["points"]]
    assert max(point["max_ms"] for point in points) > 1300
    assert min(point["max_ms"] for point in points) < 500


@pytest.mark.parametrize(
    ("fault", "options", "kinds", "told"),
    [
        ("--fault", "", {"fault"}, "out of coffee"),
        ("--redirect", "--interface rest", {"redirect"}, "status 307 to 'http://elsewhere.invalid/robot/pose/'"),
        ("--redirect", "--interface soap --client zeep", {"redirect"}, "status 307 to 'http://elsewhere.invalid"),
        ("--short", "--client wire", set(), "payloads are not equivalent: pose: "),
    ],
)
def test_a_robot_that_answers_otherwise_gives_no_valid_run(toy, load, fault, options, kinds, told):
    run = load(*toy(fault).both(), SHORT, options)
    assert run.code == 4
    assert told in run.out + run.err
    assert not run.result["valid"]
    assert kinds <= {entry["kind"] for entry in run.result["errors"]}


def test_a_robot_that_hangs_on_its_slowest_requests_misses_a_p99(toy, load, tmp_path):
    statement = tmp_path / "statement.toml"
    statement.write_text("[slo.pose]\np99_ms = 1900\n")
    robot = toy("--hang-every", "50")
    run = load(statement, "--rest", robot.url, "--client wire --rate 400 --duration 5.5 --warmup 0.2 --timeout 2")
    result, series = run.result, run.series("pose", "rest")
    share = series["errors"] / (series["errors"] + series["count"])
    assert share > 0.015, "one in fifty is never answered"
    assert series["counted"] == series["count"] + series["errors"] + series["dropped"] >= 1000
    assert {"p999", "max"} & set(series["at_least"])
    assert series["service_ms"]["max"] >= 2000, "none of them was answered in 2 s"
    assert series["failed_histogram"]
    assert [entry["outcome"] for entry in result["slo"]] == ["broken"], result["slo"]
    other = [reason for reason in result["invalid_because"] if "requests failed" not in reason]
    assert run.code == (4 if other else 1), run.out


def test_repeats_begin_with_new_connections_and_a_command(toy, load, tmp_path):
    mark, command = tmp_path / "restarted", tmp_path / "restart"
    command.write_text(f"#!/bin/sh\nprintf x >> {mark}\n")
    command.chmod(0o755)
    robot = toy()
    options = ("--rest", robot.url, "--client wire --rate 60 --duration 2 --warmup 0.2 --repeat 2")
    process, finish = load.begin(*options, "--restart-command", command)
    run = finish()
    result = run.result
    assert mark.read_text() == "x", run.err
    assert str(tmp_path) not in json.dumps(result)
    assert (result["plan"]["repeats"], {block["repeat"] for block in result["blocks"]}) == (2, {0, 1})
    assert [repeat["repeat"] for repeat in run.series("pose", "rest")["repeats"]] == [0, 1]
    assert max(point["t_s"] for entry in result["time_series"]["series"] for point in entry["points"]) > 3
    assert result["generator"]["connects"] >= 2
    assert process.returncode == run.code
    command.write_text("#!/bin/sh\nexit 3\n")
    failed = load(*options, "--restart-command", command)
    assert (failed.code, "exit code 3" in failed.err) == (3, True), failed.err
    assert sum(entry["count"] for entry in failed.result["series"]) > 40, "what was measured is kept"


def test_a_token_and_a_base_path(toy, load, tmp_path):
    token = tmp_path / "token"
    token.write_text("s3same\n")
    robot = toy("--token", "s3same", "--prefix", "/fleet/7")
    refused = load("--rest", robot.url, SHORT)
    assert (refused.code, "--token-file" in refused.err) == (4, True), refused.err
    run = load(*robot.both(), SHORT, "--client zeep --token-file", token)
    result = run.result
    assert all(entry["count"] and not entry["errors"] for entry in result["series"])
    assert "s3same" not in run.out + run.err + json.dumps(result)


def test_tls(toy, load, certificate):
    robot = toy("--tls", *certificate)
    distrusting = load("--rest", robot.url, SHORT)
    assert (distrusting.code, "ca_file" in distrusting.err) == (3, True), distrusting.err
    run = load(*robot.both(), SHORT, "--ca-file", certificate[0])
    assert all(entry["count"] and not entry["errors"] for entry in run.result["series"])


def test_nobody_there(load, free_port):
    run = load("--rest", f"http://127.0.0.1:{free_port}", SHORT)
    assert (run.code, "connection refused" in run.err) == (3, True), run.err
    assert not run.result["valid"]


def test_a_wrong_wsdl(toy, load):
    run = load("--rest", toy().url, "--publishers-wsdl", CONTRACT_DIR / "subscribers.wsdl", SHORT)
    assert (run.code, "has no operation 'ExecuteDeliveryRequest'" in run.err) == (2, True), run.err


def test_a_robot_that_dies_leaves_what_was_measured(toy, load):
    robot = toy("--die-after", "120")
    run = load(*robot.both(), "--rate 100 --duration 15 --warmup 0.4 --client wire")
    result = run.result
    assert run.code == 4
    assert any("no request succeeded from" in reason for reason in result["invalid_because"])
    assert sum(entry["count"] for entry in result["series"]) > 30
    assert {entry["kind"] for entry in result["errors"]} >= {"refused"}
    assert sum(result["counts"]["failed"].values()) > 0.1 * result["counts"]["sent"]
    assert result["interrupted"]


def test_ctrl_c_leaves_what_was_measured(toy, load, wait_for):
    process, finish = load.begin("--rest", toy().url, "--rate 60 --duration 60 --warmup 0.2")
    wait_for(process, r"(?:[6-9]\d|\d{3,}) requests answered")
    process.send_signal(signal.SIGINT)
    run = finish()
    result = run.result
    assert run.code == 130
    assert result["interrupted"]
    assert sum(entry["count"] for entry in result["series"]) > 20
    assert "interrupted after" in result["invalid_because"][0]
    if result["invalid_because"][1:]:  # a busy machine made requests late as well
        return
    assert re.search(r"^Interrupted; until then: .* requests over REST take", run.out, re.MULTILINE), run.out


def test_a_worker_that_is_killed_is_missed_and_named_and_one_that_was_silent_is_not(toy, load, wait_for):
    options = "--rate 80 --duration 15 --warmup 0.4 --processes 2 --client wire --progress lines"
    process, finish = load.begin(*toy().both(), options)
    wait_for(process, r"[1-9]\d* requests answered")
    workers = [
        child
        for child in psutil.Process(process.pid).children(recursive=True)
        if "loadtests.measuring.worker" in child.cmdline()
    ]
    assert len(workers) == 2
    for _ in range(2):  # time for both to have reported
        wait_for(process, "requests answered")
    workers[1].suspend()
    wait_for(process, r"was lost [\d.]+ s into the run")
    workers[1].resume()
    wait_for(process, r"worker \d .* is back")
    workers[0].kill()
    run = finish()
    result = run.result
    lost = next(worker for worker in result["workers"] if worker["state"] == "lost")
    assert lost["pid"] == workers[0].pid
    assert 0 < lost["arrivals_lost"] <= 616
    kept = next(worker for worker in result["workers"] if worker["state"] == "finished")
    # Of a block's odd number of arrivals one has one more.
    assert abs(lost["requests"] + lost["arrivals_lost"] - kept["requests"]) <= 4, "nothing is lost without being missed"
    assert any("was lost" in note for note in result["notes"])
    assert run.code == 4
    assert any("neither sent nor given up" in reason for reason in result["invalid_because"])


@pytest.mark.parametrize("option", ["--master-port", "--web-port"])
def test_ports_in_use(toy, load, option):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        run = load("--rest", toy().url, SHORT, f"{option} {taken.getsockname()[1]} --processes 2")
    assert (run.code, option in run.err) == (2, True), run.err


def test_the_closed_model(toy, load):
    # Of a response in 0.3 ms, the generator's own time can be a fifth.
    run = load(f"--rest {toy('--delay', '0.01').url} --users 2 --duration 3 --warmup 0.2")
    result = run.result
    assert (result["plan"]["model"], result["plan"]["users"]) == ("closed", 2)
    series = run.series("pose", "rest")
    assert series["count"] > 100
    assert series["response_ms"]["p50"] == pytest.approx(series["service_ms"]["p50"], rel=0.2)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ("--operation delivery", "--allow-motion"),
        ("none.toml", "there is no file none.toml"),
        ("--stages 1,x", "not a list of stages"),
    ],
)
def test_usage_errors_touch_no_robot(usage_error, options, message, tmp_path):
    assert message in usage_error("--rest http://127.0.0.1:9 --out", tmp_path, options)
    assert list(tmp_path.iterdir()) == []


def test_the_knee_is_searched_over_each_interface_and_both(toy, load):
    robot = toy("--busy", "0.01")  # answers 100 a second and no more
    run = load(
        *robot.both(),
        "--rate 20 --duration 0.5 --warmup 0.1 --client wire --knee --knee-searches 1 --step-duration 0.3",
    )
    result = run.result
    found = {entry["interface"]: entry for entry in result["knee_search"]}
    assert list(found) == ["rest", "soap", "both"]
    for entry in found.values():
        assert entry["rate"] is None or 20 < entry["rate"] < 160
        assert entry["brackets"][0][1] is not None, "it gave way"
