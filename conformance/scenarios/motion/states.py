"""Scenarios on what a device tells by other operations, and on what has states in place of positions."""

from __future__ import annotations

from collections.abc import Iterator

from conformance.observe.polling import poll_for
from conformance.scenarios.motion.mapped import STAYS_S, MappedDevice
from conformance.scenarios.motion.moves import recorded
from conformance.scenarios.motion.templates import NoValueError, at, numbers_at
from conformance.scenarios.motion.trace import SEVERAL, Switched, Told
from conformance.scenarios.scenario import NotDeclaredError, scenario
from conformance.scenarios.stage import Need, Stage
from conformance.transport.exchange import Exchange

_NEEDS = (Need.REST, Need.MOTION)
_STEP_S = 0.05


@scenario(needs=_NEEDS, stage=Stage.DRIVE)
def agreement(mapped: MappedDevice) -> tuple[Told, ...]:
    """Read the position by each operation that tells it, at rest: at home, and at the limits of each axis."""
    if not mapped.motion.state.agrees:
        raise NotDeclaredError("the map names no other operation that tells the position")
    return recorded(_told(mapped))


def _told(mapped: MappedDevice) -> Iterator[Told]:
    mapped.bring_home()
    yield from (_read_all(mapped) for _ in range(SEVERAL))
    if mapped.motion.goto:
        for side in (0, 1):
            mapped.go(
                "a limit of each axis", {name: axis.limits[side] for name, axis in mapped.motion.state.axes.items()}
            )
            yield from (_read_all(mapped) for _ in range(SEVERAL))


def _read_all(mapped: MappedDevice) -> Told:
    state, values, exchanges = mapped.motion.state, dict[str, dict[str, float]](), dict[str, Exchange]()
    own = {name: axis.at for name, axis in state.axes.items()}
    for call, pointers in {state.read: own, **state.agrees}.items():
        exchange, document = mapped.get(call)
        values[call], exchanges[call] = numbers_at(document, pointers), exchange
    return Told(values, exchanges)


@scenario(needs=_NEEDS, stage=Stage.DRIVE)
def switched(mapped: MappedDevice) -> tuple[Switched, ...]:
    """Set each switch to each of its values, and at last to the first again."""
    if not mapped.motion.switches:
        raise NotDeclaredError("the map has no [motion.switches]")
    return recorded(
        _switch(mapped, name, value)
        for name, switch in mapped.motion.switches.items()
        for value in (*switch.values, switch.values[0])
    )


def _switch(mapped: MappedDevice, name: str, value: object) -> Switched:
    switch = mapped.motion.switches[name]
    command = mapped.send(mapped.request_of(switch, {"value": value}))
    shown, wanted = None, switch.shown(value)
    for _ in poll_for(mapped.clock, _STEP_S, switch.within_s):
        shown = _shown(mapped, name)
        if shown == wanted:
            break
    arrived = shown == wanted
    mapped.clock.sleep(STAYS_S)
    later = _shown(mapped, name)
    return Switched(name, value, command, later if arrived else shown, arrived, later == wanted)


def _shown(mapped: MappedDevice, name: str) -> object:
    switch = mapped.motion.switches[name]
    try:
        return at(mapped.get(switch.read or mapped.motion.state.read)[1], switch.at)
    except NoValueError:
        return None
