"""What a self-test says in the end: selftest.json, and a summary for people."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pathlib import Path

    from conformance.selftest.comparison import Seen
    from conformance.selftest.controls import Acquittal
    from conformance.selftest.mutant_run import Catch


@dataclass
class Report:
    """Everything that a self-test has found.

    Attributes:
        target: the good robot behind the faults.
        catches: by faulty robot.
        acquittals: by good robot.
        compared: what Schemathesis caught; good: what it reports of the good robot.
        notes: remarks.
    """

    target: str
    catches: list[Catch] = field(default_factory=list)
    acquittals: list[Acquittal] = field(default_factory=list)
    compared: list[Seen] = field(default_factory=list)
    good: tuple[str, ...] = ()
    notes: list[str] = field(default_factory=list)
    seconds: float = 0.0

    @property
    def tried(self) -> list[Catch]:
        """Faults that were tried."""
        return [catch for catch in self.catches if not catch.unseen]

    @property
    def missed(self) -> list[Catch]:
        """Faults that a requirement missed which has to catch them."""
        return [catch for catch in self.tried if catch.missed]

    @property
    def blamed(self) -> list[Acquittal]:
        """Good robots that were not acquitted."""
        return [acquittal for acquittal in self.acquittals if not acquittal.acquitted]

    @property
    def holds(self) -> bool:
        """Whether all is caught and nobody is blamed, and something was tried."""
        return bool(self.tried or self.acquittals) and not self.missed and not self.blamed

    def document(self) -> dict[str, Any]:
        """selftest.json."""
        return {
            "format": "roaas-selftest/1",
            "holds": self.holds,
            "target": self.target,
            "seconds": round(self.seconds, 1),
            "notes": self.notes,
            "faults": [
                {
                    "name": catch.fault.name,
                    "says": catch.fault.says,
                    "interface": catch.fault.interface,
                    "must": list(catch.fault.catches),
                    "caught": list(catch.caught),
                    "missed": list(catch.missed),
                    "reasons": catch.reasons,
                    "effort": catch.effort,
                    "not_tried": catch.unseen,
                    "runs": catch.runs,
                    "seconds": round(catch.seconds, 2),
                }
                for catch in self.catches
            ],
            "good_robots": [
                {
                    "robot": acquittal.robot,
                    "variant": acquittal.variant,
                    "seed": acquittal.seed,
                    "acquitted": acquittal.acquitted,
                    "not_tried": acquittal.unseen,
                    "exit_code": acquittal.outcome.exit_code if acquittal.outcome else None,
                    "blamed": acquittal.blamed,
                    "unjudged": acquittal.unjudged,
                    "requests": acquittal.outcome.requests if acquittal.outcome else 0,
                    "seconds": round(acquittal.outcome.seconds, 2) if acquittal.outcome else 0.0,
                }
                for acquittal in self.acquittals
            ],
            "schemathesis": {
                "of_the_good_robot": list(self.good),
                "faults": [
                    {"name": seen.fault, "caught": seen.caught, "findings": list(seen.findings)}
                    for seen in self.compared
                ],
            },
        }

    def write(self, out: Path) -> Path:
        """Write selftest.json and selftest.md, and return the former's path.

        Raises:
            OSError: it cannot be written.
        """
        out.mkdir(parents=True, exist_ok=True)
        path = out / "selftest.json"
        path.write_text(json.dumps(self.document(), indent=2, ensure_ascii=False) + "\n", encoding="utf-8")
        (out / "selftest.md").write_text(self.matrix(), encoding="utf-8")
        return path

    def matrix(self) -> str:
        """The matrix, as a table: each faulty robot, and the requirements that caught it."""
        compared = {seen.fault: seen.caught for seen in self.compared}
        lines = [
            "# Faulty robots, and what caught them",
            "",
            f"Target behind the proxy: {self.target}. {self.summary().splitlines()[0]}",
            "",
            "| faulty robot | what is wrong with it | caught by | missed by | plain Schemathesis |",
            "|---|---|---|---|---|",
        ]
        for catch in self.catches:
            ours = [id_ for id_ in catch.caught if id_ in catch.fault.catches]
            others = len(catch.caught) - len(ours)
            caught = ", ".join(f"`{id_}`" for id_ in ours) + (f" and {others} more" if others else "")
            known = {True: "caught", False: "not caught"}.get(compared.get(catch.fault.name))  # type: ignore[arg-type] # None is no key
            missed = ", ".join(f"`{id_}`" for id_ in catch.missed)
            lines.append(
                f"| {catch.fault.name} | {catch.fault.says} | {catch.unseen or caught} | {missed} | {known or ''} |"
            )
        return "\n".join(lines) + "\n"

    def summary(self) -> str:
        """What a person wants to know, in a few lines."""
        tried, missed = len(self.tried), len(self.missed)
        lines = []
        if tried:
            requirements = {id_ for catch in self.tried for id_ in catch.fault.catches if id_ not in catch.missed}
            lines.append(
                f"{tried - missed} of {tried} faulty robots caught ({100 * (tried - missed) / tried:.1f} %), "
                f"by {len(requirements)} requirements"
            )
        unseen = [catch for catch in self.catches if catch.unseen]
        if unseen:
            lines.append(f"{len(unseen)} not tried, first {unseen[0].fault.name}: {unseen[0].unseen}")
        for catch in self.missed:
            said = "; ".join(f"{id_} said {catch.reasons.get(id_, 'nothing')[:200]}" for id_ in catch.missed)
            lines.append(f"MISSED {catch.fault.name} ({catch.fault.says}) {said}")
        if self.acquittals:
            good = [one for one in self.acquittals if one.outcome is not None]
            lines.append(
                f"{len(good) - len(self.blamed)} of {len(good)} certifications of good robots found them conformant"
            )
        for one in self.blamed:
            where = f" ({one.variant})" if one.variant else ""
            said = "; ".join(f"{id_}: {why[:200]}" for id_, why in {**one.blamed, **one.unjudged}.items())
            code = one.outcome.exit_code if one.outcome else "none"
            lines.append(f"BLAMED {one.robot}{where}, seed {one.seed}, exit code {code}: {said}")
        if self.compared:
            theirs = {seen.fault for seen in self.compared if seen.caught}
            ours = {catch.fault.name for catch in self.tried if not catch.missed} & {
                seen.fault for seen in self.compared
            }
            lines.append(
                f"Of {len(self.compared)} faults of REST, the plain Schemathesis command line caught {len(theirs)}, "
                f"this suite {len(ours)}; of the good robot it reports {len(self.good)} findings"
            )
        return "\n".join([*lines, *self.notes])
