"""Start the ROS probe's process, send it requests and read its replies; every wait has a deadline."""

import atexit
import json
import math
import os
import queue
import subprocess
import sys
import threading
from contextlib import suppress
from typing import Any, Final

from conformance.packs.table1.robot.delivery import Delivery
from conformance.packs.table1.robot.robot import Velocity
from conformance.packs.table1.statement import Ros

# Importing rclpy and finding the robot on the graph takes seconds on a small machine, s.
_START_S: Final = 20.0
_ANSWER_S: Final = 5.0
_END_S: Final = 3.0
_LINES_KEPT: Final = 2000


class ProbeError(Exception):
    """The probe cannot be used; the message says why."""


class Probe:
    """A started probe; call await_robot() before anything else.

    Args:
        ros: the statement's part on the robot's ROS side.

    Attributes:
        heard_at: time up to which all messages caused by the run's requests have arrived, s of the monotonic clock.

    Raises:
        ProbeError: the process cannot be started.
    """

    heard_at = -math.inf

    def __init__(self, ros: Ros) -> None:
        command = [sys.executable, "-m", "conformance.packs.table1.robot.probe", "--domain-id", str(ros.domain_id)]
        command += ["--delivery-topic", ros.delivery_topic, "--cmd-vel-topic", ros.cmd_vel_topic]
        # A robot that only looks on its own machine hears no multicast: without a word to it directly, the probe would
        # wait seconds for its next announcement. Robots elsewhere are found as ever.
        peers = ";".join(filter(None, [os.environ.get("ROS_STATIC_PEERS"), "127.0.0.1"]))
        # Shared memory that killed processes left behind, or that a container does not share, swallows messages.
        environment = {"FASTDDS_BUILTIN_TRANSPORTS": "UDPv4"} | os.environ
        environment |= {"ROS_DOMAIN_ID": str(ros.domain_id), "ROS_STATIC_PEERS": peers}
        try:
            # In a session of its own: Ctrl-C is for the suite, which then ends the probe.
            self._process = subprocess.Popen(  # noqa: S603 - our own program
                command,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                env=environment,
                text=True,
                start_new_session=True,
            )
        except OSError as error:
            raise ProbeError(f"it cannot be started: {error}") from error
        self._lines: queue.Queue[str] = queue.Queue(_LINES_KEPT)
        threading.Thread(target=self._listen, daemon=True, name="probe").start()
        atexit.register(self.close)

    def await_robot(self) -> None:
        """Wait until the probe has discovered the robot.

        Raises:
            ProbeError: ROS or the message package is missing, or no robot is in the domain.
        """
        try:
            self._answer(_START_S)
        except ProbeError:
            self.close()
            raise

    def deliveries(self) -> list[Delivery]:
        """Return the DeliveryRequestMsg messages received since the last call, in order."""
        return [
            Delivery(int(code), *(float.fromhex(value) for value in values))
            for code, *values in self._ask("deliveries")["deliveries"]
        ]

    def velocities(self) -> list[Velocity]:
        """Return the velocity commands received since the last call, in order."""
        return [Velocity(*map(float.fromhex, values)) for values in self._ask("velocities")["velocities"]]

    def topics(self) -> dict[str, list[str]]:
        """Return the types of each published topic, by the topic's full name."""
        topics: dict[str, list[str]] = self._ask("graph")["topics"]
        return topics

    def close(self) -> None:
        """End the process."""
        atexit.unregister(self.close)
        with suppress(OSError, ValueError):
            if self._process.stdin:
                self._process.stdin.close()
        try:
            self._process.wait(_END_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def _listen(self) -> None:
        if self._process.stdout:
            for line in self._process.stdout:
                with suppress(queue.Full):
                    self._lines.put_nowait(line)
        with suppress(queue.Full):
            self._lines.put_nowait("")

    def _ask(self, what: str) -> dict[str, Any]:
        try:
            if self._process.stdin:
                self._process.stdin.write(what + "\n")
                self._process.stdin.flush()
        except (OSError, ValueError) as error:
            raise ProbeError(f"it has ended: {error}") from error
        return self._answer(_ANSWER_S)

    def _answer(self, within_s: float) -> dict[str, Any]:
        try:
            line = self._lines.get(timeout=within_s)
        except queue.Empty as error:
            raise ProbeError(f"it does not answer within {within_s:g} s") from error
        try:
            answer = json.loads(line)
        except ValueError as error:
            raise ProbeError(f"it has ended{f' and said {line.strip()!r}' if line else ''}") from error
        if not isinstance(answer, dict) or "problem" in answer:
            raise ProbeError(str(answer["problem"]) if isinstance(answer, dict) else "it answers nonsense")
        return answer


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
                self._probe.await_robot()
            except ProbeError as error:
                self._problem = error
                raise
            self._sees_robot = True
        return self._probe

    def close(self) -> None:
        """End the process without waiting for it."""
        if self._probe is not None:
            threading.Thread(target=self._probe.close, name="probe's end").start()
