"""Find the file and line that a code host links to a test case.

The line is in the vendor's statement, or in the contract's ledger, the file that lists its requirements. result.json
has the lines (`places`). The robot's source code is unknown, so a case links to the claim in the statement.
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
        file: path of the file relative to the directory in which the run was started, with `/`.
        line: number of the line, counted from 1.
    """

    file: str
    line: int


def places_of(result: Mapping[str, Any], case: Case) -> list[Place]:
    """Return the lines where the vendor claims the case's class and where the contract defines the requirement.

    The list has at least one place; a place that result.json does not know is left out.
    """
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
