"""Write CTRF, the Common Test Report Format: one JSON format for the many tools that show test results.

| outcome | becomes |
|---|---|
| passed, warning | `passed`; a warning has its message |
| failed, error | `failed`: readers show `other` without a colour, and a case without a verdict must not look green |
| accepted | `other` |
| skipped | `skipped` |
"""

import datetime as dt
import json
from collections.abc import Mapping
from typing import Any

from reports.formats.cases import MESSAGE, Case, Outcome, cases, places_of
from reports.pages.untrusted import excerpt, visible

_SPEC = "0.0.0"
_STATUSES = {
    Outcome.PASSED: "passed",
    Outcome.WARNING: "passed",
    Outcome.FAILED: "failed",
    Outcome.ERROR: "failed",
    Outcome.ACCEPTED: "other",
    Outcome.SKIPPED: "skipped",
}


def ctrf(result: Mapping[str, Any]) -> str:
    """Return a valid `roaas-result/1` document as a CTRF report (JSON text)."""
    tests = [_test(result, case) for case in cases(result)]
    statuses = [test["status"] for test in tests]
    start = _milliseconds(result["started"])
    counts = {name: statuses.count(name) for name in ("passed", "failed", "skipped", "pending", "other")}
    report = {
        "reportFormat": "CTRF",
        "specVersion": _SPEC,
        "generatedBy": "roaas",
        "results": {
            "tool": {"name": "RoAAS", "version": result["suite"]["version"]},
            "summary": {
                "tests": len(tests),
                **counts,
                "start": start,
                "stop": _milliseconds(result["finished"]) if result["finished"] else start,
            },
            "tests": tests,
            "environment": _environment(result),
            "extra": {"verdict": result["verdict"], "seed": result["seed"], "effort": result["effort"]},
        },
    }
    return json.dumps(report, indent=1) + "\n"


def _test(result: Mapping[str, Any], case: Case) -> dict[str, Any]:
    place = places_of(result, case)[0]
    return {
        "name": case.name,
        "status": _STATUSES[case.outcome],
        "rawStatus": case.outcome,
        # The time of a single requirement is not measured.
        "duration": 0,
        "suite": [case.class_name or "roaas"],
        "filePath": place.file,
        "line": place.line,
        **({"tags": [case.requirement["level"]]} if case.requirement else {}),
        **({"message": excerpt(case.message, MESSAGE)} if case.message else {}),
        **({"trace": visible(case.detail)} if case.message and case.detail else {}),
    }


def _environment(result: Mapping[str, Any]) -> dict[str, str]:
    robot = result["statement"]["robot"]
    named = {"appName": robot.get("name"), "appVersion": robot.get("version")}
    return {key: excerpt(value, 200) for key, value in named.items() if value}


def _milliseconds(time: str) -> int:
    return round(dt.datetime.fromisoformat(time).timestamp() * 1000)
