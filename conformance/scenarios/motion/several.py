"""Scenarios in which several clients command a device at the same moment."""

from __future__ import annotations

from typing import Final

from conformance.scenarios.motion.driving import driven_for_a_moment, with_room
from conformance.scenarios.motion.mapped import MappedDevice, Position
from conformance.scenarios.motion.measuring import end_of_travel, steady_since
from conformance.scenarios.motion.moves import need_positions, need_reached_alone, record_parts
from conformance.scenarios.motion.trace import Command, Drive, Leg, Reading
from conformance.scenarios.motion.velocities import MEASURED_S
from conformance.scenarios.scenario import NotPossibleError, scenario
from conformance.scenarios.stage import Need, Stage
from conformance.statement.motion_map import Goto, Velocity
from conformance.transport.exchange import Exchange
from conformance.transport.parallel import send_together
from conformance.verdict.effort import Effort

_NEEDS: Final = (Need.REST, Need.MOTION)
_CLIENTS: Final = 4


def _at_once(mapped: MappedDevice, given: Goto | Velocity, several: list[Position]) -> list[Command]:
    """Send a command from each of several clients; return those that were answered.

    A client whose connection was refused has sent none.

    Raises:
        NotPossibleError: none was answered.
    """
    made = [mapped.request_of(given, item) for item in several]
    sent = mapped.clock.now()
    attempts = send_together([[(mapped.api.client, request) for request in made]])[0]
    answered = mapped.clock.now()
    pairs = zip(several, attempts, strict=True)
    found = [Command(sent, answered, one, attempt) for one, attempt in pairs if isinstance(attempt, Exchange)]
    if not found:
        raise NotPossibleError("none of several clients at once was answered")
    return found


@scenario(needs=_NEEDS, stage=Stage.MOTION)
def several_clients(mapped: MappedDevice, effort: Effort) -> tuple[Leg, ...]:
    """Send different targets from several clients at the same moment."""
    need_positions(mapped)
    return record_parts(_of_clients(mapped) for _ in range(1 if effort.name == "quick" else 3))


def _of_clients(mapped: MappedDevice) -> Leg:
    if not mapped.rests:
        mapped.come_to_rest()
    start, axes = mapped.where(), mapped.motion.state.axes.items()
    # Computed so that the last one is exactly the limit, without rounding.
    shares = [client / (_CLIENTS - 1) for client in range(_CLIENTS)]
    several = [{name: axis.limits[0] * (1 - share) + axis.limits[1] * share for name, axis in axes} for share in shares]
    # A target at the device's own place would be reached in any case.
    wanted = [item for item in several if not mapped.is_near(start, item)]
    commands = _at_once(mapped, mapped.moves, wanted)
    for command in commands:
        if command.is_ok:
            mapped.note(command.exchange)
    seen, due = mapped.follow_several(commands, wanted)
    here = seen[-1].values if seen else {}
    if here and not any(mapped.is_near(here, item) for item in wanted):
        need_reached_alone(
            mapped,
            start,
            min(wanted, key=lambda item: sum(abs(axis.apart(here[name], item[name])) for name, axis in axes)),
        )
    return Leg("targets of several clients", start, tuple(commands), tuple(seen), due)


@scenario(needs=_NEEDS, stage=Stage.DRIVE)
def several_drivers(mapped: MappedDevice, effort: Effort) -> tuple[Drive, ...]:
    """Command different velocities from several clients at the same moment, as one drive.

    Of several axes each client drives one, and a velocity that mixes two of them shows.
    """
    several = [
        {**dict.fromkeys(mapped.drives.axes, 0.0), name: axis.limits[side]}
        for side in (0, 1)
        for name, axis in mapped.drives.axes.items()
        if axis.limits[side]
    ]
    return record_parts(of_drivers(mapped, several) for _ in range(2 if effort.name == "quick" else 4))


def of_drivers(mapped: MappedDevice, several: list[Position]) -> Drive:
    """Command velocities from several clients at the same moment, one from each, and watch until one is reached."""
    settle_s = mapped.drives.settle_s
    # Nothing renews the velocity: with a hold time below the settle time, nothing can be measured.
    lasts_s = min(mapped.drives.hold_s or settle_s + MEASURED_S, settle_s + MEASURED_S)
    several = with_room(mapped, several, lasts_s + settle_s)
    commands = _at_once(mapped, mapped.drives, several)

    def steady_time(so_far: list[Reading]) -> float | None:
        found = (
            steady_since(so_far, command.targets, mapped.motion, mapped.resting)
            for command in commands
            if command.is_ok
        )
        return next((since for since in found if since is not None), None)

    def is_over(so_far: list[Reading]) -> bool:
        return steady_time(so_far) is not None or mapped.room.is_over(several, so_far, settle_s)

    seen = mapped.watch(commands[-1].answered + lasts_s, is_over)
    end, since = mapped.drive({}), steady_time(seen)
    at_end = since is None and any(_is_at_end(mapped, command.targets, seen) for command in commands)
    what = "velocities of several clients"
    return Drive(what, {}, tuple(commands), tuple(seen), end, (), since=since, at_end=at_end)


def _is_at_end(mapped: MappedDevice, speeds: Position, seen: list[Reading]) -> bool:
    """Return whether a device that stands also does so if one client alone drives it: then its travel ends there."""
    for name, wanted in speeds.items():
        place, of = end_of_travel(seen, name, wanted, mapped.motion, ()), mapped.drives.axes[name].of
        # Another client's velocity, tried before, may have taken it away from there.
        for _ in range(_CLIENTS):
            if place is None:
                break
            mapped.come_to_rest()
            alone = [reading for reading in driven_for_a_moment(mapped, speeds) if reading.values]
            if end_of_travel(alone, name, wanted, mapped.motion, ()) is not None:
                mapped.room.ends(speeds, alone)
                return True
            if not alone or (alone[-1].values[of] - place) * wanted > mapped.motion.tolerance(of) * abs(wanted):
                break
    return False
