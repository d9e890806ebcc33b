"""The simulated robot as a process of its own: ``python -m reference_robot.simulation``.

Prints ``ready`` on stdout when the robot is up. SIGINT and SIGTERM end it with exit code 0, and so does
the end of its standard input where that is a pipe: a robot does not outlive the program that started it.
"""

import contextlib
import gc
import os
import stat
import sys
import threading
from pathlib import Path
from typing import Final

import click

from conformance.contract.toml_file import TomlFileError
from reference_robot.ending import Ending
from reference_robot.names import load_names
from reference_robot.ros import RosRuntime
from reference_robot.ros_arguments import RosCommand
from reference_robot.simulation.realism import Realism
from reference_robot.simulation.runner import Simulation

_NICENESS: Final = 5  # the web layer answers first: a real robot's motors do not wait for this machine


@click.command(cls=RosCommand)
@click.option("--domain-id", type=click.IntRange(0, 101), help="ROS domain; ROS_DOMAIN_ID by default.")
@click.option("--time-scale", type=click.FloatRange(0, min_open=True), default=1.0, show_default=True)
@click.option("--names", "names_file", type=click.Path(path_type=Path), help="Names of topics and actions.")
@click.option("--realistic", is_flag=True, help="With slipping wheels, noise, delays; --seed chooses which.")
@click.option("--seed", type=int, default=0, show_default=True)
def main(
    domain_id: int | None,
    time_scale: float,
    names_file: Path | None,
    *,
    realistic: bool,
    seed: int,
    ros_arguments: tuple[str, ...],
) -> None:
    """Run the simulated robot until it is told to stop."""
    # Seen on this machine only, unless the user wants it otherwise.
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    try:
        names = load_names(names_file)
    except TomlFileError as error:
        raise click.UsageError(str(error)) from error
    _give_way()
    ending = Ending()
    if _stdin_is_pipe():
        threading.Thread(target=_await_end_of_stdin, args=(ending,), daemon=True).start()
    with RosRuntime(domain_id, ros_arguments) as ros:
        Simulation(ros, names, time_scale, Realism(seed) if realistic else None)
        gc.freeze()  # what lives as long as the robot is not looked at again
        ros.start()
        click.echo("ready")
        ending.wait()


def _give_way() -> None:
    """Let the web services and their client go first: of a processor's time, and when a message wakes this process.

    A batch process waits until whoever runs has nothing to do or has had its turn (sched(7)). Otherwise each publish of
    the web services would hand over the processor on which a client waits for the answer. Whoever gave it another
    policy, such as real time, is obeyed.
    """
    os.nice(_NICENESS)
    with contextlib.suppress(AttributeError, OSError):  # a system that has none, or that does not allow it
        if os.sched_getscheduler(0) == os.SCHED_OTHER:
            os.sched_setscheduler(0, os.SCHED_BATCH, os.sched_param(0))


def _stdin_is_pipe() -> bool:
    try:
        return stat.S_ISFIFO(os.fstat(sys.stdin.fileno()).st_mode)
    except (AttributeError, OSError, ValueError):  # there is no standard input
        return False


def _await_end_of_stdin(ending: Ending) -> None:
    with contextlib.suppress(OSError):
        while os.read(0, 4096):
            pass
    ending.bring()


if __name__ == "__main__":
    main()
