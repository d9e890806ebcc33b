"""Start the parts of the robot that the command line selects.

Usually these are the simulation, as a child process, and the web services. With ``--attach`` only the web services
start, with ``--delivery-only`` only the delivery application.
"""

import contextlib
import logging
import os
import select
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import IO, Final

import click
import msgspec
from rclpy.logging import get_logging_directory

from conformance.commandline.endings import ending_signals
from conformance.commandline.exit_codes import ExitCode
from conformance.contract.toml_file import TomlFileError
from reference_robot.ending import Ending
from reference_robot.kinematics import DIFFERENTIAL, KINEMATICS
from reference_robot.ros import RosArgumentsError, RosRuntime
from reference_robot.simulation.delivery import Delivery, DeliveryRequests
from reference_robot.webservices.assembly import Endpoints
from reference_robot.webservices.configuration import Configuration, load_configuration
from reference_robot.webservices.endpoint import PortInUseError
from reference_robot.webservices.http.access import Authorization, TokenFileError, read_tokens
from reference_robot.webservices.http.hosts import is_loopback
from reference_robot.webservices.http.listening import (
    Listening,
    ListeningError,
    host_patterns,
    public_urls,
    require_guarded,
    trusted_proxies,
)
from reference_robot.webservices.http.server import TlsFileError, server_context
from reference_robot.webservices.runner import RobotNotFoundError, RobotWebServiceNodesRunner
from reference_robot.webservices.soap.subscribers import PUBLISHERS_PATH

_START: Final = 60.0  # seconds
_STOP: Final = 5.0  # seconds


class SimulationError(RuntimeError):
    """An error for a simulation that did not start or that ended unexpectedly."""


class SimulatedRobot:
    """A simulated robot that runs in a child process, which is monitored.

    Args:
        domain_id: The ROS domain.
        time_scale: How many times faster than real time the robot moves.
        config: The TOML file with the ROS names; None for the default names.
        realistic_seed: Seed of a robot with imperfect wheels and odometry; None for a perfect robot.
        log: The file for the simulation's log.
        ros_arguments: ROS arguments for the simulation's nodes.
        kinematics: The name of the robot's body.
    """

    def __init__(
        self,
        domain_id: int,
        time_scale: float,
        config: Path | None,
        realistic_seed: int | None,
        log: Path,
        ros_arguments: Sequence[str] = (),
        kinematics: str = DIFFERENTIAL,
    ) -> None:
        self._log = log
        self._command = [
            sys.executable,
            "-P",  # a module in the working directory is none of ours
            "-m",
            "reference_robot.simulation",
            f"--domain-id={domain_id}",
            f"--time-scale={time_scale}",
            f"--kinematics={kinematics}",
            *([f"--names={config}"] if config else []),
            *([] if realistic_seed is None else ["--realistic", f"--seed={realistic_seed}"]),
            *ros_arguments,
        ]
        self._ending = threading.Event()

    @contextlib.contextmanager
    def running(self) -> Iterator[None]:
        """Run the simulation during the block; if the simulation ends first, SIGTERM is sent to this process.

        Raises:
            SimulationError: The simulation did not become ready, or ended unexpectedly.
        """
        self._log.parent.mkdir(parents=True, exist_ok=True)
        with (
            self._log.open("w", encoding="utf-8") as log,
            subprocess.Popen(  # noqa: S603 - our own program, and arguments that click has checked
                self._command,
                stdin=subprocess.PIPE,  # closes when the parent ends, even if killed; the child notices
                stdout=subprocess.PIPE,
                stderr=log,
                start_new_session=True,  # so that Ctrl-C reaches the parent only, which then stops the child
            ) as process,
        ):
            try:
                assert process.stdout is not None  # noqa: S101 - tells mypy what PIPE means
                self._await_ready(process.stdout)
                watch = threading.Thread(target=self._watch, args=(process, process.stdout), daemon=True)
                watch.start()
                yield
                lost = process.poll() is not None
            finally:
                self._ending.set()
                _end(process)
        if lost:
            raise SimulationError(
                f"the simulation ended unexpectedly with exit code {process.returncode}; its log is {self._log}"
            )

    def _await_ready(self, stdout: IO[bytes]) -> None:
        give_up = time.monotonic() + _START
        output = b""
        while b"ready" not in output.split():
            readable, _, _ = select.select([stdout], [], [], max(0.0, give_up - time.monotonic()))
            data = os.read(stdout.fileno(), 4096) if readable else b""
            if not data:
                why = "ended" if readable else f"was not ready within {_START:g} s"
                raise SimulationError(f"the simulation {why}: {' '.join(self._command)}; its log is {self._log}")
            output += data

    def _watch(self, process: subprocess.Popen[bytes], stdout: IO[bytes]) -> None:
        while os.read(stdout.fileno(), 4096):
            pass  # a full pipe would stop the child
        process.wait()
        if not self._ending.is_set():
            os.kill(os.getpid(), signal.SIGTERM)


def _end(process: subprocess.Popen[bytes]) -> None:
    process.terminate()
    try:
        process.wait(_STOP)
    except subprocess.TimeoutExpired:
        process.kill()


_LOGGER: Final = logging.getLogger(__name__)
_DISCOVERY_RANGE: Final = "ROS_AUTOMATIC_DISCOVERY_RANGE"


class UnusableError(click.ClickException):
    """An error in an option, file or port that prevents the start; the message names it and the reason."""

    exit_code = ExitCode.USAGE


class RobotLostError(click.ClickException):
    """An error for a simulated robot that did not start or that ended unexpectedly."""

    exit_code = ExitCode.UNREACHABLE


@dataclass(frozen=True)
class Options:
    """The options of the command ``roaas robot``, as click parsed them (docs/cli.md)."""

    config: Path | None
    host: str
    rest_port: int
    soap_port: int
    domain_id: int
    time_scale: float
    token_file: Path | None
    insecure: bool
    tls_cert: Path | None
    tls_key: Path | None
    allowed_host: tuple[str, ...]
    public_url: tuple[str, ...]
    trusted_proxy: tuple[str, ...]
    attach: bool
    realistic: bool
    seed: int
    kinematics: str
    delivery_only: bool
    ros_arguments: tuple[str, ...]


def run(options: Options) -> None:
    """Run the robot until SIGINT, SIGTERM or another signal that ends the process.

    Raises:
        UnusableError: A file, port or address cannot be used.
        RobotLostError: The robot behind the web services did not start or has ended.
    """
    logging.basicConfig(stream=sys.stderr, level=logging.WARNING, format="%(levelname)s %(name)s: %(message)s")

    if options.delivery_only:
        _deliver(options)
        return

    def ready(endpoints: Endpoints) -> None:
        wsdl = f"{endpoints.soap}{PUBLISHERS_PATH}?wsdl"
        sys.stdout.write(f"ready rest={endpoints.rest} soap={wsdl} domain={options.domain_id}\n")
        sys.stdout.flush()

    try:
        configuration = _configuration(options)
        listening = _listening(options)
        RosRuntime(options.domain_id, options.ros_arguments).close()  # raises if the arguments are bad
        runner = RobotWebServiceNodesRunner(configuration, listening, options.domain_id, options.ros_arguments)
        with contextlib.suppress(_Stopped), _stopped_by_signals(), _simulation(options):
            runner.run(ready, wait_for_robot=not options.attach)
    except (TomlFileError, TokenFileError, TlsFileError, ListeningError, PortInUseError, RosArgumentsError) as error:
        raise UnusableError(str(error)) from error
    except (SimulationError, RobotNotFoundError) as error:
        raise RobotLostError(str(error)) from error


def _configuration(options: Options) -> Configuration:
    """Return the configuration from the file, with the limits of the simulated robot's body.

    Raises:
        TomlFileError: The file cannot be used.
        UnusableError: A body is selected where it would have no effect.
    """
    configuration = load_configuration(options.config)
    if options.kinematics != DIFFERENTIAL and (options.attach or options.realistic):
        raise UnusableError("--kinematics selects a simulated body: it excludes --attach and --realistic")
    web = msgspec.structs.replace(configuration.web, **KINEMATICS[options.kinematics].web)
    return msgspec.structs.replace(configuration, web=web)


def _listening(options: Options) -> Listening:
    """Return the network settings of the web services: addresses, tokens, host names, proxies and TLS.

    Raises:
        TokenFileError: The token file cannot be used.
        TlsFileError: The certificate or the key cannot be used.
        ListeningError: Another option is invalid, or would let anyone on the network drive the robot without a token.
    """
    authorization = Authorization(None if options.token_file is None else read_tokens(options.token_file))
    if not options.insecure:
        require_guarded(options.host, authorization)
    if (options.tls_cert is None) != (options.tls_key is None):
        raise ListeningError("give both --tls-cert and --tls-key: a server needs a certificate and its key")
    if authorization.is_required and options.tls_cert is None and not is_loopback(options.host):
        _LOGGER.warning("tokens are sent to --host %s unencrypted; --tls-cert and --tls-key encrypt them", options.host)
    return Listening(
        options.host,
        options.rest_port,
        options.soap_port,
        authorization,
        host_patterns(options.allowed_host),
        public_urls(options.public_url),
        trusted_proxies(options.trusted_proxy),
        server_context(options.tls_cert, options.tls_key) if options.tls_cert and options.tls_key else None,
    )


def _deliver(options: Options) -> None:
    """Run the delivery application until a signal ends it, for any robot that accepts NavigateToPose goals."""
    ending = Ending()
    try:
        names = load_configuration(options.config)
        with RosRuntime(options.domain_id, options.ros_arguments) as ros:
            Delivery(ros.create_node("delivery"), DeliveryRequests(ros, names), names)
            ros.start()
            sys.stdout.write(f"ready delivery={names.topics.delivery} domain={options.domain_id}\n")
            sys.stdout.flush()
            ending.wait()
    except (TomlFileError, RosArgumentsError) as error:
        raise UnusableError(str(error)) from error


class _Stopped(BaseException):
    """A signal that arrived while no event loop was running to handle it."""


@contextlib.contextmanager
def _stopped_by_signals() -> Iterator[None]:
    """Raise _Stopped on each signal that ends the process, so that what was started inside the block is cleaned up."""

    def stop(_number: int, _frame: FrameType | None) -> None:
        raise _Stopped

    for number in ending_signals():
        signal.signal(number, stop)
    yield


def _simulation(options: Options) -> contextlib.AbstractContextManager[None]:
    if options.attach:
        return contextlib.nullcontext()
    # The simulated robot is visible on this machine only, unless the environment says otherwise.
    os.environ.setdefault(_DISCOVERY_RANGE, "LOCALHOST")
    seed = options.seed if options.realistic else None
    log = get_logging_directory() / f"robot-{os.getpid()}.log"
    click.echo(f"The simulated robot's log is {log}", err=True)
    return SimulatedRobot(
        options.domain_id, options.time_scale, options.config, seed, log, options.ros_arguments, options.kinematics
    ).running()
