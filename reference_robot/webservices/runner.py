"""RobotWebServiceNodesRunner (paper): starts and stops the ROS nodes and the endpoints."""

import asyncio
import contextlib
import gc
import os
import resource
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import uvloop

from conformance.commandline.endings import ending_signals
from reference_robot.ros import RosRuntime
from reference_robot.webservices.assembly import Endpoints, interfaces
from reference_robot.webservices.configuration import Configuration, WebSettings
from reference_robot.webservices.endpoint import EndpointPublisher, bound
from reference_robot.webservices.http.hosts import url_of
from reference_robot.webservices.http.listening import Listening
from reference_robot.webservices.http.port import Limits
from reference_robot.webservices.nodes.publishers import RobotPublishersNode
from reference_robot.webservices.nodes.subscribers import RobotSubscribersNode

_DESCRIPTORS: Final = 8192  # connections and ROS together; the usual soft limit of 1,024 is soon reached
_OTHER_DESCRIPTORS: Final = 592  # for ROS, files, and connections that are being refused
_CONNECTIONS: Final = 3800  # per interface
_TLS_CONNECTIONS: Final = 600  # per interface; each takes 280 kB once used
_DISCOVERY: Final = 20.0  # seconds in which a robot that has been started must appear on the graph
_DISCOVERY_STEP: Final = 0.05


class RobotNotFoundError(RuntimeError):
    """An error for a robot that was started but did not appear on the ROS graph."""


@dataclass(frozen=True)
class RobotWebServiceNodesRunner:
    """The web services of one robot with their ROS nodes; ``ros_arguments`` are passed to these nodes."""

    configuration: Configuration
    listening: Listening
    domain_id: int | None
    ros_arguments: Sequence[str] = ()

    def run(self, ready: Callable[[Endpoints], None], *, wait_for_robot: bool) -> None:
        """Serve until a signal ends the process; call ``ready`` once, when both interfaces accept requests.

        Raises:
            PortInUseError: A port cannot be bound.
            RobotNotFoundError: ``wait_for_robot`` is set and no robot appeared in time.
        """
        configuration, listening = self.configuration, self.listening
        descriptors = _raised_descriptor_limit()
        # This is Fast DDS's default, and overrides a user's setting. In asynchronous mode each publish waits for a lock
        # of the sender's thread, which delays one response in ten by 3 ms. Other middleware ignores the variable.
        os.environ["RMW_FASTRTPS_PUBLICATION_MODE"] = "SYNCHRONOUS"
        host = listening.host
        with (
            bound(host, listening.rest_port) as rest,
            bound(host, listening.soap_port) as soap,
            RosRuntime(self.domain_id, self.ros_arguments) as ros,
        ):
            endpoints = Endpoints(*(url_of(host, at.getsockname()[1], listening.scheme) for at in (rest, soap)))
            publishers, subscribers = RobotPublishersNode(ros, configuration), RobotSubscribersNode(ros, configuration)
            ros.start()
            if wait_for_robot:
                _await_robot(publishers, subscribers)
            *pair, velocity = interfaces(publishers, subscribers, configuration, endpoints, listening)
            publisher = EndpointPublisher(
                list(zip(pair, (rest, soap), strict=True)),
                _limits(configuration.web, descriptors, is_encrypted=listening.tls is not None),
                listening.proxies,
                listening.tls,
            )
            gc.freeze()  # excludes permanent objects from garbage collection, which would take 80 ms
            with contextlib.closing(velocity):
                uvloop.run(_serve_until_signalled(publisher, lambda: ready(endpoints)))


async def _serve_until_signalled(publisher: EndpointPublisher, ready: Callable[[], None]) -> None:
    stop, started = asyncio.Event(), asyncio.Event()
    loop = asyncio.get_running_loop()
    for number in ending_signals():
        loop.add_signal_handler(number, stop.set)
    async with asyncio.TaskGroup() as group:
        group.create_task(publisher.serve(stop, started))
        await started.wait()
        ready()


def _await_robot(publishers: RobotPublishersNode, subscribers: RobotSubscribersNode) -> None:
    missing = {
        "odometry": lambda: subscribers.odometry[0] is not None,
        "a subscriber to velocity commands": publishers.find_velocity_subscribers,
        "a delivery application": publishers.delivery_is_served,
        "a navigation that accepts goals": publishers.navigation_is_served,
    }
    give_up = time.monotonic() + _DISCOVERY
    while missing:
        missing = {what: is_there for what, is_there in missing.items() if not is_there()}
        if missing and time.monotonic() > give_up:
            raise RobotNotFoundError(f"after {_DISCOVERY:g} s, the ROS graph does not show {', '.join(missing)}")
        time.sleep(_DISCOVERY_STEP)


def _limits(web: WebSettings, descriptors: int, *, is_encrypted: bool) -> Limits:
    most = _TLS_CONNECTIONS if is_encrypted else _CONNECTIONS
    return Limits(
        web.read_deadline,
        unknown=web.token_deadline,
        connections=max(1, min(most, (descriptors - _OTHER_DESCRIPTORS) // 2)),
        of_address=web.connections_per_address,
    )


def _raised_descriptor_limit() -> int:
    """Return how many file descriptors this process may have, after raising the limit as far as permitted."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = _DESCRIPTORS if hard == resource.RLIM_INFINITY else min(_DESCRIPTORS, hard)
    if soft != resource.RLIM_INFINITY and soft < wanted:
        resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))
    return wanted
