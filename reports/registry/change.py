"""What changed between two firmwares, by the rules of `roaas diff`, from what their certificates carry."""

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
    """Two certificates of one robot.

    Attributes:
        old: of the firmware before.
        new: of the firmware after.
        found: requirement by requirement, or None where one of the two was signed before certificates named them.
    """

    old: Certificate
    new: Certificate
    found: Difference | None

    @property
    def classes(self) -> list[tuple[str, str, str]]:
        """Classes whose verdict changed: name, before, after."""
        before, after = self.old.run.classes, self.new.run.classes
        names = dict.fromkeys((*before, *after))
        courses = ((name, before.get(name, "not-claimed"), after.get(name, "not-claimed")) for name in names)
        return [course for course in courses if course[1] != course[2]]


def firmware_changes(latest_first: tuple[Certificate, ...]) -> list[FirmwareChange]:
    """Each firmware beside the one before it, the latest first."""
    return [FirmwareChange(old, new, _difference(old.run, new.run)) for new, old in pairwise(latest_first)]


def _difference(old: Run, new: Run) -> Difference | None:
    return difference(_as_result(old), _as_result(new)) if old.outcomes and new.outcomes else None


def _as_result(run: Run) -> Mapping[str, Any]:
    """What a certificate says, in the shape of the result that it was made from, as far as a comparison reads it."""
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
