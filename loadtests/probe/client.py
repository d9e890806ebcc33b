"""The load test's end of the probes: starts their processes; every wait has a deadline.

For a process that gevent has patched: waiting for a probe blocks no other greenlet.
"""

import json
import os
import subprocess
import sys
from contextlib import suppress
from typing import Any

import gevent
from gevent.queue import Empty, Queue

_START_S = 30.0  # importing rclpy and finding the robot on the graph takes seconds on a small machine
_ANSWER_S = 5.0
_END_S = 3.0


class ProbeError(Exception):
    """A probe cannot be used; the message says why."""


class Probe:
    """A process on the ROS graph, in the role `listen` or `publish`; call `await_ready` first."""

    def __init__(self, role: str, domain_id: int, topic: str) -> None:
        command = [sys.executable, "-m", "loadtests.probe", role, "--domain-id", str(domain_id), "--topic", topic]
        # A robot with discovery limited to its own machine receives no multicast: as static peer it finds us. Shared
        # memory left behind by killed processes, or not shared by a container, loses messages.
        peers = ";".join(filter(None, [os.environ.get("ROS_STATIC_PEERS"), "127.0.0.1"]))
        environment = {"FASTDDS_BUILTIN_TRANSPORTS": "UDPv4"} | os.environ
        environment |= {"ROS_DOMAIN_ID": str(domain_id), "ROS_STATIC_PEERS": peers}
        self._process = subprocess.Popen(  # noqa: S603 -- our own program
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env=environment,
            text=True,
            start_new_session=True,  # Ctrl-C goes to the load test, which then ends the probe
        )
        self._lines: Queue[dict[str, Any]] = Queue()
        self._reader = gevent.spawn(self._listen)

    def await_ready(self) -> None:
        """Wait until the probe is on the graph.

        Raises:
            ProbeError: it does not start (no ROS, no message package), or finds no peer on the topic.
        """
        self.next(_START_S)

    def publish(self, values: tuple[float, ...]) -> int:
        """Publish a delivery; returns when that began (CLOCK_MONOTONIC, ns).

        Raises:
            ProbeError: it has ended.
        """
        try:
            if self._process.stdin:
                self._process.stdin.write(json.dumps([float(value).hex() for value in values]) + "\n")
                self._process.stdin.flush()
        except (OSError, ValueError) as error:
            raise ProbeError(f"it has ended: {error}") from error
        return int(self.next(_ANSWER_S)["sent_ns"])

    def arrival_ns(self, values: tuple[float, ...], within_s: float) -> int | None:
        """Return the time at which a listener received a delivery with these values; None if it does not come in time.

        Raises:
            ProbeError: the probe's process has ended.
        """
        wanted = [float(value).hex() for value in values]
        with gevent.Timeout(within_s, exception=False):
            while True:
                told = self.next(within_s)
                if told["values"] == wanted:
                    return int(told["at_ns"])
        return None

    def next(self, within_s: float) -> dict[str, Any]:
        """Return the next line.

        Raises:
            ProbeError: none comes in time, or it reports a problem.
        """
        try:
            told: dict[str, Any] = self._lines.get(timeout=within_s)
        except Empty:
            raise ProbeError(f"it does not answer within {within_s:g} s") from None
        if "problem" in told:
            raise ProbeError(str(told["problem"]))
        return told

    def close(self) -> None:
        """End the process."""
        with suppress(OSError, ValueError):
            if self._process.stdin:
                self._process.stdin.close()
        try:
            self._process.wait(_END_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._reader.join(_END_S)

    def _listen(self) -> None:
        with suppress(OSError, ValueError):
            for line in self._process.stdout or ():
                try:
                    self._lines.put(json.loads(line))
                except ValueError:
                    self._lines.put({"problem": f"it says {line.strip()!r}"})
        self._lines.put({"problem": "it has ended"})
