"""Where a reader is sent for a case: a line of the vendor's statement, or of the contract's ledger.

result.json says where things stand (`places`). Robots have no source code that a code host could show: what a vendor
can look at, and change, is the claim in its statement.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from reports.formats.cases import Case

_UNKNOWN = "requirements.toml"


@dataclass(frozen=True, slots=True)
class Place:
    """A line of a file.

    Attributes:
        file: its path relative to where the run was started, with `/`.
        line: counted from 1.
    """

    file: str
    line: int


def places_of(result: Mapping[str, Any], case: Case) -> list[Place]:
    """Where the robot promises to keep it, and where the contract asks for it; at least one of the two."""
    return list(_places(result, case))


def _places(result: Mapping[str, Any], case: Case) -> Iterator[Place]:
    known = result.get("places", {})
    statement, ledger = known.get("statement"), known.get("ledger")
    if statement:
        yield Place(statement["file"], statement["classes"].get(case.class_name, statement["line"]))
    stated = [one for one in (ledger, known.get("generic_ledger")) if one and case.name in one["lines"]]
    if stated:
        yield Place(stated[0]["file"], stated[0]["lines"][case.name])
    elif not statement:
        yield Place(ledger["file"] if ledger else _UNKNOWN, 1)
