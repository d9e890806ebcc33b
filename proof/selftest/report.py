"""Write the results of a self-test: selftest.json, selftest.md and a summary for the terminal."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from conformance.commandline.out_folder import write_atomically, write_json
from conformance.contract.pack import DEFAULT_PACK, Contract
from conformance.verdict.finding import count_of
from proof.selftest.comparison import Comparison
from proof.selftest.controls import ControlResult
from proof.selftest.generated import report
from proof.selftest.generated import report as by_rule
from proof.selftest.generated.judging import KILLED, NOT_REACHED, GeneratedResult
from proof.selftest.mutant_run import MutantResult


@dataclass
class Report:
    """All results of one self-test.

    Attributes:
        contract: the pack.
        target: the good device behind the mutants.
        mutant_results: results of the hand-written mutants.
        control_results: results of the good devices.
        compared: what each other tool reports.
        notes: remarks for the reader.
        generated_results: results of the generated mutants.
        seed: seed of the sample of generated mutants.
        exist: how many generated mutants there are, of which the sample is.
        option: the option that asked for the sample: generated or adversary.
        blamed: requirements that the unchanged device does not pass, with the reason; None if it is a good device.
    """

    contract: Contract
    target: str
    mutant_results: list[MutantResult] = field(default_factory=list)
    control_results: list[ControlResult] = field(default_factory=list)
    compared: list[Comparison] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    seconds: float = 0.0
    generated_results: list[GeneratedResult] = field(default_factory=list)
    seed: int = 0
    exist: int = 0
    option: str = "generated"
    blamed: dict[str, str] | None = None

    @property
    def tried(self) -> list[MutantResult]:
        """Return the results of the mutants that were run."""
        return [result for result in self.mutant_results if not result.not_tried]

    @property
    def survived(self) -> list[MutantResult]:
        """Return the mutants that survived a requirement that must kill them."""
        return [result for result in self.tried if result.survived]

    @property
    def false_positives(self) -> list[ControlResult]:
        """Return the controls whose good device was not found conformant."""
        return [result for result in self.control_results if not result.conformant]

    @property
    def holds(self) -> bool:
        """Return whether all mutants were killed, no control was a false positive, and at least one run took place."""
        tried = bool(self.tried or self.control_results or self.generated_results)
        escaped = any(result.outcome not in {KILLED, NOT_REACHED} for result in self.generated_results)
        return tried and not self.survived and not self.false_positives and not escaped

    def document(self) -> dict[str, Any]:
        """Return the content of selftest.json, with the keys of the schema roaas-selftest/1."""
        return {
            "format": "roaas-selftest/1",
            "holds": self.holds,
            "target": self.target,
            "seconds": round(self.seconds, 1),
            "notes": self.notes,
            "faults": [
                {
                    "name": result.mutant.name,
                    "says": result.mutant.says,
                    "interface": result.mutant.interface,
                    "must": list(result.mutant.catches),
                    "caught": list(result.killed_by),
                    "missed": list(result.survived),
                    "reasons": result.reasons,
                    "effort": result.effort,
                    "not_tried": result.not_tried,
                    "runs": result.runs,
                    "seconds": round(result.seconds, 2),
                }
                for result in self.mutant_results
            ],
            "good_robots": [
                {
                    "robot": result.robot,
                    "variant": result.variant,
                    "seed": result.seed,
                    "acquitted": result.conformant,
                    "not_tried": result.not_tried,
                    "exit_code": result.outcome.exit_code if result.outcome else None,
                    "blamed": result.false_positives,
                    "unjudged": result.unjudged,
                    "requests": result.outcome.requests if result.outcome else 0,
                    "seconds": round(result.outcome.seconds, 2) if result.outcome else 0.0,
                }
                for result in self.control_results
            ],
            "compared": {
                comparison.tool: {
                    "of_the_good_robot": list(comparison.good),
                    "faults": [
                        {"name": seen.mutant, "caught": seen.killed, "findings": list(seen.findings)}
                        for seen in comparison.results
                    ],
                }
                for comparison in self.compared
            },
            **(
                {"generated": by_rule.document(self.exist, self.generated_results, self.seed)}
                if self.generated_results
                else {}
            ),
            **({} if self.blamed is None else {"false_alarms": self.blamed}),
        }

    def write(self, out: Path) -> Path:
        """Write selftest.json and selftest.md, and return the path of selftest.json.

        Raises:
            OSError: a file cannot be written.
        """
        out.mkdir(parents=True, exist_ok=True)
        path = out / "selftest.json"
        write_json(path, self.document(), indent=2, ensure_ascii=False)
        write_atomically(out / "selftest.md", self.matrix())
        return path

    def matrix(self) -> str:
        """Return Markdown tables: each mutant with the requirements that killed it; rates of generated mutants."""
        if self.blamed is not None:
            return report.page(self.target, self.generated_results, self.blamed, self.compared, self.notes)
        if self.generated_results:
            theirs = {seen.mutant: seen.killed for comparison in self.compared for seen in comparison.results}
            pack = "" if self.contract.name == DEFAULT_PACK else f" --contract {self.contract.name}"
            number = len(self.generated_results)
            command = f"roaas selftest --{self.option} {number} --seed {self.seed} --target {self.target}{pack}"
            return by_rule.rates_page(command, self.exist, self.generated_results, theirs, self.notes)
        compared = {
            seen.mutant: "killed" if seen.killed else "survived"
            for comparison in self.compared
            for seen in comparison.results
        }
        lines = [
            "# Mutants, and what killed them",
            "",
            f"Target behind the proxy: {self.target}. {self.summary().splitlines()[0]}",
            "",
            "| mutant | what is wrong with it | killed by | survived | plain Schemathesis |",
            "|---|---|---|---|---|",
        ]
        for result in self.mutant_results:
            ours = [id_ for id_ in result.killed_by if id_ in result.mutant.catches]
            others = len(result.killed_by) - len(ours)
            caught = ", ".join(f"`{id_}`" for id_ in ours) + (f" and {others} more" if others else "")
            known = compared.get(result.mutant.name, "")
            missed = ", ".join(f"`{id_}`" for id_ in result.survived)
            cells = (result.mutant.name, result.mutant.says, result.not_tried or caught, missed, known)
            lines.append(f"| {' | '.join(cells)} |")
        return "\n".join(lines) + "\n"

    def summary(self) -> str:
        """Return a summary of a few lines for the terminal."""
        tried, missed = len(self.tried), len(self.survived)
        lines = []
        if tried:
            requirements = {id_ for result in self.tried for id_ in result.mutant.catches if id_ not in result.survived}
            lines.append(
                f"{tried - missed} of {tried} mutants killed ({100 * (tried - missed) / tried:.1f} %), "
                f"by {count_of(len(requirements), 'requirement')}"
            )
        not_tried = [result for result in self.mutant_results if result.not_tried]
        if not_tried:
            lines.append(f"{len(not_tried)} not tried, first {not_tried[0].mutant.name}: {not_tried[0].not_tried}")
        for result in self.survived:
            said = "; ".join(f"{id_} said {result.reasons.get(id_, 'nothing')[:200]}" for id_ in result.survived)
            lines.append(f"SURVIVED {result.mutant.name} ({result.mutant.says}) {said}")
        if self.control_results:
            good = [control for control in self.control_results if control.outcome is not None]
            lines.append(
                f"{len(good) - len(self.false_positives)} of {len(good)} A/A controls (good devices) found conformant"
            )
        lines += [
            f"not tried: {control.robot} ({control.variant}): {control.not_tried}"
            for control in self.control_results
            if control.not_tried
        ]
        for control in self.false_positives:
            where = f" ({control.variant})" if control.variant else ""
            said = "; ".join(
                f"{id_}: {why[:200]}" for id_, why in {**control.false_positives, **control.unjudged}.items()
            )
            code = control.outcome.exit_code if control.outcome else "none"
            lines.append(f"FALSE POSITIVE {control.robot}{where}, seed {control.seed}, exit code {code}: {said}")
        if self.generated_results:
            lines.append(by_rule.summary(self.exist, self.generated_results))
        if self.blamed is not None:
            alarms = "; ".join(f"{id_}: {why[:200]}" for id_, why in self.blamed.items()) or "none"
            lines.append(f"False alarms on the unchanged device: {alarms}")
            only = report.only_theirs(self.generated_results, self.compared)
            lines += [f"KILLED BY {text}" for text in only]
        for other in self.compared:
            ours = {result.mutant.name for result in self.tried if not result.survived}
            ours |= {result.mutant.name for result in self.generated_results if result.outcome == KILLED}
            lines.append(
                f"Of {len(other.results)} mutants of REST, {other.tool} killed {len(other.killed)}, this suite "
                f"{len(ours & other.tried)}; of the good device it reports {count_of(len(other.good), 'finding')}"
            )
        return "\n".join([*lines, *self.notes])
