"""The suite's end of the ROS probe: asks for what it has received."""

import math
import threading
from typing import Final

from conformance.packs.table1.robot.delivery import Delivery
from conformance.packs.table1.robot.robot import Velocity
from conformance.packs.table1.ros_process import ProbeError, RosProcess
from conformance.packs.table1.statement import Ros

#: How long the robot's messages are waited for, s. DDS sends a lost sample again after its writer's next heartbeat, and
#: Fast DDS has one every 3 s: on Wi-Fi a message may come so late.
ARRIVES_S: Final = 5.0

__all__ = ["ARRIVES_S", "Probe", "ProbeError", "RosProbe"]


class Probe(RosProcess):
    """A started probe; call await_ready() before anything else.

    Args:
        ros: the statement's part on the robot's ROS side.

    Attributes:
        heard_at: time up to which all messages caused by the run's requests have arrived, s of the monotonic clock.

    Raises:
        ProbeError: the process cannot be started.
    """

    heard_at = -math.inf

    def __init__(self, ros: Ros) -> None:
        topics = ("--delivery-topic", ros.delivery_topic, "--cmd-vel-topic", ros.cmd_vel_topic)
        super().__init__("conformance.packs.table1.robot.probe", *topics, domain_id=ros.domain_id)

    def deliveries(self) -> list[Delivery]:
        """Return the DeliveryRequestMsg messages received since the last call, in order."""
        return [
            Delivery(int(code), *(float.fromhex(value) for value in values))
            for code, *values in self.ask("deliveries")["deliveries"]
        ]

    def velocities(self) -> list[Velocity]:
        """Return the velocity commands received since the last call, in order."""
        return [Velocity(*map(float.fromhex, values)) for values in self.ask("velocities")["velocities"]]

    def topics(self) -> dict[str, list[str]]:
        """Return the types of each published topic, by the topic's full name."""
        topics: dict[str, list[str]] = self.ask("graph")["topics"]
        return topics


class RosProbe:
    """The probe of one run. It is started early, since discovery may take seconds, and awaited when first needed.

    Args:
        ros: the statement's part on the robot's ROS side; the domain may be missing.
    """

    def __init__(self, ros: Ros) -> None:
        self._ros = ros
        self._probe: Probe | None = None
        self._problem: ProbeError | None = None
        self._sees_robot = False

    def start(self) -> None:
        """Start the process if the statement names a domain, without waiting for it."""
        if self._ros.domain_id is None or self._probe is not None or self._problem is not None:
            return
        try:
            self._probe = Probe(self._ros)
        except ProbeError as error:
            self._problem = error

    def ready(self) -> Probe:
        """Return the probe once it has discovered the robot.

        Raises:
            ProbeError: the statement names no domain, or the probe cannot be used.
        """
        self.start()
        if self._problem is not None:
            raise self._problem
        if self._probe is None:
            raise ProbeError("no ROS domain is given (--ros-domain-id)")
        if not self._sees_robot:
            try:
                self._probe.await_ready()
            except ProbeError as error:
                self._problem = error
                raise
            self._sees_robot = True
        return self._probe

    def close(self) -> None:
        """End the process without waiting for it."""
        if self._probe is not None:
            threading.Thread(target=self._probe.close, name="probe's end").start()
