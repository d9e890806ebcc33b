"""Draw a right and a wrong move for the requirements of motion, from recorded moves of the simulated devices.

python tests/conformance/motion/pictures.py docs/motion
"""

import sys
from functools import cache
from pathlib import Path

from simulated import MUTANTS, RULES, cases_of, played

# The mutant that shows what each requirement forbids.
WRONG = {
    "reaches": ("arm", "short:pan"),
    "stays": ("arm", "comes-back"),
    "way": ("arm", "beyond:pan"),
    "speed": ("arm", "too-fast"),
    "stop": ("arm", "stop-ignored"),
    "stop-lasts": ("arm", "stop-resumes"),
    "new-target": ("arm", "second-then-first"),
    "last-of-many": ("arm", "dropped@third"),
    "repeated": ("arm", "short:pan"),
    "beyond-limits": ("rover", "beyond:x"),
    "velocity": ("rover", "velocity-slow:x"),
    "velocity-stop": ("rover", "velocity-stop-creeps"),
    "hold": ("rover", "hold-short"),
    "watchdog": ("rover", "watchdog-late"),
}
_WIDTH, _HEIGHT, _MARGIN = 300, 90, 8


@cache
def _right(device):
    """Return the traces of a right device by scenario."""
    return {scenario.name: trace for scenario, trace, _ in played(device)}


def parts_of(trace):
    """Return legs or drives."""
    return trace if isinstance(trace, tuple) else (trace,)


def shown(requirement):
    """Return the same move of a right and of a wrong device, of which the wrong one breaks a requirement."""
    device, mutant = WRONG[requirement]
    rule_ids = [rule for rule in RULES if rule.requirement == f"motion/{requirement}"]
    right = _right(device)
    for scenario, trace, given in played(device, MUTANTS[device][mutant]):
        for rule in rule_ids:
            for index, part in enumerate(parts_of(trace)) if scenario in rule.on else ():
                judged = (part,) if isinstance(trace, tuple) else part
                if not all(one.holds for one in cases_of(rule, judged, given)):
                    return parts_of(right[scenario.name])[index], part, given["motion"]
    raise LookupError(f"no move of {mutant} breaks motion/{requirement}")


def readings_of(part):
    """Return the readings of a leg or a drive."""
    return part.readings if hasattr(part, "readings") else (*part.under_way, *part.after)


def drawn(requirement):
    """Return an SVG image: on the left a right device, on the right a wrong one."""
    right, wrong, motion = shown(requirement)
    seen = [[one for one in readings_of(part) if one.values] for part in (right, wrong)]
    every = [one for readings in seen for one in readings]
    axis = max(motion.state.axes, key=lambda name: _spread([one.values[name] for one in every]))
    wanted = [one.targets[axis] for part in (right, wrong) for one in part.commands if axis in one.targets]
    values = [one.values[axis] for one in every] + (wanted if hasattr(right, "start") else [])
    low, high = min(values), max(values)
    panels = [
        _panel(part, readings, axis, (low, high), (_WIDTH + 20) * number, "right" if number == 0 else "wrong")
        for number, (part, readings) in enumerate(zip((right, wrong), seen, strict=True))
    ]
    width = 2 * _WIDTH + 20
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{_HEIGHT + 20}" font-family="sans-serif" '
        f'font-size="12">{"".join(panels)}</svg>\n'
    )


def _spread(values):
    return max(values) - min(values)


def _panel(part, readings, axis, edges, left, title):
    begin, end = part.commands[0].sent, max(one.received for one in readings)
    span, (low, high) = max(end - begin, 1e-9), edges

    def x(moment):
        return left + _MARGIN + (_WIDTH - 2 * _MARGIN) * (moment - begin) / span

    def y(value):
        return _HEIGHT - _MARGIN - (_HEIGHT - 2 * _MARGIN) * (value - low) / max(high - low, 1e-9)

    points = " ".join(f"{x(one.sent):.1f},{y(one.values[axis]):.1f}" for one in readings)
    colour = "#2f7d4f" if title == "right" else "#c2410c"
    ticks = {f"{x(one.sent):.0f}" for one in (*part.commands, *filter(None, [getattr(part, "end", None)]))}
    ends = [*(one.sent for one in part.commands[1:]), end]
    wanted = "".join(
        f'<path d="M{x(one.sent):.1f} {y(one.targets[axis]):.1f}H{x(until):.1f}" stroke="#888" stroke-dasharray="4 3"/>'
        for one, until in zip(part.commands, ends, strict=True)
        if hasattr(part, "start") and axis in one.targets and one.accepted
    )
    marks = "".join(f'<path d="M{tick} {_HEIGHT - 4}v-8" stroke="#888"/>' for tick in sorted(ticks))
    return (
        f'<rect x="{left}" width="{_WIDTH}" height="{_HEIGHT}" fill="none" stroke="#bbb"/>{wanted}{marks}'
        f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="2"/>'
        f'<text x="{left}" y="{_HEIGHT + 15}" fill="#777">{title}: {axis}, {span:.1f} s</text>'
    )


def main(folder):
    """Write the images."""
    Path(folder).mkdir(parents=True, exist_ok=True)
    for requirement in WRONG:
        (Path(folder) / f"{requirement}.svg").write_text(drawn(requirement), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1])
