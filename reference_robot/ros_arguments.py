"""ROS's own arguments on a command line: ``--ros-args ... [--]``, as every ROS program takes them."""

from collections.abc import Iterable
from typing import Final

import click

_BEGIN: Final = "--ros-args"
_END: Final = "--"


class RosCommand(click.Command):
    """A command that gets what stands behind ``--ros-args`` as its parameter ``ros_arguments``, a tuple of words."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Take ROS's words out before click sees them."""
        own, ros = divided(args)
        left = super().parse_args(ctx, own)
        ctx.params["ros_arguments"] = tuple(ros)
        return left


def divided(words: Iterable[str]) -> tuple[list[str], list[str]]:
    """Return a program's own words, and ROS's: from each ``--ros-args`` up to ``--`` or the end, both included."""
    own: list[str] = []
    ros: list[str] = []
    is_ros = False
    for word in words:
        is_ros = is_ros or word == _BEGIN
        (ros if is_ros else own).append(word)
        is_ros = is_ros and word != _END
    return own, ros
