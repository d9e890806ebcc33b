"""Start a web server in front of a robot, with one port for REST and one for SOAP, and stop it."""

import contextlib
import socket
import string
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from urllib.parse import urlsplit

from proof.mutation.self_test import build, program
from proof.selftest.robots import Robot, RobotError, stop_after

_HERE = Path(__file__).parent
_START_S = 20.0


@dataclass(frozen=True)
class Ports:
    """The loopback ports on which a web server listens, and the robot behind it."""

    rest: int
    soap: int
    robot: Robot

    def values(self, folder: Path) -> dict[str, str]:
        """Return the values of the variables in a server's configuration; without SOAP both ports lead to REST."""
        wsdl = self.robot.publishers or self.robot.subscribers
        rest, soap = (urlsplit(url).netloc for url in (self.robot.rest, wsdl or self.robot.rest))
        return {
            "rest": str(self.rest),
            "soap": str(self.soap),
            "robot_rest": f"http://{rest}",
            "robot_soap": f"http://{soap}",
            "robot_rest_authority": rest,
            "robot_soap_authority": soap,
            "folder": str(folder),
        }


@dataclass(frozen=True)
class Front:
    """A web server that can stand in front of a robot.

    Attributes:
        name: its name.
        says: a short description.
        command: returns the command that starts the server in the foreground, from the ports and a folder of its own;
            raises NotInstalledError where the server is not installed.
        breaks: requirements that the server itself breaks with default settings, whatever is behind it.
    """

    name: str
    says: str
    command: Callable[[Ports, Path], list[str]]
    breaks: frozenset[str] = frozenset()


def _nginx(ports: Ports, folder: Path) -> list[str]:
    configuration = _write("nginx.conf", folder, ports.values(folder))
    return [program("nginx", "nginx"), "-p", str(folder), "-c", configuration, "-g", "daemon off;"]


def _haproxy(ports: Ports, folder: Path) -> list[str]:
    return [program("haproxy", "haproxy"), "-db", "-f", _write("haproxy.cfg", folder, ports.values(folder))]


def _apache(ports: Ports, folder: Path) -> list[str]:
    server = program("apache2", "apache2")
    values = ports.values(folder) | {"modules": "/usr/lib/apache2/modules"}
    return [server, "-DFOREGROUND", "-f", _write("httpd.conf", folder, values)]


def _go(ports: Ports, folder: Path) -> list[str]:
    values = ports.values(folder)
    rest, soap = (f"127.0.0.1:{port}" for port in (ports.rest, ports.soap))
    return [str(build(_HERE / "reverse_proxy.go")), rest, values["robot_rest"], soap, values["robot_soap"]]


def _write(template: str, folder: Path, values: dict[str, str]) -> str:
    text = string.Template((_HERE / template).read_text(encoding="utf-8")).substitute(values)
    (folder / template).write_text(text, encoding="utf-8")
    return str(folder / template)


FRONTS = (
    Front("nginx", "behind nginx", _nginx),
    # haproxy merges two equal Host lines, where RFC 9112 3.2 demands 400.
    Front("haproxy", "behind haproxy", _haproxy, frozenset({"web-server/host-missing"})),
    Front("apache", "behind Apache httpd", _apache),
    Front("go-reverse-proxy", "behind Go's httputil.ReverseProxy", _go),
    Front("nginx-http10", "HTTP/1.0 behind nginx", _nginx),
)


@contextlib.contextmanager
def behind(front: Front, robot: Robot) -> Iterator[Robot]:
    """Start a web server in front of a robot; yield the robot with the server's addresses.

    Raises:
        NotInstalledError: the server is not installed.
        RobotError: the server does not start.
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        # A server started by root runs its workers as nobody, who needs access to the files.
        folder.chmod(0o755)
        ports = Ports(*_two_free_ports(), robot)
        log = folder / "output.log"
        with log.open("wb") as output:
            # Made above, of a program that was found and a configuration of ours.
            process = subprocess.Popen(front.command(ports, folder), stdout=output, stderr=output)  # noqa: S603
        with stop_after(process):
            for port in (ports.rest, ports.soap):
                _await(port, process, front.name, log)
            publishers, subscribers = (
                url and urlsplit(url)._replace(netloc=f"127.0.0.1:{ports.soap}").geturl()
                for url in (robot.publishers, robot.subscribers)
            )
            rest = f"http://127.0.0.1:{ports.rest}"
            yield replace(robot, rest=rest, publishers=publishers, subscribers=subscribers)


def _two_free_ports() -> tuple[int, int]:
    with socket.create_server(("127.0.0.1", 0)) as rest, socket.create_server(("127.0.0.1", 0)) as soap:
        return rest.getsockname()[1], soap.getsockname()[1]


def _await(port: int, process: subprocess.Popen[bytes], name: str, log: Path) -> None:
    until = time.monotonic() + _START_S
    while process.poll() is None and time.monotonic() < until:
        with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", port), timeout=1):
            return
        time.sleep(0.02)
    said = log.read_text(encoding="utf-8", errors="replace").strip()[-300:]
    raise RobotError(f"the server {name!r} does not start: {said or 'it says nothing'}")
