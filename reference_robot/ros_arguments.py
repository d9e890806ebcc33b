"""ROS arguments on a command line: ``--ros-args ... [--]``, as every ROS program accepts them."""

from collections.abc import Iterable
from typing import Final

import click

_BEGIN: Final = "--ros-args"
_END: Final = "--"


class RosCommand(click.Command):
    """A click command that passes the words of ``--ros-args ...`` to its function as the tuple ``ros_arguments``."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse the command line after moving the ROS arguments from it into the parameter ``ros_arguments``."""
        own, ros = divided(args)
        left = super().parse_args(ctx, own)
        ctx.params["ros_arguments"] = tuple(ros)
        return left


def divided(words: Iterable[str]) -> tuple[list[str], list[str]]:
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
