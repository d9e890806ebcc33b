"""Judge generated mutants: a pack's (``roaas selftest --generated``), or those of a running device (``--api``)."""

from __future__ import annotations

import fnmatch
import tempfile
import time
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

import click

from conformance.api.call_rules import CallRules
from conformance.contract.pack import Contract
from conformance.contract.toml_file import basic_string
from conformance.documents.description import DescriptionError
from conformance.documents.openapi import operations_of
from conformance.statement.endpoints import Endpoints
from conformance.target.describing import described_contract
from conformance.transport.reach import UnreachableError
from proof.selftest.generated.mutant import GeneratedMutant
from proof.selftest.report import Report

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from proof.mutation.table import Mutant
    from proof.selftest.comparison import Comparison, Settings, Tool, ToolResult
    from proof.selftest.controls import ControlResult
    from proof.selftest.generated.judging import GeneratedResult
    from proof.selftest.mutant_run import MutantResult, Pool


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


def described_device(options: dict[str, Any]) -> tuple[Contract, str]:
    """Return the contract of the device's description, and the URL below which its operations are.

    Raises:
        click.UsageError: there is no usable description.
    """
    from conformance.target.connecting import connection_of  # noqa: PLC0415 - see selftest.py

    try:
        contract, where, _ = described_contract(
            options["api"], (), options["base_url"], Endpoints(), connection_of(Endpoints()), options["out"]
        )
    except (DescriptionError, UnreachableError, OSError) as error:
        raise click.UsageError(str(error)) from error
    return contract, str(where.rest)


def chosen_of_api(contract: Contract, base_url: str, options: dict[str, Any]) -> tuple[list[GeneratedMutant], int]:
    """Return the sample of mutants of the operations that may be called, and how many there are.

    Raises:
        click.UsageError: no mutant has such a name.
    """
    from proof.selftest.generated.adversary import compose, kinds_in_requests, sample  # noqa: PLC0415 - see selftest.py
    from proof.selftest.generated.described import described_mutants  # noqa: PLC0415 - see selftest.py

    called, patterns = set(callable_operations(contract, options)), options["patterns"] or ("*",)
    every = described_mutants(contract, urlsplit(base_url).path.rstrip("/"))
    every = tuple(mutant for mutant in every if mutant.exchange.name in called)
    if options["adversary"]:
        every = compose(every, kinds_in_requests(contract))
    fitting = [mutant for mutant in every if any(fnmatch.fnmatch(mutant.name, pattern) for pattern in patterns)]
    if not fitting:
        raise click.UsageError(f"no mutant of an operation that may be called has a name like {', '.join(patterns)}")
    return sample(fitting, options["generated"] or options["adversary"], options["seed"]), len(every)


def callable_operations(contract: Contract, options: dict[str, Any]) -> tuple[str, ...]:
    """Return the operations that the options allow to be called."""
    rules = CallRules(options["allow"], options["never"])
    return tuple(item.label for item in operations_of(contract) if rules.decide(item).may)


def run_api(
    report: Report, base_url: str, chosen: list[GeneratedMutant], options: dict[str, Any], *, compared: bool
) -> None:
    """Judge the unchanged device and the mutants, and add the results to the report."""
    from proof.selftest.comparison import best_settings  # noqa: PLC0415 - see selftest.py
    from proof.selftest.generated.adversary import Recorder, unreached_names  # noqa: PLC0415 - as above
    from proof.selftest.generated.judging import judge  # noqa: PLC0415 - as above
    from proof.selftest.mutant_run import DescribedPool, run_unchanged  # noqa: PLC0415 - as above

    progress = Progress(report, len(chosen))
    with tempfile.TemporaryDirectory() as folder:
        statement = Path(folder) / "calls.toml"
        allow, never = (", ".join(map(basic_string, options[key])) for key in ("allow", "never"))
        statement.write_text(f"[calls]\nallow = [{allow}]\nnever = [{never}]\n", encoding="utf-8")
        with DescribedPool(report.contract, base_url, statement, options["parallel"]) as pool:
            seen = Recorder()
            unchanged = run_unchanged(pool, "standard", change=seen)
            report.blamed = {id_: unchanged.reasons.get(id_, "") for id_ in unchanged.not_passed()}
            for id_, reason in report.blamed.items():
                click.echo(f"the unchanged device: {id_}: {reason}"[:400], err=True)
            efforts = ("quick", "standard") if options["effort"] == "quick" else ("standard",)
            started = time.monotonic()
            report.generated_results = judge(
                pool,
                chosen,
                efforts=efforts,
                seed=options["seed"],
                unreached=unreached_names(chosen, seen.messages),
                tell=progress.by_rule,
            )
            report.notes.append(
                f"A run of the unchanged device took {unchanged.seconds:.0f} s at standard effort with "
                f"{unchanged.requests} requests; the mutants took {time.monotonic() - started:.0f} s."
            )
            if compared:
                operations = callable_operations(report.contract, options)
                mutants = [mutant.as_mutant() for mutant in chosen]
                as_long = partial(best_settings, pool, operations=operations, seconds=unchanged.seconds)
                compare(report, pool, mutants, progress, as_long)


def chosen_mutants(contract: Contract, options: dict[str, Any]) -> tuple[list[GeneratedMutant], int]:
    """Return the sample of generated mutants that the options select, and how many there are.

    Raises:
        click.UsageError: no mutant has such a name.
    """
    from proof.selftest.generated.adversary import compose, kinds_in_requests, sample  # noqa: PLC0415 - see selftest.py
    from proof.selftest.generated.catalogue import generated_mutants, open_place  # noqa: PLC0415 - as above

    patterns = options["patterns"] or ("*",)
    every = generated_mutants(contract)
    if options["adversary"]:
        made = compose(every, kinds_in_requests(contract))
        every = tuple(mutant for mutant in made if open_place(contract, mutant) is None)
    fitting = [mutant for mutant in every if any(fnmatch.fnmatch(mutant.name, pattern) for pattern in patterns)]
    if not fitting:
        raise click.UsageError(f"no mutant by rule has a name like {', '.join(patterns)}; --list shows them")
    return sample(fitting, options["generated"] or options["adversary"], options["seed"]), len(every)


def run_generated(report: Report, mutants: list[GeneratedMutant], options: dict[str, Any], *, compared: bool) -> None:
    """Judge generated mutants, and add the results to the report; with ``compared``, also run Schemathesis on them.

    Raises:
        RobotError: the device does not start.
    """
    from proof.selftest.generated.adversary import Recorder, unreached_names  # noqa: PLC0415 - see selftest.py
    from proof.selftest.generated.judging import judge  # noqa: PLC0415 - see selftest.py
    from proof.selftest.mutant_run import RobotPool, run_unchanged  # noqa: PLC0415 - see selftest.py
    from proof.selftest.robots import target_of  # noqa: PLC0415 - see selftest.py

    progress = Progress(report, len(mutants))
    efforts = ("quick", "standard") if options["effort"] == "quick" else ("standard",)
    target = target_of(report.contract, report.target)
    with RobotPool(report.contract, target, options["parallel"], options["domain_id"]) as pool:
        seen = Recorder()
        if options["adversary"]:
            click.echo("a whole run of the good device shows which faults would alter anything", err=True)
            run_unchanged(pool, efforts[-1], change=seen)
        never = unreached_names(mutants, seen.messages) if seen.messages else frozenset()
        report.generated_results = judge(pool, mutants, efforts=efforts, unreached=never, tell=progress.by_rule)
        if compared:
            compare(report, pool, [mutant.as_mutant() for mutant in mutants], progress)
