"""Start the probe's process, and tell it what to do in lines of JSON.

So the suite needs no ROS itself. Every wait has a deadline.
"""

import atexit
import json
import os
import queue
import subprocess
import sys
import threading
from contextlib import suppress
from typing import Any, Final

# Importing rclpy and finding the robot on the graph takes seconds on a small machine, s.
_START_S: Final = 30.0
# An answer, on top of what a command waits for itself, s.
_ANSWER_S: Final = 20.0
_END_S: Final = 3.0
_LINES_KEPT: Final = 2000


class ProbeError(Exception):
    """The program cannot be used; the message says why."""


class RosProcess:
    """A ROS node in a process of its own, which follows commands (player.py); call await_ready() before anything else.

    Args:
        name: of the node.
        domain_id: the robot's ROS domain.

    Raises:
        ProbeError: the process cannot be started.
    """

    def __init__(self, name: str = "roaas_probe", *, domain_id: int | None) -> None:
        # A robot that only looks on its own machine hears no multicast: without a word to it directly, the probe would
        # wait seconds for its next announcement. Robots elsewhere are found as ever.
        peers = ";".join(filter(None, [os.environ.get("ROS_STATIC_PEERS"), "127.0.0.1"]))
        # Shared memory that killed processes left behind, or that a container does not share, swallows messages.
        environment = {"FASTDDS_BUILTIN_TRANSPORTS": "UDPv4"} | os.environ
        environment |= {"ROS_DOMAIN_ID": str(domain_id), "ROS_STATIC_PEERS": peers}
        try:
            # In a session of its own: Ctrl-C is for its parent, which then ends it.
            self._process = subprocess.Popen(  # noqa: S603 - our own program
                [sys.executable, "-P", "-m", "ros_probe", "--domain-id", str(domain_id), "--name", name],
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

    def await_ready(self) -> None:
        """Wait until the node is on the graph.

        Raises:
            ProbeError: ROS is missing, or does not start.
        """
        try:
            self._said(_START_S)
        except ProbeError:
            self.close()
            raise

    def tell(self, what: str, **how: Any) -> dict[str, Any]:
        """Have a command carried out (player.py has them), and return its answer.

        Raises:
            ProbeError: it cannot be, or the process has ended.
        """
        try:
            if self._process.stdin:
                self._process.stdin.write(json.dumps({"do": what, **how}) + "\n")
                self._process.stdin.flush()
        except (OSError, ValueError) as error:
            raise ProbeError(f"it has ended: {error}") from error
        return self._said(how.get("within_s", 0.0) + _ANSWER_S)

    def _said(self, within_s: float) -> dict[str, Any]:
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

    def kill(self) -> None:
        """Kill the process, so that its nodes leave the graph without a word."""
        self._process.kill()
        self.close()

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
