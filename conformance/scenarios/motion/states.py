"""Scenarios on further operations that return a device's position, and on switches."""

from __future__ import annotations

from collections.abc import Iterator

from conformance.measures.samples import SEVERAL
from conformance.observe.clock import poll_for
from conformance.scenarios.motion.driving import with_room
from conformance.scenarios.motion.mapped import STAYS_S, MappedDevice
from conformance.scenarios.motion.moves import record_parts
from conformance.scenarios.motion.templates import NoValueError, at, positions_at
from conformance.scenarios.motion.trace import Reading, Switched, Told
from conformance.scenarios.scenario import NotDeclaredError, scenario
from conformance.scenarios.stage import Need, Stage
from conformance.transport.exchange import Exchange

_NEEDS = (Need.REST, Need.MOTION)
_STEP_S = 0.05
_AT_REST = "at rest"
# Share of the limits at which several operations are read.
_SHARE = 0.4


@scenario(needs=_NEEDS, stage=Stage.DRIVE)
def agreement(mapped: MappedDevice) -> tuple[Told, ...]:
    """Read by each operation of the map the position at rest, and the velocity during a move and after it."""
    if not mapped.motion.state.agrees:
        raise NotDeclaredError("the map names no other operation that tells the position")
    return record_parts(_read_states(mapped))


def _read_states(mapped: MappedDevice) -> Iterator[Told]:
    axes, speeds = mapped.motion.state.axes, mapped.motion.speeds
    named = {name for pointers in mapped.motion.state.agrees.values() for name in pointers}
    mapped.bring_home()
    if wanted := named & set(axes):
        yield from _all_told(mapped, wanted, _AT_REST)
        for side in (0, 1) if mapped.motion.goto else ():
            mapped.go("a limit of each axis", {name: axis.limits[side] for name, axis in axes.items()})
            yield from _all_told(mapped, wanted, _AT_REST)
    if wanted := (named & set(speeds)) - set(axes):
        for side in (1, 0):
            yield from _told_of_a_drive(mapped, wanted, side)


def _told_of_a_drive(mapped: MappedDevice, wanted: set[str], side: int) -> Iterator[Told]:
    """Drive at all velocities at once, read them, and read them again at rest."""
    mapped.measure_link()
    drives, requests = mapped.drives, SEVERAL * (2 + len(mapped.motion.state.agrees))
    lasts_s = drives.settle_s + requests * mapped.room.slowest_s + (drives.hold_s or 0.0) + drives.settle_s
    choices = [{name: _SHARE * drives.axes[name].limits[side] for name in wanted}]
    speeds = with_room(mapped, choices, lasts_s)[0]
    last, seen = mapped.drive(speeds), list[Reading]()
    until = last.answered + drives.settle_s
    while mapped.clock.now() < until:
        last = mapped.drive(speeds)
        seen.append(mapped.read())
    mapped.room.note(speeds, seen)
    for told in range(SEVERAL):
        last = mapped.drive(speeds) if told else last
        yield _read_all(mapped, wanted, "under way")
    if drives.hold_s is None:
        mapped.drive({})
    mapped.watch(last.answered + (drives.hold_s or 0.0) + drives.settle_s)
    yield from _all_told(mapped, wanted, _AT_REST)


def _all_told(mapped: MappedDevice, wanted: set[str], when: str) -> Iterator[Told]:
    return (_read_all(mapped, wanted, when) for _ in range(SEVERAL))


def _read_all(mapped: MappedDevice, wanted: set[str], when: str) -> Told:
    state, values, exchanges = mapped.motion.state, dict[str, dict[str, float]](), dict[str, Exchange]()
    own = {**mapped.motion.speeds, **{name: axis.at for name, axis in state.axes.items()}}
    for call, pointers in {state.read: own, **state.agrees}.items():
        if asked := {name: pointer for name, pointer in pointers.items() if name in wanted}:
            exchange, document = mapped.get(call)
            values[call], exchanges[call] = positions_at(document, asked, state.axes), exchange
    return Told(when, values, exchanges)


@scenario(needs=_NEEDS, stage=Stage.DRIVE)
def switched(mapped: MappedDevice) -> tuple[Switched, ...]:
    """Set each switch to each of its values, and at last to the first again."""
    if not mapped.motion.switches:
        raise NotDeclaredError("the map has no [motion.switches]")
    return record_parts(
        _switch(mapped, name, value)
        for name, switch in mapped.motion.switches.items()
        for value in (*switch.values, switch.values[0])
    )


def _switch(mapped: MappedDevice, name: str, value: object) -> Switched:
    switch = mapped.motion.switches[name]
    command = mapped.send(mapped.request_of(switch, {"value": value}))
    shown, wanted = None, switch.shows.get(str(value), value)
    for _ in poll_for(mapped.clock, _STEP_S, switch.within_s):
        shown = _read_switch(mapped, name)
        if shown == wanted:
            break
    arrived = shown == wanted
    mapped.clock.sleep(STAYS_S)
    later = _read_switch(mapped, name)
    return Switched(name, value, command, later if arrived else shown, arrived, later == wanted)


def _read_switch(mapped: MappedDevice, name: str) -> object:
    switch = mapped.motion.switches[name]
    try:
        return at(mapped.get(switch.read or mapped.motion.state.read)[1], switch.at)
    except NoValueError:
        return None
