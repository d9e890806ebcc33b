"""What the certificate shows of a device that is judged by its own description: its operations, and what was called."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

WORDS = {"conformant": "Keeps its own description", "not-conformant": "Does not keep its own description"}
"""The verdict in words: such a device conforms to no contract, and its report is no certificate of conformance."""
DESCRIBED_CLASS = "description"
"""The class that only such a device has."""
_MEASURES = {
    "operations": "Operations called",
    "parameters": "Parameters sent",
    "statuses": "Declared statuses seen",
    "branches": "Members of responses seen",
}


@dataclass(frozen=True, slots=True)
class Status:
    """A status of an operation.

    Attributes:
        code: as it was received, or as the description writes it if it did not occur.
        count: how often it occurred.
        declared: whether the description declares it, by itself, its class or `default`, or need not declare it.
    """

    code: str
    count: int
    declared: bool


@dataclass(frozen=True, slots=True)
class Row:
    """An operation that might be called."""

    entry: Mapping[str, Any]

    @property
    def method(self) -> str:
        """Return the method."""
        return str(self.entry["operation"]).partition(" ")[0]

    @property
    def path(self) -> str:
        """Return the path, with its parameters in braces."""
        return str(self.entry["operation"]).partition(" ")[2]

    @property
    def findings(self) -> list[int]:
        """Return the numbers of the findings that concern it."""
        return list(self.entry.get("findings", ()))

    @property
    def statuses(self) -> list[Status]:
        """Return the statuses that occurred, then the declared ones that did not."""
        declared, seen = self.entry["declared"], set(self.entry.get("seen_declared", ()))
        known = [*declared, *self.entry.get("need_no_declaration", ())]
        found = [Status(code, count, _is_declared(code, known)) for code, count in self.entry["statuses"].items()]
        return found + [Status(code, 0, declared=True) for code in declared if code not in seen]

    @property
    def slowest(self) -> str:
        """Return the time of the slowest response with its unit; empty if there was none."""
        milliseconds = self.entry["slowest_ms"]
        if not self.entry["statuses"]:
            return ""
        return f"{milliseconds / 1000:.1f} s" if milliseconds >= 1000 else f"{milliseconds:.0f} ms"  # noqa: PLR2004 - ms


@dataclass(frozen=True, slots=True)
class Measure:
    """How much of one kind of thing in the description the run reached."""

    name: str
    reached: int
    all: int

    @property
    def percent(self) -> int:
        """Return the share in percent, rounded down."""
        return 100 * self.reached // self.all if self.all else 0


@dataclass(frozen=True, slots=True)
class Described:
    """The operations of a device that is judged by its own description, and what was called of them."""

    api: Mapping[str, Any]

    @property
    def name(self) -> str:
        """Return title and version of the description."""
        return f"{self.api.get('title', '')} {self.api.get('version', '')}".strip()

    @property
    def rows(self) -> list[Row]:
        """Return the operations that might be called, those with findings first, otherwise in their order."""
        rows = [Row(entry) for entry in self.api["operations"] if entry["called"]]
        return sorted(rows, key=lambda row: not row.findings)

    @property
    def unshown(self) -> list[Row]:
        """Return the operations that never answered 2xx, of which it is known what they need."""
        return [row for row in self.rows if "needs" in row.entry]

    @property
    def left_behind(self) -> list[str]:
        """Return in which state the run left the device, a line for each kind of change."""
        return list(self.api.get("left_behind", {}).get("lines", ()))

    @property
    def measures(self) -> list[Measure]:
        """Return how much of the description the run reached, each kind of thing that the description has."""
        found = [(name, self.api["coverage"].get(key, (0, 0))) for key, name in _MEASURES.items()]
        return [Measure(name, reached, whole) for name, (reached, whole) in found if whole]

    @property
    def uncalled(self) -> Iterator[tuple[str, list[Row]]]:
        """Yield each reason for which operations were not called, with those operations."""
        groups: dict[str, list[Row]] = {}
        for entry in self.api["operations"]:
            if not entry["called"]:
                groups.setdefault(entry["reason"], []).append(Row(entry))
        yield from groups.items()

    @property
    def extent(self) -> str:
        """Return in a sentence how many operations were called."""
        called, whole = self.api["coverage"]["operations"]
        rest = "" if called == whole else " This report says nothing of the others."
        return f"{called} of {whole} operations {'was' if called == 1 else 'were'} called.{rest}"


def _is_declared(code: str, declared: list[str]) -> bool:
    return not {code, f"{code[:1]}XX", f"{code[:1]}xx", "default"}.isdisjoint(declared)


def description_of(result: Mapping[str, Any]) -> Described | None:
    """Return what a result tells of the device's own description; None if it was judged by a contract.

    An operation has the findings that name it, and those of the web server whose request is a call of it.
    """
    if "api" not in result:
        return None
    aside = result.get("web_server", {}).get("requirements", ())
    found = [(str(one.get("subject")), one.get("number")) for item in aside for one in item["failures"]]
    operations = [
        entry | {"findings": sorted({*entry.get("findings", ()), *_of(entry["operation"], found)})}
        for entry in result["api"]["operations"]
    ]
    return Described({**result["api"], "operations": operations})


def _of(operation: str, found: list[tuple[str, Any]]) -> list[int]:
    return [number for subject, number in found if number and subject.partition("?")[0] == operation]
