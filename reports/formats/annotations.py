"""Write GitHub workflow commands: the ten worst test cases as annotations, and the number of the others.

GitHub shows ten errors and ten warnings of a step and silently drops the rest.
"""

from collections.abc import Mapping
from typing import Any

from reports.formats.cases import MESSAGE, Case, Outcome, cases, places_of, worst_first
from reports.pages.untrusted import on_a_line

MOST = 10


def annotations(result: Mapping[str, Any]) -> str:
    """Return a valid `roaas-result/1` document as GitHub workflow commands, one per line."""
    found = worst_first(cases(result))
    lines = [_command(result, case) for case in found[:MOST]]
    if len(found) > MOST:
        lines.append(f"::notice title=RoAAS::{len(found) - MOST} more are in the job summary and in certificate.html")
    return "".join(f"{line}\n" for line in lines)


def _command(result: Mapping[str, Any], case: Case) -> str:
    place = places_of(result, case)[0]
    command = "error" if case.outcome in {Outcome.FAILED, Outcome.ERROR} else "warning"
    title = f"{case.name} ({case.outcome})"
    properties = f"file={_property(place.file)},line={place.line},title={_property(title)}"
    return f"::{command} {properties}::{_data(on_a_line(case.message, MESSAGE))}"


def _data(text: str) -> str:
    """Escape `%`, carriage return and line feed, so that text from a robot cannot start another workflow command."""
    return text.replace("%", "%25").replace("\r", "%0D").replace("\n", "%0A")


def _property(text: str) -> str:
    return _data(on_a_line(text, MESSAGE)).replace(":", "%3A").replace(",", "%2C")
