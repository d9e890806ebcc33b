"""The suite's end of the ROS probe: asks it for the messages that it received."""

import math
import threading
import time
from collections.abc import Callable
from typing import Any, Final

from conformance.packs.table1.robot.delivery import Delivery
from conformance.packs.table1.robot.robot import Velocity
from conformance.papers_robot.statement import Ros
from conformance.transport.passage import EyeState, Recorder
from ros_probe.process import ProbeError, RosProcess

#: Wait for the robot's messages, s. DDS sends a lost sample again after its writer's next heartbeat, which Fast DDS has
#: every 3 s.
ARRIVES_S: Final = 5.0

_EYES: Final = ("deliveries", "velocities")  # topics that the probe observes
_NS: Final = 1_000_000_000
_DISCOVERY_S = 10.0  # longest wait until the probe discovers the robot, s
_STEP_S = 0.05  # pause between two looks at the ROS graph, s
_MATCHED_S: Final = 0.2  # time after which both ends know of a subscription, s
_DELIVERY: Final = "mybot_delivery_app/msg/DeliveryRequestMsg"
_TWIST, _STAMPED = "geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped"

__all__ = ["ARRIVES_S", "Probe", "ProbeError", "RosProbe"]


class Probe(RosProcess):
    """A started probe; call await_ready() before anything else.

    Args:
        ros: the statement's part on the robot's ROS side.
        recorder: records what is heard, and when it was.

    Attributes:
        heard_at: time up to which all messages caused by the run's requests have arrived, s of the monotonic clock.

    Raises:
        ProbeError: the process cannot be started.
    """

    heard_at = -math.inf

    def __init__(self, ros: Ros, recorder: Recorder) -> None:
        self._ros, self._recorder = ros, recorder
        super().__init__(domain_id=ros.domain_id)

    def await_ready(self) -> None:
        """Wait until the robot's publishers are there, and subscribe.

        Publishers count as well as nodes, as they may be discovered before their nodes' names.

        Raises:
            ProbeError: ROS or the message package is missing, or nothing is there to be found.
        """
        super().await_ready()
        wanted, until = {self._ros.delivery_topic, self._ros.cmd_vel_topic}, time.monotonic() + _DISCOVERY_S
        while not wanted <= self.topics().keys() and time.monotonic() < until:
            time.sleep(_STEP_S)
        topics = self.topics()
        if not wanted & topics.keys() and not self.tell("graph")["nodes"]:
            self.close()
            raise ProbeError(f"no ROS node is found in domain {self._ros.domain_id}")
        velocity = _STAMPED if _STAMPED in topics.get(self._ros.cmd_vel_topic, ()) else _TWIST
        self.tell("listen", topic=self._ros.delivery_topic, type=_DELIVERY)
        self.tell("listen", topic=self._ros.cmd_vel_topic, type=velocity)
        time.sleep(_MATCHED_S)

    def deliveries(self) -> list[Delivery]:
        """Return the DeliveryRequestMsg messages received since the last call, in order."""
        heard = self._take_new("deliveries", self._ros.delivery_topic, lambda message: list(message.values()))
        return [Delivery(int(code), *values) for code, *values in heard]

    def velocities(self) -> list[Velocity]:
        """Return the velocity commands received since the last call, in order."""
        return [Velocity(*values) for values in self._take_new("velocities", self._ros.cmd_vel_topic, _axes)]

    def _take_new(self, eye: str, topic: str, values_of: Callable[[dict[str, Any]], list[float]]) -> list[list[float]]:
        """Return and record the messages of one topic since the last call."""
        heard = []
        for at_ns, _, message in self.tell("heard", name=topic)["events"]:
            values = values_of(message)
            self._recorder.saw(eye, at_ns / _NS, values)
            heard.append(values)
        return heard

    def topics(self) -> dict[str, list[str]]:
        """Return the types of each published topic, by the topic's full name."""
        return {name: one["types"] for name, one in self.tell("graph")["topics"].items() if one["publishers"]}


def _axes(message: dict[str, Any]) -> list[float]:
    twist = message.get("twist", message)
    return [twist[part][axis] for part in ("linear", "angular") for axis in "xyz"]


class RosProbe:
    """The probe of one run. It is started early, since discovery may take seconds, and awaited when first needed.

    Args:
        ros: the statement's part on the robot's ROS side; the domain may be missing.
        recorder: records what is heard.
    """

    def __init__(self, ros: Ros, recorder: Recorder) -> None:
        self._ros, self._recorder = ros, recorder
        self._probe: Probe | None = None
        self._problem: ProbeError | None = None
        self._sees_robot = False

    def start(self) -> None:
        """Start the process if the statement names a domain, without waiting for it."""
        if self._probe is None and self._problem is None and self._ros.domain_id is not None:
            try:
                self._probe = Probe(self._ros, self._recorder)
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
            for eye in _EYES:
                self._recorder.eye(eye, EyeState.OPENED)
        return self._probe

    def close(self) -> None:
        """End the process without waiting for it, when all that it has heard is recorded."""
        if self._probe is not None:
            if self._sees_robot:
                self._listen_once_more(self._probe)
            threading.Thread(target=self._probe.close, name="probe's end").start()

    def _listen_once_more(self, probe: Probe) -> None:
        state = EyeState.CLOSED
        try:
            probe.deliveries()
            probe.velocities()
        except ProbeError:
            state = EyeState.LOST
        for eye in _EYES:
            self._recorder.eye(eye, state)
