"""Start the gateways: each is a process of its own, the one on Node with its bridge."""

import json
import os
import socket
import subprocess
import sys
import time
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from subprocess import DEVNULL

import httpx
from processes import free_port

_GATEWAYS = Path(__file__).parent / "gateways"
_STARTS_S = 60.0
_STATEMENT = """[robot]
name = "gateway on {style}"

[api]
openapi = "{url}/openapi.json"

"""


@contextmanager
def gateway(style: str, domain_id: int, folder: Path, faults: Iterable[str] = ()) -> Iterator[Path]:
    """Start a gateway, and yield its statement.

    Args:
        style: its name in `surface.STYLES`.
        domain_id: the ROS domain.
        folder: where its statement is written.
        faults: what it does wrong.
    """
    environment = os.environ | {
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "ROS_STATIC_PEERS": "127.0.0.1",
        "FASTDDS_BUILTIN_TRANSPORTS": "UDPv4",
    }
    if style == "rosbridge":
        yield from _bridge(domain_id, folder, ",".join(faults), environment)
        return
    subprocess.run([sys.executable, _GATEWAYS / "surface.py", style, str(domain_id), folder], check=True)
    port, bridge = free_port(), free_port()
    script = "rosbridge.py" if style == "node" else f"on_{style}.py"
    python = [sys.executable, _GATEWAYS / script, bridge if style == "node" else port, domain_id, ",".join(faults)]
    node = ["node", "--experimental-websocket", _GATEWAYS / "over_rosbridge.js", port, bridge]
    commands = [python] + ([[*node, folder / "surface.json", ",".join(faults)]] if style == "node" else [])
    url = f"http://127.0.0.1:{port}"
    with ExitStack() as stack:
        for command in commands:
            process = subprocess.Popen([*map(str, command)], env=environment, stdout=DEVNULL, stderr=DEVNULL)
            stack.callback(process.wait)
            stack.callback(process.kill)
        _await(url + json.loads((folder / "surface.json").read_text())["topics"])
        statement = folder / "statement.toml"
        statement.write_text(_STATEMENT.format(style=style, url=url) + (folder / "ros.toml").read_text())
        yield statement


def _bridge(domain_id: int, folder: Path, faults: str, environment: dict[str, str]) -> Iterator[Path]:
    """Start the rosbridge alone, and yield its statement."""
    port = free_port()
    url = f"ws://127.0.0.1:{port}"
    command = [sys.executable, _GATEWAYS / "rosbridge.py", str(port), str(domain_id), faults]
    with subprocess.Popen([*map(str, command)], env=environment, stdout=DEVNULL, stderr=DEVNULL) as process:
        try:
            until = time.monotonic() + _STARTS_S
            while True:
                with suppress(OSError), socket.create_connection(("127.0.0.1", port), timeout=5):
                    break
                assert time.monotonic() < until, f"the rosbridge at {url} does not start"
                time.sleep(0.05)
            statement = folder / "statement.toml"
            statement.write_text(f'[robot]\nname = "rosbridge"\n\n{_map(url, domain_id)}', encoding="utf-8")
            yield statement
        finally:
            process.kill()


def _map(url: str, domain_id: int) -> str:
    code = f"import surface; print(surface.bridge_map({url!r}, {domain_id}))"
    return subprocess.check_output([sys.executable, "-c", code], cwd=_GATEWAYS, text=True)


def _await(url: str) -> None:
    """Wait until a gateway responds, and so does what is behind it."""
    until = time.monotonic() + _STARTS_S
    while True:
        with suppress(httpx.HTTPError):
            if httpx.get(url, timeout=5).is_success:
                return
        assert time.monotonic() < until, f"the gateway at {url} does not start"
        time.sleep(0.05)
