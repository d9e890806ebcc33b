"""Draw a right and a wrong move for the requirements of motion, from recorded moves of the simulated devices.

PYTHONPATH=tests python tests/conformance/motion/pictures.py docs/motion
"""

import sys
from functools import cache
from pathlib import Path

import careless
from simulated import MUTANTS, RULES, cases_of, played

from conformance.measures.samples import SEVERAL
from conformance.rules.motion.judging import legs_of
from conformance.scenarios.motion.trace import Quiet, Switched, Told

# The mutant that shows what each requirement forbids.
WRONG = {
    "reaches": ("arm", "short:pan"),
    "stays": ("arm", "comes-back"),
    "way": ("arm", "beyond:pan"),
    "speed": ("arm", "too-fast"),
    "stop": ("arm", "stop-ignored"),
    "stop-lasts": ("arm", "stop-resumes"),
    "new-target": ("arm", "second-then-first"),
    "last-of-many": ("arm", "second-ignored"),
    "repeated": ("arm", "second-stops"),
    "beyond-limits": ("rover", "beyond:x"),
    "velocity": ("rover", "velocity-slow:x"),
    "velocity-stop": ("rover", "velocity-stop-creeps"),
    "hold": ("rover", "hold-short"),
    "watchdog": ("rover", "watchdog-late"),
    "fresh": ("arm", "stale"),
    "stamp": ("arm", "stamp-stuck"),
    "agrees": ("rover", "elsewhere-in-other-units"),
    "action-runs": ("arm", "action-running-as-stopped"),
    "action-succeeds": ("arm", "action-early"),
    "action-canceled": ("arm", "action-stopped-as-done"),
    "switches": ("rover", "grip-ignored"),
    "one-client": ("careless", "mixes"),
    "refused-still": ("careless", "refused"),
    "incomplete-still": ("careless", "incomplete"),
    "unauthorised-still": ("careless", "unauthorised"),
}
_WIDTH, _HEIGHT, _MARGIN = 300, 90, 8
_COLOURS = {"right": "#2f7d4f", "wrong": "#c2410c"}


@cache
def _traces(device, mutant=""):
    """Return the traces of a device by the name of the scenario, and what rules may ask for."""
    if device == "careless":
        return careless.played(mutant)
    found = list(played(device, MUTANTS[device][mutant] if mutant else None))
    return {scenario.name: trace for scenario, trace, _ in found}, found[-1][2]


def parts_of(trace):
    """Return what is judged alone: legs, drives, readings of one moment by several operations, or the whole."""
    if isinstance(trace, Quiet):
        return [trace, *trace.alone]
    if isinstance(trace, tuple) and trace and isinstance(trace[0], Told):
        return [trace[start : start + SEVERAL] for start in range(0, len(trace), SEVERAL)]
    return [trace] if isinstance(trace[0] if isinstance(trace, tuple) else trace, Switched) else legs_of(trace)


def shown(requirement):
    """Return the same move of a right and of a wrong device, of which the wrong one breaks a requirement."""
    device, mutant = WRONG[requirement]
    (right, _), (wrong, given) = _traces(device), _traces(device, mutant)
    rules = [one for one in RULES if one.requirement == f"motion/{requirement}"]
    pairs = [(rule, scenario.name) for rule in rules for scenario in rule.on if scenario.name in wrong]
    for rule, name in pairs:
        trace = wrong[name]
        if isinstance(trace, Quiet):
            if not all(one.holds for one in cases_of(rule, trace, given)):
                moved = max(trace.alone, key=lambda one: _spread([reading.values["pan"] for reading in one.readings]))
                return right[name], moved, given["motion"]
            continue
        for index, part in enumerate(parts_of(trace)):
            judged = part if isinstance(part, tuple) or not isinstance(trace, tuple) else (part,)
            if not all(one.holds for one in cases_of(rule, judged, given)):
                return parts_of(right[name])[index], part, given["motion"]
    raise LookupError(f"no move of {mutant} breaks motion/{requirement}")


def readings_of(part):
    """Return the readings of a leg, a drive or of attempts, that have all positions."""
    return [one for one in part.readings if one.values]


def drawn(requirement):
    """Return an SVG image: on the left a right device, on the right a wrong one."""
    right, wrong, motion = shown(requirement)
    if isinstance(right, tuple):
        made = _of_switches if isinstance(right[0], Switched) else _of_operations
        panels = [made(part, left, title) for part, left, title in _sides(right, wrong)]
    else:
        axis, value = _axis_of(requirement, [readings_of(right), readings_of(wrong)], motion)
        every = [value(one) for part in (right, wrong) for one in readings_of(part)]
        if hasattr(right, "start") and requirement != "stamp":
            every += [one.targets[axis] for part in (right, wrong) for one in part.commands if axis in one.targets]
        edges = min(every), max(every)
        words = requirement.startswith("action-")
        panels = [_panel(part, value, axis, edges, left, title, words) for part, left, title in _sides(right, wrong)]
    width = 2 * _WIDTH + 20
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{_HEIGHT + 20}" font-family="sans-serif" '
        f'font-size="12">{"".join(panels)}</svg>\n'
    )


def _sides(right, wrong):
    return (right, 0, "right"), (wrong, _WIDTH + 20, "wrong")


def _axis_of(requirement, both, motion):
    """Return what is drawn over time: the stamp, or the axis that moves most."""
    if requirement == "stamp":
        first = {id(one): readings[0].stamp for readings in both for one in readings}
        return "stamp", lambda one: one.stamp - first[id(one)]
    axis = max(motion.state.axes, key=lambda name: _spread([one.values[name] for readings in both for one in readings]))
    return axis, lambda one: one.values[axis]


def _spread(values):
    return max(values) - min(values)


def _frame(left, text):
    return (
        f'<rect x="{left}" width="{_WIDTH}" height="{_HEIGHT}" fill="none" stroke="#bbb"/>'
        f'<text x="{left}" y="{_HEIGHT + 15}" fill="#777">{text}</text>'
    )


def _of_operations(part, left, title):
    """Draw what several operations tell of one velocity, a bar for each."""
    told = part[-1].values
    most = max(abs(one) for values in told.values() for one in values.values()) or 1.0
    bars = []
    for number, (call, values) in enumerate(told.items()):
        (name, value), top = next(iter(values.items())), 10 + 38 * number
        length = (_WIDTH - 2 * _MARGIN) * abs(value) / most
        bars.append(
            f'<rect x="{left + _MARGIN}" y="{top}" width="{length:.1f}" height="10" fill="{_COLOURS[title]}"/>'
            f'<text x="{left + _MARGIN}" y="{top + 25}" fill="#777">{call}: {name} {value:.2f}</text>'
        )
    return _frame(left, f"{title}: {part[-1].when}") + "".join(bars)


def _of_switches(part, left, title):
    """Draw what a switch was set to, and what was read a moment later."""
    lines = [f"{one.switch} set to {one.value}: shows {one.shown}" for one in part]
    texts = "".join(
        f'<text x="{left + _MARGIN}" y="{24 + 22 * number}" fill="{_COLOURS[title]}">{line}</text>'
        for number, line in enumerate(lines)
    )
    return _frame(left, title) + texts


def _panel(part, value, axis, edges, left, title, words):
    readings, commands = readings_of(part), getattr(part, "commands", ())
    begin, end = min(one.sent for one in (*commands, *readings)), max(one.received for one in readings)
    span, (low, high) = max(end - begin, 1e-9), edges

    def x(moment):
        return left + _MARGIN + (_WIDTH - 2 * _MARGIN) * (moment - begin) / span

    def y(number):
        return _HEIGHT - _MARGIN - (_HEIGHT - 2 * _MARGIN) * (number - low) / max(high - low, 1e-9)

    points = " ".join(f"{x(one.sent):.1f},{y(value(one)):.1f}" for one in readings)
    ticks = {f"{x(one.sent):.0f}" for one in (*commands, *filter(None, [getattr(part, "end", None)]))}
    ends = [*(one.sent for one in commands[1:]), end]
    wanted = "".join(
        f'<path d="M{x(one.sent):.1f} {y(one.targets[axis]):.1f}H{x(until):.1f}" stroke="#888" stroke-dasharray="4 3"/>'
        for one, until in zip(commands, ends, strict=bool(commands))
        if hasattr(part, "start") and axis in one.targets and one.is_ok
    )
    marks = "".join(f'<path d="M{tick} {_HEIGHT - 4}v-8" stroke="#888"/>' for tick in sorted(ticks))
    said = [
        one
        for before, one in zip([None, *readings], readings, strict=False)
        if words and (before is None or before.action != one.action)
    ]
    texts = "".join(
        f'<text x="{x(one.sent) + 4:.1f}" y="{34 + 14 * number}" fill="#777">{one.action}</text>'
        for number, one in enumerate(said)
    )
    return (
        f"{_frame(left, f'{title}: {axis}, {span:.1f} s')}{wanted}{marks}{texts}"
        f'<polyline points="{points}" fill="none" stroke="{_COLOURS[title]}" stroke-width="2"/>'
    )


def main(folder):
    """Write the images."""
    Path(folder).mkdir(parents=True, exist_ok=True)
    for requirement in WRONG:
        (Path(folder) / f"{requirement}.svg").write_text(drawn(requirement), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1])
