"""The wire client calls a described device with each kind of credential."""

import json
import urllib.request
from dataclasses import replace
from datetime import timedelta

import msgspec
import pytest
import soap_devices
from toy_api import PASSWORD, TOKEN, USER

from loadtests.clients.endpoint import Endpoint
from loadtests.clients.robot import Robot, Secrets, with_secrets, without_secrets
from loadtests.clients.wire import Connection
from loadtests.described.device import CREDENTIALS, Device, Named, secrets_of
from loadtests.described.operations import choose, robot_of
from loadtests.measuring.preflight import preflight
from loadtests.settings.settings import SettingsError

NAMES = [("GET /state", "rest", "wire")]


OPTIONS = {"overlays": (), "allow": (), "never": (), "allow_motion": False, "openapi": None, "wsdl": None}
OPTIONS |= {"base_url": None, "rest": None, "timeout_s": None}


def robot_at(port, options):
    device = Device.at(Named(f"http://127.0.0.1:{port}/openapi.json", None), OPTIONS | options)
    return robot_of(device, list(choose(device, ["GET /state"]).weights))


def as_another_process_has_it(robot):
    """The process that measures gets the robot as JSON, and no challenge with it."""
    return msgspec.json.decode(msgspec.json.encode(robot), type=Robot)


@pytest.mark.parametrize(
    ("kind", "option", "content"),
    [
        ("bearer", "token_file", TOKEN),
        ("basic", "basic_file", f"{USER}:{PASSWORD}"),
        ("header", "headers_file", f"X-Robot-Key: {TOKEN}"),
        ("digest", "digest_file", f"{USER}:{PASSWORD}"),
    ],
)
def test_each_credential_is_sent(started, tmp_path, kind, option, content):
    _, port = started("toy_api.py", "--auth", kind)
    file = tmp_path / "secret"
    file.write_text(content)
    robot = as_another_process_has_it(robot_at(port, {option: str(file)}))
    findings = preflight(robot, NAMES, 1)
    assert findings.failures == {}
    assert content not in repr(robot)
    refused = preflight(robot_at(port, {}), NAMES, 1)
    assert "status 401" in refused.messages()[0]
    secrets = secrets_of(dict.fromkeys(CREDENTIALS) | {option: str(file)})
    assert (secrets.token, secrets.credentials) == (TOKEN if kind == "bearer" else None, robot.credentials)


def test_a_challenge_of_digest_authentication_is_answered_once_for_all_connections(started, tmp_path):
    _, port = started("toy_api.py", "--auth", "digest")
    file = tmp_path / "secret"
    file.write_text(f"{USER}:{PASSWORD}")
    robot = as_another_process_has_it(robot_at(port, {"digest_file": str(file)}))
    (request, *_) = robot.requests("rest", "GET /state", 1)
    before = refusals(port)
    for _ in range(3):
        connection = Connection(Endpoint.parse(f"http://127.0.0.1:{port}"), 5.0, None, robot.digest)
        answers = [connection.call(request).status for _ in range(2)]
        connection.close()
        assert answers == [200, 200]
    assert refusals(port) == before + 1, "one challenge serves all connections of a process"


def refusals(port):
    with urllib.request.urlopen(f"http://127.0.0.1:{port}/calls", timeout=60) as answer:
        return json.load(answer).get("refused", 0)


@pytest.mark.parametrize("clock", [timedelta(), timedelta(hours=1)])
def test_each_message_has_a_username_token_of_its_own(tmp_path, clock):
    file = tmp_path / "user"
    file.write_text(f"{soap_devices.USER}:{soap_devices.PASSWORD}")
    (names, device) = [("GetAngle", "soap", "wire")] * 3, soap_devices.table()
    with soap_devices.serving(device) as url:
        opened = Device.at(Named(f"{url}/table.wsdl", None), OPTIONS | {"username_token_file": str(file)})
        robot = robot_of(opened, list(choose(opened, ["GetAngle"]).weights))
        robot = replace(robot, username_token=replace(robot.username_token, ahead=clock))
        assert soap_devices.PASSWORD not in repr(robot)
        assert b"$WSSE_NONCE<" in robot.described[0].octets[0]
        assert preflight(as_another_process_has_it(robot), names, 1).failures == {}
        assert len(device.seen) == 1 + len(names), "the device refuses a nonce that it has seen"
        given = secrets_of(dict.fromkeys(CREDENTIALS) | {"username_token_file": str(file)})
        assert soap_devices.PASSWORD not in json.dumps(msgspec.to_builtins(without_secrets(robot)))
        worker = with_secrets(without_secrets(robot), given)
        assert worker.username_token == robot.username_token, "with the device's clock, which the master has read"
        assert preflight(worker, names[:1], 1).failures == {}
        with pytest.raises(ValueError, match="credentials that this worker lacks"):
            with_secrets(without_secrets(robot), Secrets())


def test_credentials_that_cannot_be_used_are_refused(tmp_path):
    file = tmp_path / "secret"
    file.write_text("no pair")
    with pytest.raises(SettingsError, match="expected one line user:password"):
        secrets_of({"basic_file": str(file)})
