"""Who may do what: robots by conformance classes, as the pages of a fleet and of a registry show them."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from enum import Enum


class Mark(Enum):
    """What stands where a robot meets a class: tone, sign and words; green is one of them alone."""

    TRUSTED = ("good", "✓", "passed")
    ACCEPTED = ("warning", "!", "passed but for failures that are accepted")
    FAILED = ("bad", "✗", "failed")
    INCONCLUSIVE = ("warning", "?", "could not be judged")
    STALE = ("quiet", "○", "passed, and does not count")
    NOT_CLAIMED = ("quiet", "·", "not claimed")

    @property
    def tone(self) -> str:
        """Class of the style sheet."""
        return self.value[0]

    @property
    def sign(self) -> str:
        """What is read where colours are not."""
        return self.value[1]

    @property
    def words(self) -> str:
        """What is read aloud."""
        return self.value[2]


_OF_VERDICT = {"fail": Mark.FAILED, "inconclusive": Mark.INCONCLUSIVE, "not-claimed": Mark.NOT_CLAIMED}


@dataclass(frozen=True, slots=True)
class Row:
    """One robot.

    Attributes:
        name: of the robot.
        marks: by class.
        tone: of the word beside the name.
        word: what is said of the robot as a whole.
        notes: lines in small print under the name.
        href: page of the robot, made by us, or empty.
        until: RFC 3339 time after which nothing of it is green, or empty.
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
    """The rows, and the classes that at least one of them speaks of, in the order of their first mention."""

    rows: tuple[Row, ...]
    titles: Mapping[str, str] = field(default_factory=dict)

    @property
    def classes(self) -> tuple[str, ...]:
        """The columns."""
        return tuple(dict.fromkeys(name for row in self.rows for name in row.marks))

    def trusted(self, row: Row) -> str:
        """Numbers of the columns that are green in a row, for the filter: no name goes into the style sheet."""
        numbers = (number for number, name in enumerate(self.classes) if row.marks.get(name) is Mark.TRUSTED)
        return " ".join(map(str, numbers))


def marks(classes: Mapping[str, str], trusted: Iterable[str], *, stands: bool = True) -> dict[str, Mark]:
    """What stands at each class.

    Args:
        classes: verdict of each.
        trusted: those that passed without an accepted failure.
        stands: whether anything may be green.
    """
    green = set(trusted)
    found = {}
    for name, verdict in classes.items():
        passed = Mark.STALE if not stands else Mark.TRUSTED if name in green else Mark.ACCEPTED
        found[name] = _OF_VERDICT.get(verdict, passed)
    return found
