"""Write GitLab's code quality report, from which a merge request shows new and resolved failures.

A fingerprint depends only on the requirement, so that the same failure is the same entry in every run, whatever values
the robot returned. A requirement without a verdict is an entry as well.
"""

import json
from collections.abc import Mapping
from typing import Any

from reports.formats.cases import MESSAGE, Case, Outcome, cases, places_of, worst_first
from reports.pages.untrusted import excerpt

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
