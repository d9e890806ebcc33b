"""The content of fleet.json (format roaas-fleet/1), and the fleet's exit code."""

import datetime as dt
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from conformance.commandline.exit_codes import ExitCode
from conformance.commandline.out_folder import write_json
from conformance.engine.result import rfc3339
from conformance.engine.suite import suite_version
from conformance.fleet.member_run import EXIT_CODES, MemberResult, Outcome

FLEET_FORMAT = "roaas-fleet/1"
FLEET_NAME = "fleet.json"
ROBOTS_FOLDER = "robots"


def exit_code(results: Sequence[MemberResult], *, interrupted: bool) -> ExitCode:
    """Return 130 if the fleet was interrupted, otherwise the lowest exit code of its robots that is not 0.

    So a robot that does not conform (1) outranks one with a usage error (2), one that was not reached (3), and an
    inconclusive one (4).
    """
    if interrupted:
        return ExitCode.INTERRUPTED
    return min((code for result in results if (code := _code(result)) != ExitCode.PASSED), default=ExitCode.PASSED)


def _code(result: MemberResult) -> ExitCode:
    if result.exit_code == ExitCode.PASSED:  # also where a baseline accepts each failure
        return ExitCode.PASSED
    if result.outcome is Outcome.CONFORMANT and "stop_undelivered" in (result.document or {}):
        return ExitCode.INCONCLUSIVE
    return EXIT_CODES[result.outcome]


def fleet_document(
    results: Sequence[MemberResult], *, started: dt.datetime, finished: dt.datetime, parallel: int, interrupted: bool
) -> dict[str, Any]:
    """Return the content of fleet.json."""
    titles = {
        name: title
        for member_result in results
        for name, title in (member_result.document or {}).get("class_titles", {}).items()
    }
    return {
        "format": FLEET_FORMAT,
        "suite": {"version": suite_version()},
        "started": rfc3339(started),
        "finished": rfc3339(finished),
        "duration_s": round((finished - started).total_seconds(), 3),
        "parallel": parallel,
        "interrupted": interrupted,
        "exit_code": int(exit_code(results, interrupted=interrupted)),
        "outcomes": dict(Counter(str(result.outcome) for result in results)),
        "class_titles": titles,
        "robots": [_robot(result) for result in results],
    }


def write_fleet(document: dict[str, Any], directory: Path) -> Path:
    """Write fleet.json atomically; return its path.

    Raises:
        OSError: the file cannot be written.
    """
    directory.mkdir(parents=True, exist_ok=True)
    return write_json(directory / FLEET_NAME, document, indent=1, ensure_ascii=False)


def _robot(result: MemberResult) -> dict[str, Any]:
    document = result.document
    told: dict[str, Any] = {
        "name": result.member.name,
        "folder": f"{ROBOTS_FOLDER}/{result.member.name}",
        "outcome": str(result.outcome),
        "exit_code": result.exit_code,
        "reason": result.reason,
        "seconds": round(result.seconds, 3),
        "trusted": result.trusted_classes,
        "result": result.digest,
    }
    if document is not None:
        told |= {
            "robot": document["statement"]["robot"],
            "finished": document["finished"],
            "effort": document["effort"],
            "motion_allowed": document["statement"]["motion_allowed"],
            "requirement_set": document["requirement_set"],
            "classes": document["classes"],
            "accepted_until": document.get("accepted_until"),
            **({"stop_undelivered": document["stop_undelivered"]} if "stop_undelivered" in document else {}),
        }
    return told
