"""The program that simulates the robot: ``python -m reference_robot.simulation``.

It prints ``ready`` on stdout when the robot is running. It ends with exit code 0 on SIGINT, SIGTERM and SIGHUP. If its
standard input is a pipe, it also ends when the pipe closes, so that the simulation never outlives the program that
started it.
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
from reference_robot.ending import Ending, RosCommand
from reference_robot.kinematics import DIFFERENTIAL, KINEMATICS
from reference_robot.names import load_names
from reference_robot.ros import RosRuntime
from reference_robot.simulation.realism import Realism
from reference_robot.simulation.runner import Simulation

_NICENESS: Final = 5  # the web services run first: on a real robot they share no processor with the motors


@click.command(cls=RosCommand, context_settings={"show_default": True})
@click.option("--domain-id", type=click.IntRange(0, 101), help="ROS domain; ROS_DOMAIN_ID by default.")
@click.option("--time-scale", type=click.FloatRange(0, min_open=True), default=1.0)
@click.option("--names", "names_file", type=click.Path(path_type=Path), help="TOML file of topic and action names.")
@click.option("--realistic", is_flag=True, help="Simulate slipping wheels, noise and delays; --seed selects the robot.")
@click.option("--seed", type=int, default=0)
@click.option("--kinematics", type=click.Choice(list(KINEMATICS)), default=DIFFERENTIAL, help="The robot's body.")
def main(
    domain_id: int | None,
    time_scale: float,
    names_file: Path | None,
    *,
    realistic: bool,
    seed: int,
    kinematics: str,
    ros_arguments: tuple[str, ...],
) -> None:
    """Run the simulated robot until SIGINT, SIGTERM or the end of standard input."""
    # The robot is visible on this machine only, unless the environment says otherwise.
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
        Simulation(ros, names, time_scale, Realism(seed) if realistic else None, kinematics)
        gc.freeze()  # excludes permanent objects from garbage collection
        ros.start()
        click.echo("ready")
        ending.wait()


def _give_way() -> None:
    """Lower this process's scheduling priority, so that the web services and their clients run first.

    Under the batch policy (sched(7)) a process that a message wakes does not interrupt the running one. Otherwise each
    message that the web services publish would take the processor from a client waiting for its response. If a user has
    set another policy, such as real time, the policy is kept.
    """
    os.nice(_NICENESS)
    with contextlib.suppress(AttributeError, OSError):  # the system has no such policy, or forbids it
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
    ending.trigger()


if __name__ == "__main__":
    main()
