"""Build the table of robots and conformance classes that the pages of a fleet and of a registry show."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from enum import Enum


class Mark(Enum):
    """The content of a table cell for a robot and a class: colour tone, sign and words. Only TRUSTED is green."""

    TRUSTED = ("good", "✓", "passed")
    ACCEPTED = ("warning", "!", "passed except for accepted failures")
    FAILED = ("bad", "✗", "failed")
    INCONCLUSIVE = ("warning", "?", "could not be judged")
    STALE = ("quiet", "○", "passed, but does not count")
    NOT_CLAIMED = ("quiet", "·", "not claimed")

    @property
    def tone(self) -> str:
        """Return the name of the cell's CSS class, which sets its colour."""
        return self.value[0]

    @property
    def sign(self) -> str:
        """Return the sign that the cell shows, such as "✓"."""
        return self.value[1]

    @property
    def words(self) -> str:
        """Return the meaning of the sign in words, for screen readers."""
        return self.value[2]


_OF_VERDICT = {"fail": Mark.FAILED, "inconclusive": Mark.INCONCLUSIVE, "not-claimed": Mark.NOT_CLAIMED}


@dataclass(frozen=True, slots=True)
class Row:
    """The table row of one robot.

    Attributes:
        name: the robot's name.
        marks: content of the cells, by the name of the conformance class.
        tone: CSS class of `word`.
        word: the verdict on the robot as a whole, shown beside the name.
        notes: lines under the name.
        href: relative link to the robot's page, or empty.
        until: RFC 3339 time after which no cell is green, or empty.
    """

    name: str
    marks: Mapping[str, Mark]
    tone: str
    word: str
    notes: tuple[str, ...] = ()
    href: str = ""
    until: str = ""


@dataclass(frozen=True)
class Matrix:
    """The table: its rows, and the titles of the conformance classes by name."""

    rows: tuple[Row, ...]
    titles: Mapping[str, str] = field(default_factory=dict)

    @property
    def classes(self) -> tuple[str, ...]:
        """Return the columns: the names of all classes in the rows, in the order of their first occurrence."""
        return tuple(dict.fromkeys(name for row in self.rows for name in row.marks))

    def trusted(self, row: Row) -> str:
        """Return the numbers (from 0) of a row's green columns, separated by spaces.

        The page's filter uses numbers, so that no class name enters the CSS.
        """
        numbers = (number for number, name in enumerate(self.classes) if row.marks.get(name) is Mark.TRUSTED)
        return " ".join(map(str, numbers))


def marks(classes: Mapping[str, str], trusted: Iterable[str], *, stands: bool = True) -> dict[str, Mark]:
    """Return the table cell content for each class of a robot.

    Args:
        classes: the verdict of each class.
        trusted: the classes that passed without an accepted failure.
        stands: False if no class may be green, because the result does not count.
    """
    green = set(trusted)
    found = {}
    for name, verdict in classes.items():
        passed = Mark.STALE if not stands else Mark.TRUSTED if name in green else Mark.ACCEPTED
        found[name] = _OF_VERDICT.get(verdict, passed)
    return found
