"""The reference robot beside hostile clients: whoever may command it can stop it within a moment.

Each attack is a row of `ATTACKS`. The robot is `roaas robot` on real ROS; the clients are processes of their own.
"""

import json
import ssl
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path

import httpx
import pytest
from web_certificate import pair
from web_robot import ForeignRobot, Served, eventually, running_robot

MOMENT = 8.0  # seconds; without limits, clients were locked out for 10 to 60 s
TOKEN = "d5b7f4e2e0b1c9e0"  # noqa: S105 - of this test alone
REST = {"linear": {"x": 0, "y": 0, "z": 0}, "angular": {"x": 0, "y": 0, "z": 0}}
GET = b"GET /robot/pose/ HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n"
BODY = b"PUT /robot/velocity/ HTTP/1.1\r\nHost: a\r\nContent-Type: application/json\r\n"


@dataclass(frozen=True)
class Attack:
    """What a hostile client does: on each connection it sends `first`, and `more` five times a second."""

    robot: str
    first: bytes = b""
    more: bytes = b""
    tls: bool = False
    reads: bool = True
    count: int = 3850
    address: str = "127.0.0.1"


ATTACKS = {
    "idle": Attack("open"),
    "idle, from another address": Attack("open", address="127.0.0.2"),
    "a head that never ends": Attack("open", b"GET / HTTP/1.1\r\n", b"X: a\r\n"),
    "a body that never ends": Attack("open", BODY + b"Content-Length: 9000\r\n\r\n", b"x"),
    "memory for heads": Attack("open", b"GET / HTTP/1.1\r\nX: " + b"x" * 60_000, count=1300),
    "memory for bodies": Attack("open", BODY + b"Content-Length: 90000\r\n\r\n" + b"x" * 80_000, count=1000),
    "responses that nobody reads": Attack("open", GET * 100, GET * 100, reads=False, count=600),
    "many requests at once": Attack("open", GET * 1000, GET * 1000, count=60),
    "one request, then idle": Attack("open", GET),
    "idle, with tokens": Attack("tokens"),
    "requests without a token": Attack("tokens", GET, GET, count=2000),
    "TCP without TLS": Attack("TLS", count=700),
    "half a TLS greeting": Attack("TLS", b"\x16\x03\x01", count=700),
    "TLS, then idle": Attack("TLS", tls=True, count=700),
    "TLS, then requests without a token": Attack("TLS", GET, GET, tls=True, count=300),
}


@pytest.fixture(scope="module")
def foreign(module_domain_id: int) -> Iterator[ForeignRobot]:
    with ForeignRobot(module_domain_id, "Twist") as robot:
        yield robot


@pytest.fixture(scope="module")
def robots(
    module_domain_id: int, foreign: ForeignRobot, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[dict[str, Served]]:
    """The same robot behind web services without tokens, with tokens, and with tokens and TLS."""
    assert foreign.process.poll() is None
    folder = tmp_path_factory.mktemp("robot")
    certificate, key = pair(folder, "robot")
    tokens = folder / "tokens"
    tokens.touch(0o600)
    tokens.write_text(f"{TOKEN}\n")
    tls = [f"--tls-cert={certificate}", f"--tls-key={key}"]
    options = {"open": [], "tokens": [f"--token-file={tokens}"], "TLS": [f"--token-file={tokens}", *tls]}
    with ExitStack() as stack:
        served = {}
        for name, given in options.items():
            trusted = ssl.create_default_context(cafile=str(certificate))
            robot = running_robot(module_domain_id, "--attach", "--allowed-host=a", *given, verify=trusted)
            served[name] = stack.enter_context(robot)
            served[name].client.headers["Authorization"] = f"Bearer {TOKEN}"
            eventually(lambda name=name: served[name].call("GET", "/robot/pose/").status_code == 200)
            eventually(lambda name=name: served[name].call("PUT", "/robot/velocity/", json=REST).status_code == 200)
        yield served


@contextmanager
def under(attack: Attack, robot: Served) -> Iterator[None]:
    given = asdict(attack) | {"port": int(robot.rest.rpartition(":")[2])}
    given |= {"first": attack.first.hex(), "more": attack.more.hex()}
    del given["robot"]
    command = [sys.executable, str(Path(__file__).with_name("crowding_client.py"))]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as client:
        try:
            client.stdin.write(json.dumps(given) + "\n")
            client.stdin.flush()
            assert client.stdout.readline() == "up\n"
            yield
        finally:
            client.kill()


def stopped_by_a_new_client(robot: Served, verify: ssl.SSLContext) -> float:
    """Stop the robot and cancel its goal on new connections; return the seconds that this took."""
    began = time.monotonic()
    with httpx.Client(verify=verify, timeout=60, headers={"Authorization": f"Bearer {TOKEN}"}) as client:
        stopped = client.put(f"{robot.rest}/robot/velocity/", json=REST)
        assert stopped.status_code == 200, stopped.text
        cancelled = client.delete(f"{robot.rest}/robot/navigation/action/goal/")
        assert cancelled.status_code in {204, 404, 409}, cancelled.text
    return time.monotonic() - began


@pytest.mark.parametrize("attack", ATTACKS.values(), ids=ATTACKS)
def test_whoever_may_command_the_robot_can_stop_it(robots, attack):
    robot = robots[attack.robot]
    verify = robot.client._transport._pool._ssl_context  # noqa: SLF001 - made for this robot's certificate
    with under(attack, robot):
        took = [stopped_by_a_new_client(robot, verify) for _ in range(3)]
    assert max(took) < MOMENT


@pytest.mark.parametrize("name", ["idle, from another address", "idle, with tokens", "TLS, then idle"])
def test_who_has_shown_a_token_or_comes_from_elsewhere_keeps_the_connection(robots, name):
    attack = ATTACKS[name]
    robot = robots[attack.robot]
    with robot.client.stream("GET", f"{robot.rest}/robot/pose/") as before:
        kept = before.extensions["network_stream"].get_extra_info("client_addr")
        before.read()
    with under(attack, robot), robot.client.stream("PUT", f"{robot.rest}/robot/velocity/", json=REST) as answer:
        assert answer.status_code == 200
        assert answer.extensions["network_stream"].get_extra_info("client_addr") == kept
