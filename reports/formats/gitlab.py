"""Write what code hosts show beside a change: GitLab's code quality report, and GitHub's annotations.

A fingerprint depends only on the requirement, so that the same failure is the same entry in every run, whatever values
the robot returned. A requirement without a verdict is an entry as well.
"""

import json
from collections.abc import Mapping
from typing import Any

from reports.formats.cases import MESSAGE, Case, Outcome, cases, places_of, worst_first
from reports.pages.untrusted import excerpt, on_a_line

_SEVERITIES = {Outcome.FAILED: "critical", Outcome.ERROR: "major", Outcome.ACCEPTED: "minor", Outcome.WARNING: "minor"}


def gitlab(result: Mapping[str, Any]) -> str:
    """Return a valid `roaas-result/1` document as a GitLab code quality report (JSON text)."""
    return json.dumps([_entry(result, case) for case in worst_first(cases(result))], indent=1) + "\n"


def _entry(result: Mapping[str, Any], case: Case) -> dict[str, Any]:
    place = places_of(result, case)[0]
    return {
        "description": excerpt(f"{case.name}: {case.message}", MESSAGE),
        "check_name": case.rule,
        "fingerprint": case.fingerprint,
        "severity": _SEVERITIES[case.outcome],
        "location": {"path": place.file, "lines": {"begin": place.line}},
    }


MOST = 10  # GitHub shows ten errors and ten warnings of a step, and silently drops the rest


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
