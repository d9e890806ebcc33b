"""``roaas selftest --generated``: a sample of the mutants by rule, in place of those made by hand."""

from __future__ import annotations

import fnmatch
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from conformance.contract.pack import Contract
    from conformance.selftest.comparison import SchemathesisResult
    from conformance.selftest.generated.judging import GeneratedResult
    from conformance.selftest.generated.mutant import GeneratedMutant
    from conformance.selftest.report import Report


def chosen_mutants(contract: Contract, options: dict[str, Any]) -> list[GeneratedMutant]:
    """Return the sample that the options ask for.

    Raises:
        click.UsageError: no mutant has such a name.
    """
    from conformance.selftest.generated.catalogue import generated_mutants  # noqa: PLC0415 - see selftest.py
    from conformance.selftest.generated.sampling import sample  # noqa: PLC0415 - see selftest.py

    patterns = options["patterns"] or ("*",)
    every = generated_mutants(contract)
    fitting = [one for one in every if any(fnmatch.fnmatch(one.name, pattern) for pattern in patterns)]
    if not fitting:
        raise click.UsageError(f"no mutant by rule has a name like {', '.join(patterns)}; --list shows them")
    return sample(fitting, options["generated"], options["seed"])


def run_generated(report: Report, mutants: list[GeneratedMutant], options: dict[str, Any], *, compared: bool) -> None:
    """Judge them, and with ``compared`` let plain Schemathesis try those of REST; the report has each as it is done.

    Raises:
        RobotError: the robot does not start.
    """
    from conformance.selftest import comparison  # noqa: PLC0415 - see selftest.py
    from conformance.selftest.generated.judging import judge  # noqa: PLC0415 - see selftest.py
    from conformance.selftest.mutant_run import RobotPool  # noqa: PLC0415 - see selftest.py
    from conformance.selftest.robots import target_of  # noqa: PLC0415 - see selftest.py

    done = 0

    def tell(result: GeneratedResult) -> None:
        nonlocal done
        done += 1
        report.generated_results.append(result)
        by = f" by {result.by[0]}" if result.by else ""
        name = result.mutant.name
        click.echo(f"[{done}/{len(mutants)}] {name}: {result.outcome}{by} ({result.seconds:.1f} s)", err=True)

    efforts = ("quick", "standard") if options["effort"] == "quick" else ("standard",)
    target = target_of(report.contract, report.target)
    with RobotPool(report.contract, target, options["parallel"], options["domain_id"]) as pool:
        report.generated_results = judge(pool, mutants, efforts=efforts, tell=tell)
        if compared and comparison.command() is not None:
            rest = [mutant.as_mutant() for mutant in mutants if mutant.interface == "rest"]
            tried = 0

            def tell_theirs(seen: SchemathesisResult) -> None:
                nonlocal tried
                tried += 1
                report.compared.append(seen)
                said = f"killed: {seen.findings[0]}" if seen.killed else "survived"
                click.echo(f"[{tried}/{len(rest)}] Schemathesis, {seen.mutant}: {said}", err=True)

            good, report.compared = comparison.compare(pool, rest, tell=tell_theirs)
            report.good = tuple(sorted(f"{operation} {code}" for operation, code in good))
