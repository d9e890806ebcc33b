"""Starts a whole robot: the simulation as a child process, unless a robot is there already, and the web services.

Or the delivery application alone.
"""

import contextlib
import logging
import os
import signal
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import Final

import click
from rclpy.logging import get_logging_directory

from conformance.commandline.exit_codes import ExitCode
from conformance.contract.toml_file import TomlFileError
from reference_robot.ending import Ending
from reference_robot.ros import RosArgumentsError, RosRuntime
from reference_robot.simulated import SimulatedRobot, SimulationError
from reference_robot.simulation.delivery import Delivery
from reference_robot.simulation.requests import DeliveryRequests
from reference_robot.webservices.assembly import Endpoints
from reference_robot.webservices.configuration import load_configuration
from reference_robot.webservices.endpoint import PortInUseError
from reference_robot.webservices.http.authorization import Authorization, TokenFileError, read_tokens
from reference_robot.webservices.http.hosts import is_loopback
from reference_robot.webservices.http.listening import (
    Listening,
    ListeningError,
    host_patterns,
    public_urls,
    require_guarded,
    trusted_proxies,
)
from reference_robot.webservices.http.tls import TlsFileError, server_context
from reference_robot.webservices.runner import RobotNotFoundError, RobotWebServiceNodesRunner
from reference_robot.webservices.soap.publishers import PATH as PUBLISHERS_PATH

_LOGGER: Final = logging.getLogger(__name__)
_DISCOVERY_RANGE: Final = "ROS_AUTOMATIC_DISCOVERY_RANGE"


class UnusableError(click.ClickException):
    """The robot cannot be started as asked: the message names the option, file or port, and what is wrong with it."""

    exit_code = ExitCode.USAGE


class RobotLostError(click.ClickException):
    """The simulated robot did not come up, or ended by itself."""

    exit_code = ExitCode.FAILED


@dataclass(frozen=True)
class Options:
    """What the command line says (cli.md)."""

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
    delivery_only: bool
    ros_arguments: tuple[str, ...]


def run(options: Options) -> None:
    """Run the robot until SIGINT or SIGTERM.

    Raises:
        UnusableError: A file, port or address cannot be used.
        RobotLostError: There is no robot (any more) behind the web services.
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
        configuration = load_configuration(options.config)
        listening = _listening(options)
        RosRuntime(options.domain_id, options.ros_arguments).close()  # whether ROS takes them, before anything starts
        runner = RobotWebServiceNodesRunner(configuration, listening, options.domain_id, options.ros_arguments)
        with contextlib.suppress(_Stopped), _stopped_by_signals(), _simulation(options):
            runner.run(ready, wait_for_robot=not options.attach)
    except (TomlFileError, TokenFileError, TlsFileError, ListeningError, PortInUseError, RosArgumentsError) as error:
        raise UnusableError(str(error)) from error
    except (SimulationError, RobotNotFoundError) as error:
        raise RobotLostError(str(error)) from error


def _listening(options: Options) -> Listening:
    """Return how the robot is reached.

    Raises:
        TokenFileError: The token file cannot be used.
        TlsFileError: Certificate or key cannot be used.
        ListeningError: Another option cannot be used, or lets strangers drive the robot.
    """
    authorization = Authorization(None if options.token_file is None else read_tokens(options.token_file))
    if not options.insecure:
        require_guarded(options.host, authorization)
    if (options.tls_cert is None) != (options.tls_key is None):
        raise ListeningError("--tls-cert and --tls-key go together: a server needs a certificate and its key")
    if authorization.is_asked_for and options.tls_cert is None and not is_loopback(options.host):
        _LOGGER.warning("tokens travel in the clear to --host %s: --tls-cert and --tls-key hide them", options.host)
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
    """Run the delivery application until SIGINT or SIGTERM: it drives whatever robot takes NavigateToPose goals."""
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
    """A signal came while no event loop was there to take it."""


@contextlib.contextmanager
def _stopped_by_signals() -> Iterator[None]:
    """Let SIGINT and SIGTERM unwind what has been started so far."""

    def stop(_number: int, _frame: FrameType | None) -> None:
        raise _Stopped

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, stop)
    yield


def _simulation(options: Options) -> contextlib.AbstractContextManager[None]:
    if options.attach:
        return contextlib.nullcontext()
    # A simulated robot is no affair of other machines on the network, unless the environment says so.
    os.environ.setdefault(_DISCOVERY_RANGE, "LOCALHOST")
    seed = options.seed if options.realistic else None
    log = get_logging_directory() / f"robot-{os.getpid()}.log"
    click.echo(f"The simulated robot's log is {log}", err=True)
    return SimulatedRobot(
        options.domain_id, options.time_scale, options.config, seed, log, options.ros_arguments
    ).running()
