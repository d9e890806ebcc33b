"""`roaas load` on operations of a WSDL, and on operations that a device offers over REST and SOAP."""

import contextlib
import json
import re
import subprocess
import sys

import pytest
from lxml import etree
from soap_devices import PASSWORD, USER, camera, serving, table

from reports.formats.catalogue import latency_junit
from reports.latency.page import latency_html, latency_markdown

SHORT = "--rate 100 --duration 2 --warmup 0.1"


@pytest.fixture
def robot():
    """Start the robot `plain`, which shares no code with the suite; gives its REST and SOAP addresses."""
    command = [sys.executable, "-m", "proof.table1.independent_robots", "plain"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            rest, soap = re.fullmatch(r"ready rest=(\S+) soap=(http://[^/]+)\S*\n", process.stdout.readline()).groups()
            yield rest, soap
        finally:
            process.terminate()


def test_operations_of_a_wsdl_with_weights_faults_and_service_levels(load, tmp_path):
    device, sent = camera(), []

    def faulty(request, status, kind, body):
        sent.append(re.search(rb"<\w+:(GetStatus|AbsoluteMove)\b", request)[1].decode())
        return (500, kind, device.fault("Server", "overheated")[1]) if len(sent) % 20 == 0 else (status, kind, body)

    device.alter = faulty
    statement = tmp_path / "camera.toml"
    with serving(device) as url:
        statement.write_text(
            f'[robot]\nname = "camera"\n[api]\nwsdl = "{url}/camera.wsdl"\n[calls]\nallow = ["AbsoluteMove"]\n'
            "[load]\noperations = { GetStatus = 3, AbsoluteMove = 1 }\n"
            "[slo]\nGetStatus = { p90_ms = 9000, error_rate = 0.001, at_rate = 75 }\n"
        )
        run = load(str(statement), "--duration 3 --warmup 0.1")
    result = run.result
    outcomes = {(each["operation"], each["interface"], each["limit"]): each["outcome"] for each in result["slo"]}
    assert outcomes == {("GetStatus", "soap", "p90_ms"): "kept", ("GetStatus", "soap", "error_rate"): "broken"}
    assert run.code == (1 if result["trustworthy"] else 4), run.out + run.err
    assert {(each["kind"], each["interface"]) for each in result["errors"]} == {("fault", "soap")}
    assert "SOAP fault: overheated" in result["errors"][0]["message"]
    assert sent.count("GetStatus") / sent.count("AbsoluteMove") == pytest.approx(3, rel=0.2)
    assert (result["plan"]["interfaces"], result["plan"]["rate"]) == (["soap"], 100)
    assert result["plan"]["limits"]["max_rate"] == 500, "the limits of what may move it"
    assert result["environment"]["robot"] | {"rest": None, "soap": url} == result["environment"]["robot"]
    assert result["noise_floor"], "A/A control"
    assert (run.folder / "GetStatus-soap-wire-service.hgrm").is_file()
    suite = etree.fromstring(latency_junit(result).encode())
    assert suite.get("tests") == "3"
    page = latency_html(result)
    assert "SOAP compared with REST" not in page
    assert "GetStatus" in page
    assert "SOAP fault: overheated" in latency_markdown(result)


def test_workers_send_each_message_with_a_token_of_its_own(load, tmp_path):
    device, user = table(), tmp_path / "user"
    user.write_text(f"{USER}:{PASSWORD}")
    with serving(device) as url:
        run = load(
            f"{url}/table.wsdl --operation GetAngle --processes 2",
            "--rate 60 --duration 2 --warmup 0.1 --username-token-file",
            user,
        )
    series = run.series("GetAngle", "soap")
    assert (series["count"] > 30, series["errors"]) == (True, 0), run.out + run.err
    assert len(device.seen) > series["count"], "it refuses a nonce that it has seen"
    assert PASSWORD not in run.out + run.err + json.dumps(run.result)


def test_two_devices_with_wsdls_take_turns(load):
    with contextlib.ExitStack() as stack:
        urls = [stack.enter_context(serving(camera())) for _ in range(2)]
        run = load(
            f"{urls[0]}/camera.wsdl --operation GetStatus --against {urls[1]} --rate 60 --duration 2 --warmup 0.1",
            "--tolerance 900%",
        )
    compared = run.result["against"]
    assert compared["robot"]["soap"] == urls[1]
    assert {(each["operation"], each["interface"]) for each in compared["changes"]} == {("GetStatus", "soap")}
    assert run.code == (0 if run.result["valid"] and compared["verdict"] == "not slower" else 4), run.out + run.err


def test_soap_beside_rest_is_compared_in_turns(robot, load, tmp_path):
    rest, soap = robot
    statement = tmp_path / "robot.toml"
    statement.write_text(
        f'[robot]\nname = "plain"\n[api]\nopenapi = "{rest}/openapi.json"\n'
        f'wsdl = "{soap}/turtlesim_subscriber_ws?wsdl"\n'
        "[load]\nmax_rate = 120\n"
        '[load.pairs]\nstate = { rest = "GET /robot/pose/", soap = "GetPose" }\n'
        "[slo]\nstate = { p50_ms = 9000 }\n"
    )
    run = load(str(statement), SHORT, "--seed 2")
    result = run.result
    assert [(each["operation"], each["interface"]) for each in result["series"]] == [
        ("state", "rest"),
        ("state", "soap"),
    ]
    assert all(each["count"] > 20 and not each["errors"] for each in result["series"]), run.out + run.err
    medians = [each for each in result["comparisons"] if each["quantile"] == "p50"]
    assert [(each["operation"], each["client"]) for each in medians] == [("state", "wire")]
    assert medians[0]["ratio"] > 0
    assert medians[0]["judgement"] in {"differs", "bounded", "noise", "none"}
    assert {each["interface"] for each in result["blocks"]} == {"rest", "soap"}
    assert {each["interface"] for each in result["noise_floor"]} == {"rest", "soap"}
    assert {(each["operation"], each["interface"]) for each in result["slo"]} == {("state", "rest"), ("state", "soap")}
    assert "the pair state is GET /robot/pose/ over REST and GetPose over SOAP" in result["notes"]
    assert not any("values over REST" in note for note in result["notes"]), "both return the same message"
    assert result["plan"]["description"] == f"{rest}/openapi.json and {soap}/turtlesim_subscriber_ws?wsdl"
    page = latency_html(result)
    assert "SOAP compared with REST" in page
    assert "the paper" not in page
    assert "SOAP / REST" in latency_markdown(result)
    assert "the paper" not in latency_markdown(result)
