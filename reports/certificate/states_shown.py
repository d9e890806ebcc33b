"""Which operation a device took in which of its states, from the traces of a run, as a grid for the certificate."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

from reports.certificate.moves_drawn import messages, traces_in
from reports.errors import ReportError

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from pathlib import Path

# States and operations that are shown.
_MOST: Final = 40


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
        states = tuple(map(str, walk["states"]))[:_MOST]
        steps = {(item["operation"], item["state"]): bool(item["taken"]) for item in walk["steps"]}
        names = list(walk["operations"])[:_MOST]
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
