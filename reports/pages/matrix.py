"""A table of robots and conformance classes, as the pages of a fleet and of a registry show it."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from enum import Enum


class Mark(Enum):
    """The cell of a robot and a class: tone, sign and words. Only TRUSTED is green."""

    TRUSTED = ("good", "✓", "passed")
    ACCEPTED = ("warning", "!", "passed except for accepted failures")
    FAILED = ("bad", "✗", "failed")
    INCONCLUSIVE = ("warning", "?", "could not be judged")
    STALE = ("quiet", "○", "passed, but does not count")
    NOT_CLAIMED = ("quiet", "·", "not claimed")

    @property
    def tone(self) -> str:
        """Return the class in the style sheet."""
        return self.value[0]

    @property
    def sign(self) -> str:
        """Return the sign beside the colour."""
        return self.value[1]

    @property
    def words(self) -> str:
        """Return the words that a screen reader reads."""
        return self.value[2]


_OF_VERDICT = {"fail": Mark.FAILED, "inconclusive": Mark.INCONCLUSIVE, "not-claimed": Mark.NOT_CLAIMED}


@dataclass(frozen=True, slots=True)
class Row:
    """One robot.

    Attributes:
        name: of the robot.
        marks: by class.
        tone: style of the word beside the name.
        word: the verdict on the robot as a whole.
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
    """The rows, and the classes that occur in them, in the order of their first occurrence."""

    rows: tuple[Row, ...]
    titles: Mapping[str, str] = field(default_factory=dict)

    @property
    def classes(self) -> tuple[str, ...]:
        """Return the columns."""
        return tuple(dict.fromkeys(name for row in self.rows for name in row.marks))

    def trusted(self, row: Row) -> str:
        """Return the numbers of a row's green columns; the filter uses numbers, so that no name enters the CSS."""
        numbers = (number for number, name in enumerate(self.classes) if row.marks.get(name) is Mark.TRUSTED)
        return " ".join(map(str, numbers))


def marks(classes: Mapping[str, str], trusted: Iterable[str], *, stands: bool = True) -> dict[str, Mark]:
    """Return the mark of each class.

    Args:
        classes: the verdict of each class.
        trusted: the classes that passed without an accepted failure.
        stands: whether any class may be green.
    """
    green = set(trusted)
    found = {}
    for name, verdict in classes.items():
        passed = Mark.STALE if not stands else Mark.TRUSTED if name in green else Mark.ACCEPTED
        found[name] = _OF_VERDICT.get(verdict, passed)
    return found
