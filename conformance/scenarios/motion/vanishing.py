"""A scenario in which the client of a driving device vanishes, in each way in which clients do."""

from __future__ import annotations

import math
from contextlib import ExitStack
from typing import Final

from conformance.scenarios.motion.driving import with_room
from conformance.scenarios.motion.mapped import MappedDevice, Position
from conformance.scenarios.motion.moves import recorded
from conformance.scenarios.motion.trace import Command, Drive, Reading
from conformance.scenarios.scenario import scenario
from conformance.scenarios.stage import Need, Stage
from conformance.transport.raw import PartialRequest

_NEEDS: Final = (Need.REST, Need.MOTION)
SILENT: Final = "and the client falls silent"
CLOSED: Final = "and the client closes its connection"
HALF_OPEN: Final = "and the link breaks without a word"
POLLING: Final = "and the client only goes on reading the state"
#: How a client vanishes, each as the end of a drive's name.
WAYS: Final = (SILENT, CLOSED, HALF_OPEN, POLLING)
# Of the limit; so slow that a device that goes on stays near.
_SLOW: Final = 0.4
# For so long it is driven, once it must have its velocity, and watched after it must rest, s.
_DRIVEN_S, _WATCHED_S = 0.3, 0.5
# A device of which no hold time is declared is watched for so long, s; no verdict follows.
_UNDECLARED_S: Final = 2.0
# A velocity is kept up that often within its hold time, at least every so many s.
_KEPT, _KEPT_S = 3, 0.1


@scenario(needs=_NEEDS, stage=Stage.DRIVE)
def vanishing(mapped: MappedDevice) -> tuple[Drive, ...]:
    """Drive slowly, and vanish: in silence, with the connection closed, with the link broken, and reading on."""
    ways = WAYS if mapped.drives.hold_s is not None else (CLOSED, POLLING)
    return recorded(_vanished(mapped, way) for way in ways)


def _vanished(mapped: MappedDevice, way: str) -> Drive:
    drives = mapped.drives
    held_s = drives.hold_s if drives.hold_s is not None else _UNDECLARED_S
    rests_s, name = held_s + drives.settle_s, next(iter(drives.axes))
    made = with_room(mapped, [_speeds(mapped, name)], drives.settle_s + _DRIVEN_S + rests_s)[0]
    commands, readings = _driven(mapped, made, drives.settle_s + _DRIVEN_S)
    with ExitStack() as links:
        links.callback(mapped.ready.speak)
        if way in {CLOSED, HALF_OPEN} and commands[-1].accepted:
            commands.append(_unread(mapped, made, commands[-1], links, close=way == CLOSED))
        mapped.ready.fall_silent()
        rests_at = commands[-1].answered + rests_s
        if way != POLLING:
            mapped.clock.sleep(rests_at - mapped.clock.now())
        after = mapped.watch(rests_at + _WATCHED_S, lambda seen: mapped.room.is_over([made], seen, 0.0))
    mapped.stop()
    mapped.saw_rest(after)
    speeds = " and ".join(f"{axis} {speed:.3g}" for axis, speed in made.items())
    wanted = {**dict.fromkeys(drives.axes, 0.0), **made}
    return Drive(
        f"{speeds}, {way}", wanted, tuple(commands), tuple(readings), None, tuple(after), resting=mapped.resting
    )


def _speeds(mapped: MappedDevice, name: str) -> Position:
    """Return a slow velocity that leads away from the nearer end of its axis."""
    axis = mapped.drives.axes[name]
    ends = mapped.motion.state.axes[axis.of].limits if axis.of else (0.0, 0.0)
    ahead = not axis.limits[0] or not axis.of or mapped.where()[axis.of] <= sum(ends) / 2
    least = min(1.5 * mapped.motion.speed_tolerance(name), max(map(abs, axis.limits)))
    limit = axis.limits[1] if ahead else axis.limits[0]
    return {name: math.copysign(max(_SLOW * abs(limit), min(least, abs(limit))), limit)}


def _driven(mapped: MappedDevice, speeds: Position, lasts_s: float) -> tuple[list[Command], list[Reading]]:
    hold_s = mapped.drives.hold_s
    every_s = min(_KEPT_S, hold_s / _KEPT) if hold_s else _KEPT_S
    commands, readings = [mapped.drive(speeds)], list[Reading]()
    while mapped.clock.now() < commands[0].answered + lasts_s and commands[-1].accepted:
        if mapped.clock.now() >= commands[-1].sent + every_s:
            commands.append(mapped.drive(speeds))
        readings.append(mapped.read())
        mapped.room.note(speeds, readings)
    return commands, readings


def _unread(mapped: MappedDevice, speeds: Position, last: Command, links: ExitStack, *, close: bool) -> Command:
    """Send the last command once more, and never read the response; the exchange is that of the one before.

    Args:
        mapped: the device.
        speeds: what is commanded.
        last: the command before.
        links: closes the connection in the end.
        close: whether the client closes it at once, as one does that is killed; else it stays open without a word, as
            one that has lost its network.
    """
    made, sent = mapped.request_of(mapped.drives, speeds), mapped.clock.now()
    link = PartialRequest(
        mapped.api.client, made.method, made.target, sent=made.body, promised=len(made.body), headers=made.headers
    )
    if close:
        link.vanish(reset=False)
        mapped.api.client.close()
    else:
        links.callback(link.vanish)
    return Command(sent, mapped.clock.now(), last.targets, last.exchange)
