"""Options that contradict one another or are out of range."""

import shlex
from typing import Any

from loadtests.settings.cli_options import CliOptions

_MOST_RATE = 1_000_000.0
_MOST_USERS = 10_000
_MOST_CONNECTIONS = 4096
_MOST_DURATION_S = 24 * 3600.0


def contradiction(options: CliOptions) -> str | None:
    """Return what is wrong with the options and what to change; None if they are valid."""
    if options.rate is not None and options.users is not None:
        return "--rate (open model) and --users (closed model) exclude each other"
    if options.users is not None and (options.steps or options.step_rates or options.knee):
        return "--steps and --knee set rates, which is an open model: use --rate instead of --users"
    if options.generator.processes + options.generator.expect < 1:
        return "--processes 0 leaves the work to other machines: say how many workers with --expect-workers"
    ranges: list[tuple[str, Any, float, float]] = [
        ("--rate", options.rate, 0.0, _MOST_RATE),
        ("--users", options.users, 0, _MOST_USERS),
        ("--duration", options.duration_s, 0.0, _MOST_DURATION_S),
        ("--timeout", options.endpoints.get("timeout_s"), 0.0, 3600.0),
        ("--step-duration", options.step_s, 0.0, 600.0),
        *(("--connections", users, 0, _MOST_CONNECTIONS) for users in options.connections),
        *(("--step-rates", rate, 0.0, _MOST_RATE) for rate in options.step_rates),
    ]
    for name, value, low, high in ranges:
        if value is not None and not low < value <= high:
            return f"{name} {value:g} is out of range: above {low:g}, at most {high:g}"
    if options.warmup_s is not None and not 0 <= options.warmup_s <= _MOST_DURATION_S:
        return f"--warmup {options.warmup_s:g} is out of range: 0 or more"
    return _restarting(options)


def _restarting(options: CliOptions) -> str | None:
    """Return what is wrong with the command that restarts the robot."""
    command = options.repeats.restart_command
    if command is None:
        return None
    if options.repeats.number < 2:  # noqa: PLR2004 -- there is nothing between the repeats of one
        return "--restart-command restarts the robot between repeats: say how many with --repeat"
    try:
        words = shlex.split(command)
    except ValueError as error:
        return f"--restart-command {command!r}: {error}"
    if not words:
        return f"--restart-command {command!r} names no program"
    return None
