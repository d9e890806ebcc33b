"""What the robot's programs share: the wait for their end, and ROS arguments (``--ros-args ... [--]``) to them.

A program ends by a signal such as SIGINT, SIGTERM or SIGHUP, or by a call from another thread.
"""

import contextlib
import os
import signal
from collections.abc import Iterable
from typing import Final

import click

from conformance.commandline.endings import ending_signals


class Ending:
    """A one-time event that a signal such as SIGINT or a call of ``trigger`` sets off. Create it in the main thread.

    Python runs signal handlers only when the main thread executes Python code, so a thread that blocks on an event
    would not wake up. The interpreter also writes a byte to a pipe for each signal, whichever thread receives the
    signal. The main thread waits for that byte.
    """

    def __init__(self) -> None:
        self._read_end, self._write_end = os.pipe()
        os.set_blocking(self._write_end, False)
        signal.set_wakeup_fd(self._write_end)
        for number in ending_signals():
            signal.signal(number, lambda _number, _frame: None)

    def wait(self) -> None:
        """Block until a signal that ends the process, or a call of ``trigger``."""
        os.read(self._read_end, 1)

    def trigger(self) -> None:
        """Make ``wait`` return; may be called from any thread."""
        with contextlib.suppress(BlockingIOError):  # the pipe is full, so `wait` returns anyway
            os.write(self._write_end, b"\0")


_BEGIN: Final = "--ros-args"
_END: Final = "--"


class RosCommand(click.Command):
    """A click command that passes the words of ``--ros-args ...`` to its function as the tuple ``ros_arguments``."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse the command line after moving the ROS arguments from it into the parameter ``ros_arguments``."""
        own, ros = divide_words(args)
        left = super().parse_args(ctx, own)
        ctx.params["ros_arguments"] = tuple(ros)
        return left


def divide_words(words: Iterable[str]) -> tuple[list[str], list[str]]:
    """Return the program's own words and the ROS words of a command line.

    ROS words reach from each ``--ros-args`` up to the next ``--`` or the end, both included.
    """
    own: list[str] = []
    ros: list[str] = []
    is_ros = False
    for word in words:
        is_ros = is_ros or word == _BEGIN
        (ros if is_ros else own).append(word)
        is_ros = is_ros and word != _END
    return own, ros
