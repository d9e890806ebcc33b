"""The progress of ``roaas selftest``: one line on stderr for each result."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from proof.mutation.table import Mutant
    from proof.selftest.comparison import Comparison, Settings, Tool, ToolResult
    from proof.selftest.controls import ControlResult
    from proof.selftest.generated.judging import GeneratedResult
    from proof.selftest.mutant_run import MutantResult, Pool
    from proof.selftest.report import Report


class Progress:
    """Writes progress to stderr and adds each result to the report, so that an interrupted run keeps it."""

    def __init__(self, report: Report, total: int) -> None:
        self.total = total
        self._report = report
        self._done = 0
        self._controls = 0

    def mutant(self, result: MutantResult) -> None:
        """Report the result of a hand-written mutant."""
        self._report.mutant_results.append(result)
        self._done += 1
        said = result.not_tried or (
            f"SURVIVED {', '.join(result.survived)}" if result.survived else f"killed by {_few(result)}"
        )
        click.echo(f"[{self._done}/{self.total}] {result.mutant.name}: {said} ({result.seconds:.1f} s)", err=True)

    def by_rule(self, result: GeneratedResult) -> None:
        """Report the result of a generated mutant."""
        self._report.generated_results.append(result)
        self._done += 1
        by = f" by {result.by[0]}" if result.by else ""
        line = f"[{self._done}/{self.total}] {result.mutant.name}: {result.outcome}{by} ({result.seconds:.1f} s)"
        click.echo(line, err=True)

    def tell_compared(self, comparison: Comparison, result: ToolResult) -> None:
        """Report the result of another tool on a mutant."""
        comparison.results.append(result)
        said = f"killed: {result.findings[0]}" if result.killed else "survived"
        click.echo(f"[{len(comparison.results)}] {comparison.tool}, {result.mutant}: {said}"[:400], err=True)

    def control(self, result: ControlResult) -> None:
        """Report the result of a good device."""
        self._report.control_results.append(result)
        self._controls += 1
        name = f"{result.robot} {result.variant}".strip()
        said = result.not_tried or (
            "conformant"
            if result.conformant
            else f"FALSE POSITIVE: {result.false_positives or result.unjudged or 'given up'}"
        )
        click.echo(f"[{self._controls}/{self.total}] {name}, seed {result.seed}: {said}"[:400], err=True)


def _few(result: MutantResult) -> str:
    rest = len(result.killed_by) - len(result.mutant.catches)
    return ", ".join(result.mutant.catches) + (f" and {rest} more" if rest > 0 else "")


def compare(
    report: Report,
    pool: Pool,
    mutants: Iterable[Mutant],
    progress: Progress,
    settings: Callable[[Tool], Settings] | None = None,
) -> None:
    """Run other tools on the REST mutants, and add the results: Specmatic only if ``settings`` makes the settings."""
    from proof.selftest import comparison  # noqa: PLC0415 - it costs what --help need not pay

    plain = comparison.schemathesis()
    if plain is None:
        report.notes.append("Schemathesis' command line is not installed, so that nothing was compared with it.")
        return
    mutants = list(mutants)
    chosen = settings(plain) if settings else comparison.Settings()
    beside = comparison.specmatic() if settings else None
    for tool in filter(None, (plain, beside)):
        one = comparison.Comparison(tool.name)
        report.compared.append(one)
        one.good = comparison.compare(pool, mutants, tool, chosen, partial(progress.tell_compared, one))
    report.notes.append(
        f"Schemathesis ran with all checks, --max-examples {chosen.examples}, phases {chosen.phases}, and at most "
        f"{chosen.limit_s:g} s for each mutant; findings that it has of the good device as well do not count."
    )
    if settings and beside is None:
        report.notes.append("Specmatic is not installed (pip install specmatic, and a Java), so that it was not run.")
