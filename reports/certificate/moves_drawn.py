"""Pictures for the certificate from the traces of a run: how a device moved (SVG), and what it took in which state."""

from __future__ import annotations

import math
import re
import zlib
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

from reports.errors import ReportError
from reports.given_files import parsed, read_octets, unzipped

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence
    from pathlib import Path

# States and operations that are shown.
_MOST_STATES: Final = 40


@dataclass(frozen=True)
class Cell:
    """One operation in one state.

    Attributes:
        sign: in a word or two.
        tone: good, bad or quiet.
        words: the same for whoever does not see it.
    """

    sign: str
    tone: str
    words: str


@dataclass(frozen=True)
class Grid:
    """All operations in all states.

    Attributes:
        states: their names.
        rows: by operation, a cell for each state.
    """

    states: tuple[str, ...]
    rows: dict[str, tuple[Cell, ...]]

    @property
    def wrong(self) -> int:
        """How many cells have a finding."""
        return sum(cell.tone == "bad" for row in self.rows.values() for cell in row)


def grid(folder: Path, result: Mapping[str, Any]) -> Grid | None:
    """Return the grid of a run with the class ``states``; None without readable traces."""
    try:
        walk, named = traces_in(folder)["walked"], messages(result, "states")
        states = tuple(map(str, walk["states"]))[:_MOST_STATES]
        steps = {(item["operation"], item["state"]): bool(item["taken"]) for item in walk["steps"]}
        names = list(walk["operations"])[:_MOST_STATES]
        return Grid(states, {name: tuple(_cells(name, states, steps, named)) for name in names})
    except (ReportError, ValueError, LookupError, TypeError, AttributeError, RecursionError):
        return None


def _cells(
    name: str, states: tuple[str, ...], steps: Mapping[tuple[str, str], bool], named: list[str]
) -> Iterator[Cell]:
    for state in states:
        if (name, state) not in steps:
            yield Cell("·", "quiet", "never sent")
            continue
        was = "taken" if steps[name, state] else "refused"
        place = re.compile(rf"{re.escape(f'{name} in {state}')}(?!\w)")
        wrong = any(place.search(message) for message in named)
        yield (
            Cell(f"✗ {was}", "bad", f"{was}, and wrong")
            if wrong
            else Cell(f"✓ {was}", "good", f"{was}, as the map says")
        )


TRACES_NAME: Final = "traces.json.gz"
_MOST = 30  # pictures in a certificate
_POINTS = 160  # points of a line
WIDTH, HEIGHT = 300, 64  # size of one axis's drawing, CSS pixels
_MARGIN: Final = 4
# Smaller moves are not enlarged beyond this share of an axis's range.
_LEAST: Final = 0.2


@dataclass(frozen=True)
class Line:
    """One axis in a picture.

    Attributes:
        name: the name of the axis.
        points: of the device's way, as an SVG polyline.
        wanted: of the targets, as SVG polylines.
        low, high: the values at the lower and the upper edge.
    """

    name: str
    points: str
    wanted: tuple[str, ...]
    low: str
    high: str


@dataclass(frozen=True)
class Picture:
    """One move or drive.

    Attributes:
        what: it was, as a noun phrase.
        lines: one for each axis that moved, or was to move.
        commands: where commands were accepted on the time axis, in CSS pixels.
        refused: where they were refused.
        seconds: how long it lasted.
        failed: whether a finding names it.
    """

    what: str
    lines: tuple[Line, ...]
    commands: tuple[float, ...]
    refused: tuple[float, ...]
    seconds: float
    failed: bool


def pictures(folder: Path, result: Mapping[str, Any]) -> list[Picture]:
    """Return pictures of the moves of a run, those that a finding names first.

    Args:
        folder: where the run's files are; without readable traces there are no pictures.
        result: the run's result, with the class ``motion``.
    """
    try:
        named = messages(result, "motion")
        moves = list(_moves(traces_in(folder)))
        ranges = _ranges(moves)
        drawn = [_picture(item, named, ranges) for item in moves]
    except (ReportError, ArithmeticError, ValueError, LookupError, TypeError, AttributeError, RecursionError):
        return []
    return sorted(filter(None, drawn), key=lambda picture: not picture.failed)[:_MOST]


def traces_in(folder: Path) -> dict[str, Any]:
    """Return the traces of a run by scenario.

    Raises:
        ReportError, ValueError, RecursionError: they cannot be read.
    """
    octets = unzipped(read_octets(folder / TRACES_NAME, root=folder), zlib.MAX_WBITS | 16)
    found: dict[str, Any] = parsed(octets.decode("utf-8"))
    return found


def messages(result: Mapping[str, Any], of_class: str) -> list[str]:
    """Return what the findings of a class say."""
    failures = (item.get("failures", ()) for item in result["requirements"] if item["class"] == of_class)
    return [failure.get("message", "") for found in failures for failure in found]


def _moves(traces: Mapping[str, Any]) -> Iterator[Mapping[str, Any]]:
    """Yield what is a move or a drive: it has commands, and readings with positions."""
    for trace in traces.values():
        for item in trace if isinstance(trace, list) else [trace]:
            if isinstance(item, dict) and "what" in item and ("readings" in item or "under_way" in item):
                yield item


def _readings(move: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    return [*move.get("readings", ()), *move.get("under_way", ()), *move.get("after", ())]


def _ranges(moves: Iterable[Mapping[str, Any]]) -> dict[str, float]:
    """Return how far each axis, and each velocity, ranges in the whole run."""
    found: dict[str, list[float]] = {}
    for item in (reading for move in moves for reading in _readings(move)):
        for name, value in (*item.get("values", {}).items(), *item.get("speeds", {}).items()):
            found.setdefault(name, []).append(value)
    return {name: max(values) - min(values) for name, values in found.items()}


def _picture(move: Mapping[str, Any], named: Iterable[str], ranges: Mapping[str, float]) -> Picture | None:
    readings = _readings(move)
    commands = [*move["commands"], *([move["end"]] if move.get("end") else [])]
    if not readings or not commands:
        return None
    start, end = commands[0]["sent"], max(reading["received"] for reading in readings)
    if end <= start:
        return None

    def x_of(moment: float) -> float:
        return float(round(max(0.0, moment - start) / (end - start) * WIDTH, 1))

    is_drive = "wanted" in move
    wanted = [(x_of(command["sent"]), command["targets"]) for command in commands if _ok(command)]
    lines = []
    for name in _drawn_axes(readings, move.get("wanted")):
        key = "speeds" if name in readings[0].get("speeds", {}) else "values"
        seen = [
            ((reading["sent"] + reading["received"]) / 2, reading[key][name])
            for reading in readings
            if name in reading.get(key, {})
        ]
        # A velocity is no position, even if both have the same name.
        aims = [] if is_drive and key == "values" else wanted
        lines.append(_line(name, [(x_of(moment), value) for moment, value in seen], aims, _LEAST * ranges[name]))
    return Picture(
        what=move["what"],
        lines=tuple(filter(None, lines)),
        commands=tuple(x_of(command["sent"]) for command in commands if _ok(command)),
        refused=tuple(x_of(command["sent"]) for command in commands if not _ok(command)),
        seconds=end - start,
        failed=any(move["what"] in text for text in named),
    )


def _drawn_axes(readings: Sequence[Mapping[str, Any]], velocities: Mapping[str, float] | None) -> list[str]:
    """Return what is drawn: of a drive its velocities, and positions too where one of them is told by its axis."""
    told = _axes(readings, "speeds") if velocities is not None else []
    others = [axis for axis in _axes(readings, "values") if axis not in told]
    driven = {name for name, value in (velocities or {}).items() if value}
    return told if told and driven <= set(told) else [*others, *told]


def _axes(readings: Sequence[Mapping[str, Any]], key: str) -> list[str]:
    return list(dict.fromkeys(name for reading in readings for name in reading.get(key, {})))


def _ok(command: Mapping[str, Any]) -> bool:
    status: int = command["exchange"]["response"]["status"]
    return 200 <= status < 300  # noqa: PLR2004 - RFC 9110 15.3


def _line(
    name: str, seen: list[tuple[float, float]], targets: list[tuple[float, dict[str, float]]], least: float
) -> Line | None:
    """Draw one axis, from edge to edge at least so much; None if nothing was read of it."""
    if not seen:
        return None
    aims = [(x, given[name]) for x, given in targets if name in given]
    values = [value for _, value in [*seen, *aims]]
    low, high = min(values), max(values)
    span = max(high - low, least) or 1.0
    base = (low + high - span) / 2
    digits = max(0, min(6, 2 - math.floor(math.log10(span))))

    def at(x: float, value: float) -> str:
        return f"{x:g},{HEIGHT - _MARGIN - (value - base) / span * (HEIGHT - 2 * _MARGIN):.1f}"

    thin = max(1, len(seen) // _POINTS)
    ends = [*(x for x, _ in aims[1:]), float(WIDTH)] if aims else []
    return Line(
        name=name,
        points=" ".join(at(x, value) for x, value in [*seen[::thin], seen[-1]]),
        wanted=tuple(f"{at(x, value)} {at(end, value)}" for (x, value), end in zip(aims, ends, strict=True)),
        low=f"{round(base, digits) + 0.0:.{digits}f}",
        high=f"{round(base + span, digits) + 0.0:.{digits}f}",
    )
