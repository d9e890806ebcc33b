"""The wire client calls a described device with each kind of credential."""

import json
import urllib.request

import msgspec
import pytest
from toy_api import PASSWORD, TOKEN, USER

from loadtests.clients.endpoint import Endpoint
from loadtests.clients.robot import Robot
from loadtests.clients.wire import Connection
from loadtests.described.device import CREDENTIALS, Device, Named, secrets_of
from loadtests.described.operations import chosen
from loadtests.described.requests import robot_of
from loadtests.measuring.preflight import preflight
from loadtests.settings.errors import SettingsError

NAMES = [("GET /state", "rest", "wire")]


def robot_at(port, options):
    given = {"overlays": (), "allow": (), "never": (), "allow_motion": False, "openapi": None, "wsdl": None}
    given |= {"base_url": None, "rest": None, "timeout_s": None}
    device = Device.at(Named(f"http://127.0.0.1:{port}/openapi.json", None), given | options)
    return robot_of(device, list(chosen(device, ["GET /state"]).weights))


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
    with urllib.request.urlopen(f"http://127.0.0.1:{port}/calls", timeout=5) as answer:
        return json.load(answer).get("refused", 0)


def test_credentials_that_cannot_be_used_are_refused(tmp_path):
    file = tmp_path / "secret"
    file.write_text("no pair")
    with pytest.raises(SettingsError, match="expected one line user:password"):
        secrets_of({"basic_file": str(file)})
