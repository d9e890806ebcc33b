"""`roaas load` on devices with a description, as people start it."""

import json
import urllib.request

import pytest
from lxml import etree
from toy_api import LOGIN, MAP, TOKEN

from reports.formats.catalogue import latency_junit
from reports.latency.findings import sentences
from reports.latency.page import latency_html, latency_markdown

SHORT = "--rate 200 --duration 1 --warmup 0.1"


@pytest.fixture
def device(started):
    """Start a toy device; returns the URL of its description."""

    def start(*options):
        return f"http://127.0.0.1:{started('toy_api.py', *options)[1]}"

    return start


def calls(url):
    with urllib.request.urlopen(f"{url}/calls", timeout=60) as answer:  # noqa: S310 -- http
        return json.load(answer)


def test_operations_with_weights_values_and_service_levels(device, load, tmp_path):
    url, statement = device("--fail-every", "20"), tmp_path / "robot.toml"
    statement.write_text(
        f'[robot]\nname = "toy"\n[api]\nopenapi = "{url}/openapi.json"\n'
        '[load]\noperations = { "GET /state" = 3, "GET /items/{item_id}" = 1 }\n'
        '[slo]\n"GET /state" = { p90_ms = 9000, error_rate = 0.001, at_rate = 150 }\n'
        '"GET /items/{item_id}" = { p50_ms = 9000, p999_ms = 9000 }\n"GET /text" = { p50_ms = 1 }\n'
    )
    run = load(str(statement), "--duration 2 --warmup 0.2")
    result = run.result
    assert run.code == (1 if result["trustworthy"] else 4), run.out + run.err
    levels = {(each["operation"], each["limit"]): each for each in result["slo"]}
    outcomes = {key: each["outcome"] for key, each in levels.items()}
    assert outcomes == {
        ("GET /state", "p90_ms"): "kept",
        ("GET /state", "error_rate"): "broken",
        ("GET /items/{item_id}", "p50_ms"): "kept",
        ("GET /items/{item_id}", "p999_ms"): "not known",
    }
    state = levels["GET /state", "error_rate"]
    assert (state["rate"], state["requests"]) == (150, pytest.approx(300, abs=25))
    assert state["measured"] == pytest.approx(0.05, abs=0.01)
    assert {each["operation"]: each["count"] > 0 for each in result["series"]} == {
        "GET /state": True,
        "GET /items/{item_id}": True,
    }
    assert result["plan"]["weights"] == {"GET /state": 3, "GET /items/{item_id}": 1}
    assert (result["plan"]["rate"], result["plan"]["clients"].keys()) == (200, {"wire"})
    assert "not measured, so not judged: [slo] GET /text" in result["notes"]
    assert {(each["kind"], each["operation"]) for each in result["errors"]} == {("status", "GET /state")}
    done = calls(url)
    assert done["GET /items/left"] > 20
    assert done["GET /items/right"] > 20, "both values are used"
    assert "POST /drive" not in done
    assert (run.folder / "GET_items_item_id-rest-wire-service.hgrm").is_file()
    assert not result["trustworthy"] or "1 of 4 service levels broken" in latency_html(result)
    suite = etree.fromstring(latency_junit(result).encode())
    assert (suite.get("tests"), suite.get("failures")) == ("5", "1")
    told = sentences(result | {"trustworthy": True})
    assert any("requests failed: at this load, one every" in line for line in told)


def test_workers_call_what_changes_something_by_leave_and_it_is_stopped_at_the_end(device, load, tmp_path):
    key = tmp_path / "key"
    key.write_text("t0ken-of-robot")
    url = device("--auth", "header")
    run = load(
        f"{url}/openapi.json",
        SHORT,
        "--processes 2 --call 'POST /drive' --operation 'POST /drive' --operation 'GET /items'",
        "--api-key 'header X-Robot-Key' --api-key-file",
        key,
    )
    assert {each["operation"]: each["errors"] for each in run.result["series"]} == {"POST /drive": 0, "GET /items": 0}
    done = calls(url)
    assert done["POST /drive"] > 50
    assert done["POST /halt"] == 1
    assert run.result["plan"]["limits"]["max_rate"] == 500
    assert "t0ken" not in run.out + run.err + json.dumps(run.result)


def test_what_the_description_does_not_declare_fails(device, load):
    run = load(f"{device()}/openapi.json", SHORT, "--operation 'GET /text' --operation 'GET /made'")
    assert run.code == 4
    assert "GET /text over rest (wire): status 200 with text/plain, declared is application/json" in run.err
    assert "GET /made over rest (wire): status 201, declared is 200" in run.err
    assert "does not respond as its description says" in run.err


def test_a_slower_device_takes_turns_with_it(device, load):
    url, other = device(), device("--slow", "0.02")
    run = load(
        f"{url}/openapi.json",
        "--operation readState --rate 60 --duration 2 --warmup 0.1 --against",
        other,
        "--stream 'GET /events' --stamp-field /stamp",
    )
    result = run.result
    assert result["against"]["robot"]["rest"] == other
    assert (run.code, result["against"]["verdict"]) == (0, "not slower"), run.out + run.err
    changes = [each for each in result["against"]["changes"] if each["quantile"] == "p50"]
    assert [each["operation"] for each in changes] == ["GET /state"]
    heard, polled = result["streams"]
    assert (heard["name"], heard["kind"], polled["name"], polled["kind"]) == (
        "GET /events",
        "sse",
        "GET /state",
        "polling",
    )
    assert heard["messages"] == heard["stamped"] > 20
    assert heard["clock"] == "shared"
    assert "GET /events, streamed: the data is" in latency_html(result)
    assert "GET /events (sse)" in latency_markdown(result)


def test_a_device_that_refuses_the_token_is_not_measured(device, load, tmp_path):
    (tmp_path / "token").write_text("wrong-one")
    url = device("--auth", "bearer")
    run = load(f"--openapi {url}/openapi.json", SHORT, f"--operation 'GET /state' --token-file {tmp_path / 'token'}")
    assert run.code == 4, run.out + run.err
    assert "The only request to the robot was answered 401: nothing was measured" in run.err


def test_https_with_its_own_authority_and_a_login(started, load, certificate, tmp_path):
    cert, key = certificate
    _, port = started("toy_api.py", "--auth", "bearer", "--tls", str(cert), str(key))
    url, statement = f"https://localhost:{port}", tmp_path / "robot.toml"
    (tmp_path / "login.json").write_text(LOGIN)
    (tmp_path / "ca.pem").write_bytes(cert.read_bytes())
    statement.write_text(
        f'[api]\nopenapi = "{url}/openapi.json"\n[endpoints]\nrest = "{url}"\nca_file = "ca.pem"\n'
        '[auth]\nlogin = "POST /login"\nbody_file = "login.json"\ntoken = "/session/token"\n'
    )
    run = load(str(statement), SHORT, "--operation 'GET /state' --processes 2")
    series = run.series("GET /state", "rest")
    assert (series["count"] > 50, series["errors"]) == (True, 0), run.out + run.err
    assert [run.result["environment"]["robot"][key] for key in ("name", "rest")] == ["toy", url]
    assert TOKEN not in run.out + run.err + json.dumps(run.result)
    untrusted = load(f"{url}/openapi.json", SHORT, "--operation 'GET /state'")
    assert (untrusted.code, "certificate" in untrusted.err) == (3, True), untrusted.err
    (tmp_path / "login.json").write_text("{}")
    refused = load(str(statement), SHORT, "--operation 'GET /state'")
    assert (refused.code, "[auth] login = 'POST /login': the device responded 403" in refused.err) == (2, True)


@pytest.fixture
def driven(device, load, tmp_path):
    """Drive a device that coasts for so long after a halt; gives the run and the device's URL."""

    def drive(coast, *options):
        url, statement = device("--coast", str(coast)), tmp_path / "robot.toml"
        statement.write_text(f'[api]\nopenapi = "{url}/openapi.json"\n{MAP}')
        return load(str(statement), SHORT, "--operation 'POST /drive' --call 'POST /drive'", *options), url

    return drive


def where(url):
    with urllib.request.urlopen(f"{url}/where", timeout=60) as answer:  # noqa: S310 -- http
        return json.load(answer)


def test_after_a_load_that_moves_a_device_it_is_stopped_and_its_rest_is_awaited(driven):
    run, url = driven(1.5, "--allow-motion")
    assert where(url)["speed"] == 0, "it has come to rest when the command ends"
    assert (run.series("POST /drive", "rest")["errors"], run.result["plan"]["limits"]["max_rate"]) == (0, 500)
    assert calls(url)["POST /halt"] >= 1
    assert "may still move" not in run.err
    assert where(url)["x"] > 0, "it was moved"


def test_a_device_that_does_not_come_to_rest_is_named(driven):
    run, url = driven(60, "--allow-motion")
    assert where(url)["speed"] == 0.5
    said = "the stop could not be delivered; the robot may still move: the device does not come to rest"
    assert run.out.startswith(f"WARNING: {said}")
    document = json.loads((run.folder / "latency.json").read_text(encoding="utf-8"))
    assert document["stop_undelivered"].startswith(said)
    assert document["notes"][0] == document["stop_undelivered"]
    assert (run.code, document["exit_code"]) == (4, 4)


def test_what_the_motion_map_moves_needs_permission_to_move(driven):
    run, url = driven(0)
    assert run.code == 2
    assert "POST /drive is not called: it moves the device: --allow-motion allows it" in run.err
    assert "POST /drive" not in calls(url)


def test_nobody_there_is_said_before_the_run(load, free_port):
    run = load(f"http://127.0.0.1:{free_port}/openapi.json", "--operation x")
    assert (run.code, "the robot cannot be reached" in run.err) == (3, True), run.err
