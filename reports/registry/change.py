"""Compare the certificates of a robot's firmware versions by the rules of `roaas diff`."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import msgspec

from reports.attestation.statement import Run
from reports.certificate.difference import Difference, difference
from reports.registry.entries import Certificate


@dataclass(frozen=True)
class FirmwareChange:
    """The comparison of the certificates of two successive firmware versions of one robot.

    Attributes:
        old: certificate of the older firmware.
        new: certificate of the newer firmware.
        found: the changed requirements, or None if one certificate is too old to list its requirements.
    """

    old: Certificate
    new: Certificate
    found: Difference | None

    @property
    def classes(self) -> list[tuple[str, str, str]]:
        """Return the conformance classes whose verdict changed, as (name, verdict before, verdict after)."""
        before, after = self.old.run.classes, self.new.run.classes
        names = dict.fromkeys((*before, *after))
        courses = ((name, before.get(name, "not-claimed"), after.get(name, "not-claimed")) for name in names)
        return [course for course in courses if course[1] != course[2]]


def firmware_changes(latest_first: tuple[Certificate, ...]) -> list[FirmwareChange]:
    """Return the changes between successive firmware versions, the latest first.

    The argument holds one certificate for each firmware, the latest first.
    """
    return [FirmwareChange(old, new, _difference(old.run, new.run)) for new, old in pairwise(latest_first)]


def _difference(old: Run, new: Run) -> Difference | None:
    return difference(_as_result(old), _as_result(new)) if old.outcomes and new.outcomes else None


def _as_result(run: Run) -> Mapping[str, Any]:
    """Return the certificate's facts as a partial `roaas-result/1` document that `difference` can compare."""
    accepted = set(run.accepted)
    return {
        "requirements": [
            {
                "id": id_,
                "level": level,
                "text": "",
                "verdict": verdict,
                "reason": "",
                **({"expected_failure": {}} if id_ in accepted else {}),
            }
            for level, verdicts in run.outcomes.items()
            for verdict, ids in verdicts.items()
            for id_ in ids
        ],
        "statement": {"robot": msgspec.to_builtins(run.robot), "motion_allowed": run.motion_allowed},
        "target": {},
        "suite": msgspec.to_builtins(run.suite),
        "requirement_set": msgspec.to_builtins(run.requirement_set),
        "effort": run.effort,
        "seed": run.seed,
        "baseline": {"digest": run.baseline},
        "verdict": run.verdict,
    }
