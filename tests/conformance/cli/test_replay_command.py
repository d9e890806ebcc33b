"""``roaas replay`` sends a finding's requests again, in order, and says whether it is still there."""

import asyncio
import base64
import json
import threading
import time
import zlib

import pytest
from aiohttp import web
from click.testing import CliRunner
from small_device import described, reading, small_device
from toy_server import Handler, server_of

from conformance.contract.pack import Contract
from conformance.engine.permission import moves
from conformance.engine.replay import Outcome, longest_s, replay
from conformance.engine.resending import as_json, read_request
from conformance.transport.client import Connection
from conformance.transport.exchange import Request
from conformance.verdict.finding import Sent
from roaas import main


class _Handler(Handler):
    """Answers 500 to a GET that follows a PUT, until it is repaired."""

    def answer(self):
        body = self.content()
        broken = self.command == "GET" and not self.server.repaired and self.server.asked[-1:] != []
        self.server.asked.append((self.command, self.path, body, self.headers.get("Authorization")))
        if self.path == "/robot/pose/":
            # Without Date until it is repaired, and always of one kind.
            send = self.send_response if self.server.repaired else self.send_response_only
            send(406)
            self.send_header("Content-Length", "0")
        else:
            self.send_response(500 if broken else 204)
        self.end_headers()


@pytest.fixture(name="robot")
def _robot():
    with server_of(_Handler, asked=[], repaired=False) as server:
        yield server


def _result(tmp_path, base, methods=("PUT", "GET")):
    token = ("Authorization", "Bearer $ROAAS_TOKEN")
    sent = [
        Sent(
            10.0 + 0.01 * index,
            Request(method, f"{base}/a?b=%20", (("Host", "x"), token), b"\x00body" if method == "PUT" else b""),
        )
        for index, method in enumerate(methods)
    ]
    failure = {"message": "status 500", "response": {"status": 500, "headers": {}, "body": None}}
    found = [{"id": "http/declared-status", "failures": [failure | {"sequence": as_json(sent)}]}]
    return _written(tmp_path, [*found, {"id": "http/head", "failures": []}], target={"subscribers_endpoint": None})


def _written(tmp_path, requirements, **more):
    document = {
        "format": "roaas-result/1",
        "suite": {"contract": Contract.load().version},
        "requirements": requirements,
    }
    (tmp_path / "result.json").write_text(json.dumps(document | more), encoding="utf-8")
    return str(tmp_path)


def _replay(*arguments):
    return CliRunner().invoke(main, ["replay", *arguments])


def test_a_finding_is_still_there_until_it_is_repaired(robot, tmp_path):
    (tmp_path / "token").write_text("sesame\n", encoding="utf-8")
    result = _result(tmp_path, robot.url)
    base = f"HTTP://127.0.0.1:{robot.server_port}/elsewhere"
    arguments = (result, "--allow-motion", "--token-file", str(tmp_path / "token"), "--token-for", base)
    there = _replay(*arguments)
    assert (there.exit_code, there.output.split(":")[0]) == (1, "still there")
    assert robot.asked == [("PUT", "/a?b=%20", b"\x00body", "Bearer sesame"), ("GET", "/a?b=%20", b"", "Bearer sesame")]
    robot.repaired = True
    gone = _replay(*arguments, "http/declared-status")
    assert (gone.exit_code, gone.output.split(":")[0]) == (0, "gone")


def test_what_an_answer_shows_by_itself_is_judged_as_in_the_run(robot, tmp_path):
    base = robot.url
    request = Request("GET", f"{base}/robot/pose/", (("Host", "x"), ("Accept", "image/png")))
    response = {"status": 406, "headers": {"Content-Length": "0"}, "body": None}
    failure = {"message": "Date: None", "response": response, "sequence": as_json([Sent(0.0, request)])}
    found = [{"id": "http/date", "failures": [failure]}]
    _written(tmp_path, found, target={"rest": base}, seed=0, effort="quick")
    (tmp_path / "robot.toml").write_text(f'[endpoints]\nrest = "{base}"\n', encoding="utf-8")
    (tmp_path / "token").write_text("sesame", encoding="utf-8")
    by_checks = (str(tmp_path), "--statement", str(tmp_path / "robot.toml"), "--token-file", str(tmp_path / "token"))
    there, checked = _replay(str(tmp_path)), _replay(*by_checks)
    assert (there.exit_code, checked.exit_code) == (1, 1)
    assert "judged as in the run" in there.output
    assert "still there: http/date: " in checked.output
    assert robot.asked[-1][3] == "Bearer sesame"
    robot.repaired = True
    gone, checked = _replay(str(tmp_path)), _replay(*by_checks)
    assert (gone.exit_code, checked.exit_code) == (0, 0), (gone.output, checked.output)
    assert "judged as in the run" in gone.output
    assert "gone: http/date: passed" in checked.output


def test_what_moves_the_robot_asks_first(robot, tmp_path):
    refused = _replay(_result(tmp_path, robot.url))
    assert (refused.exit_code, robot.asked) == (2, [])
    assert "--allow-motion" in refused.output


@pytest.mark.parametrize(
    "others", [[], ["http://127.0.0.1:1"], ["http://localhost:{port}"], ["https://127.0.0.1:{port}"]]
)
def test_the_token_goes_to_no_address_that_the_user_did_not_name(robot, tmp_path, others):
    (tmp_path / "token").write_text("sesame", encoding="utf-8")
    result = _result(tmp_path, robot.url, ("GET",))
    trusted = [part for url in others for part in ("--token-for", url.format(port=robot.server_port))]
    refused = _replay(result, "--token-file", str(tmp_path / "token"), *trusted)
    assert (refused.exit_code, robot.asked) == (2, [])
    assert f"--token-for http://127.0.0.1:{robot.server_port}" in refused.output


def _moves(method="GET", headers=(), body=b"", raw=None, path="/"):
    (item,) = as_json([Sent(0.0, Request(method, f"http://r2{path}", headers, body, raw))])
    return moves({"sequence": [item]})


def _soap(operation):
    inside = f'<t:{operation} xmlns:t="http://soap.turtlebot.mybot.org/"/>'
    return f'<e:Envelope xmlns:e="http://schemas.xmlsoap.org/soap/envelope/"><e:Body>{inside}</e:Body></e:Envelope>'.encode()


def test_what_moves_is_told_by_what_is_sent():
    reading = "/turtlesim_subscriber_ws"
    assert not any((_moves(), _moves("HEAD"), _moves("POST", body=_soap("GetPose"), path=reading)))
    assert _moves(headers=(("X-HTTP-Method-Override", "PUT"),))
    assert _moves("POST", body=_soap("ExecuteDeliveryRequest"), path=reading)
    assert _moves("POST", body=_soap("GetPose").replace(b"</e:Body>", b"<x/></e:Body>"), path=reading)
    assert _moves("POST", body=b"<", path=reading)
    assert _moves("POST", body=_soap("GetPose"), path="/start")


@pytest.mark.parametrize(
    "part",
    [
        {"method": "GET / HTTP/1.1\r\nPUT"},
        {"url": "http://r2/ HTTP/1.1\r\nPUT /"},
        {"url": "file:///etc/passwd"},
        {"headers": [["A", "b\r\nX: y"]]},
        {"headers": [["A\r\nX", "y"]]},
        {"body": base64.b64encode(zlib.compress(bytes(26 * 1024 * 1024), 1)).decode()},
        {"body": base64.b64encode(zlib.compress(b"whole")[:-2]).decode()},
        {"body": base64.b64encode(b"no deflate").decode()},
    ],
)
def test_a_sequence_that_no_run_wrote_is_refused(part):
    (item,) = as_json([Sent(0.0, Request("GET", "http://r2/"))])
    with pytest.raises(ValueError, match=r"cannot be a part|cut short|Error -3"):
        read_request({**item, **part})


@pytest.mark.parametrize("requirement", ["http/head", "http/no-such"])
def test_a_requirement_without_findings_is_wrong_usage(tmp_path, requirement):
    done = _replay(_result(tmp_path, "http://127.0.0.1:1"), requirement)
    assert (done.exit_code, requirement in done.output) == (2, True)


def test_a_robot_that_is_not_there(tmp_path):
    done = _replay(_result(tmp_path, "http://127.0.0.1:1", ("GET",)))
    assert (done.exit_code, done.output.split(":")[0]) == (4, "cannot tell")


@pytest.mark.parametrize("body", [b"", b"\xff\x00", b" " * 10_000_000])
def test_a_request_is_read_as_it_was_written(body):
    request = Request("PUT", "http://r2/", (("A", "b"),), body, b"RAW" if not body else None)
    (item,) = as_json([Sent(3.0, request)])
    assert (item["at_s"], read_request(item)) == (0.0, request)


class _Silent(Handler):
    """Never answers."""

    def answer(self):
        self.server.asked.append(self.path)
        self.server.over.wait()


@pytest.mark.parametrize("at_s", [0.0, 1e9, 1e308, -1e9])
def test_a_replay_ends_when_its_time_is_over(at_s):
    over = threading.Event()
    with server_of(_Silent, asked=[], over=over) as device:
        sequence = [item | {"at_s": at_s} for item in as_json([Sent(0.0, Request("GET", device.url, (), b""))] * 500)]
        failure = {"message": "status 500", "response": {"status": 500}, "sequence": sequence}
        began = time.monotonic()
        came = replay("http/x", failure, Connection(timeout_s=0.05), until=began + 1)
        over.set()
    assert (came.outcome, came.why.startswith("the time of the replay was over before ")) == (Outcome.UNKNOWN, True)
    assert len(device.asked) < 500
    assert time.monotonic() - began < 20


def test_checks_that_run_again_end_when_their_time_is_over(tmp_path):
    asked = []

    async def slow(request):
        asked.append(request.path)
        await asyncio.sleep(0.3)
        return web.json_response({})

    paths = [f"/parts/{number}" for number in range(40)]
    described_paths = described({path: reading({"type": "object"}) for path in paths})
    with small_device(described_paths, {path: {"GET": slow} for path in paths}) as url:
        (tmp_path / "robot.toml").write_text(f'[api]\nopenapi = "{url}/openapi.json"\n', encoding="utf-8")
        failure = {"number": 1, "message": "no", "response": None, "sequence": []}
        found = [{"id": "description/body-schema", "failures": [failure]}]
        _written(tmp_path, found, target={"rest": url}, seed=0, effort="standard")
        began = time.monotonic()
        came = _replay(str(tmp_path), "--statement", str(tmp_path / "robot.toml"), "--minutes", "0.05")
    assert came.exit_code == 4, came.output
    assert came.output.startswith("not judged: description/body-schema: not seen: the time of --minutes 0.05 was over")
    assert len(asked) < 40, "each of the operations is sent several requests"
    assert time.monotonic() - began < 60


def test_the_time_of_a_replay_grows_with_its_requests_and_has_an_end():
    """A result of somebody else may have any number of requests, and any pause between them."""
    few, many, endless = (
        [("http/x", {"sequence": [{"at_s": pause * place} for place in range(count)]})]
        for count, pause in ((1, 0.0), (100, 3.0), (1_000_000, 1e9))
    )
    assert longest_s(few) == 62
    assert longest_s(many) == 60 + 200 + 297
    assert longest_s(endless) == 1800
