"""The simulated robot as a child process that ends with its parent process, even if the parent is killed."""

import contextlib
import os
import select
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import IO, Final

from reference_robot.kinematics import DIFFERENTIAL

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
