"""``roaas selftest``: show that the suite kills mutants (faulty devices) and has no false positives on good ones."""

from __future__ import annotations

import fnmatch
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from conformance.cli.contract import contract_option, load_pack
from conformance.commandline.exit_codes import ExitCode
from conformance.commandline.extras import lacking_soap
from conformance.commandline.help_pages import inert
from conformance.contract.locating import ContractError
from proof.cli.selftest_generated import Progress, compare

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from conformance.contract.pack import Contract
    from proof.mutation.self_test import GoodDevice, SelfTest
    from proof.mutation.table import Mutant
    from proof.selftest.against import Table
    from proof.selftest.report import Report

# Mutants that `--short` runs if the pack does not name them.
_SHORT = 15


@click.command()
@contract_option
@click.option(
    "--faults", "patterns", multiple=True, metavar="PATTERN", help="Only mutants whose names match (repeatable)."
)
@click.option(
    "--target",
    metavar="NAME",
    default="",
    show_default=False,
    help="The good device behind the mutants, by its name in the pack.  [default: the pack's first; with --generated, "
    "the one that starts fastest]",
)
@click.option("--seeds", type=click.IntRange(min=0), default=20, help="Seeds for each good device.")
@click.option("--short", is_flag=True, help="A dozen mutants and one seed, in less than a minute.")
@click.option("--controls-only", is_flag=True, help="Only the good devices (A/A controls), and no mutants.")
@click.option(
    "--effort",
    type=click.Choice(["quick", "standard"]),
    default="quick",
    help="Effort of the first run; a survivor is tested again at standard.",
)
@click.option(
    "--compare/--no-compare",
    default=True,
    help="Run the plain Schemathesis command line against REST mutants too; with --api, also Specmatic if installed.",
)
@click.option(
    "--variants/--no-variants",
    default=True,
    help="Judge good devices behind TLS, a prefix, a token and the like, and behind and on web servers.",
)
@click.option("--parallel", type=click.IntRange(min=1), default=2, help="Runs at once.")
@click.option("--domain-id", type=click.IntRange(0, 100), default=80, help="First ROS domain to use.")
@click.option(
    "--generated",
    type=click.IntRange(min=1),
    metavar="N",
    help="Judge N mutants made by rule from the pack's descriptions, in place of those made by hand.",
)
@click.option(
    "--adversary",
    type=click.IntRange(min=1),
    metavar="N",
    help="Judge N composed faults: the mutants of --generated, each at a time, for a client or for a class of values.",
)
@click.option(
    "--api",
    metavar="URL|FILE",
    help="With --generated or --adversary: put the mutants before the running device with this description. Only GET, "
    "HEAD and OPTIONS are sent, unless --call allows more.",
)
@click.option("--base-url", metavar="URL", help="With --api: where the operations of the description are.")
@click.option("--call", "allow", multiple=True, metavar="PATTERN", help="With --api: as in roaas certify; repeatable.")
@click.option("--never", multiple=True, metavar="PATTERN", help="With --api: as in roaas certify; repeatable.")
@click.option("--seed", type=int, default=0, help="Seed of the mutants' runs, and of the sample of generated ones.")
@click.option(
    "--against",
    multiple=True,
    type=click.Path(exists=True, path_type=Path),
    metavar="FILE",
    help="Compare with earlier results (selftest.json) or a yardstick, gzipped or not; repeatable. Exit code 1 then "
    "means that something is worse.",
)
@click.option(
    "--results",
    multiple=True,
    type=click.Path(exists=True, path_type=Path),
    metavar="FILE",
    help="With --against: compare these results, and run nothing; repeatable.",
)
@click.option("--list", "listed", is_flag=True, help="List the mutants, and run nothing.")
@click.option(
    "--out",
    type=click.Path(file_okay=False, path_type=Path),
    default=Path("out/selftest"),
    help="Folder for selftest.json and the matrix.",
)
@click.pass_context
def selftest(context: click.Context, /, **options: Any) -> None:
    """Show that the suite kills mutants (faulty devices) and has no false positives on good ones.

    Each mutant is a good device behind a proxy with one named change. Exit code: 0 all killed and no false positive;
    1 otherwise; 2 usage; 3 a device does not start; 130 interrupted.
    """
    if options["results"]:
        if not options["against"]:
            raise click.UsageError("--results are compared with those of --against: give both")
        sys.exit(int(_is_worse(load_pack(options["pack"]), _read(options["against"]), options["results"])))
    options["before"] = _read(options["against"]) if options["against"] else None
    if options["generated"] and options["adversary"]:
        raise click.UsageError("--generated and --adversary are two kinds of sample: give one of them")
    if options["api"]:
        _by_api(context, options)
        return
    contract = load_pack(options["pack"])
    try:
        if options["generated"] or options["adversary"]:
            _by_rule(context, contract, options)
        else:
            _by_hand(contract, options)
    except ContractError as error:
        raise click.UsageError(str(error)) from error


def _read(paths: Iterable[Path]) -> dict[str, Table]:
    """Return the tables of stored results.

    Raises:
        click.UsageError: a file cannot be read.
    """
    from proof.selftest.against import read  # noqa: PLC0415 - see _by_hand()

    try:
        return read(paths)
    except (OSError, ValueError) as error:
        raise click.UsageError(inert(str(error))) from error


def _is_worse(contract: Contract, before: dict[str, Table], results: Iterable[Path]) -> bool:
    """Print requirements and devices that are worse than in earlier results; return whether any is."""
    from proof.selftest.against import losses  # noqa: PLC0415 - see _by_hand()

    said = losses(before, _read(results), contract.ids_by_alias)
    click.echo("\n".join([*map(inert, said), f"{len(said)} differences to the worse" if said else "nothing is worse"]))
    return bool(said)


def _by_hand(contract: Contract, options: dict[str, Any]) -> None:
    """Judge hand-written mutants and A/A controls."""
    # Imported late: lxml and others cost time that --help need not pay.
    from proof.mutation.self_test import self_test_of  # noqa: PLC0415
    from proof.selftest.report import Report  # noqa: PLC0415

    if options["short"]:
        options.update(seeds=min(options["seeds"], 1), compare=False, variants=False)
    chosen = _choose(self_test_of(contract), options)
    if options["listed"]:
        for mutant in chosen:
            click.echo(f"{mutant.name:34} {mutant.says} [{', '.join(mutant.catches)}]")
        return
    report = Report(contract, _target(contract, options["target"]).name)
    _finish(report, lambda: _run(report, chosen, options), options)


def _target(contract: Contract, name: str) -> GoodDevice:
    """Return the good device with a name, or the pack's first if the name is empty.

    Raises:
        click.UsageError: the pack has no such device.
    """
    from proof.selftest.robots import RobotError, target_of  # noqa: PLC0415 - see _by_hand()

    try:
        return target_of(contract, name)
    except RobotError as error:
        raise click.UsageError(str(error)) from error


def _choose(needs: SelfTest, options: dict[str, Any]) -> list[Mutant]:
    """Return the hand-written mutants that the options select.

    Raises:
        click.UsageError: no mutant has such a name.
    """
    if options["controls_only"] or not (needs.mutants or options["patterns"]):
        return []
    short = needs.short or tuple(mutant.name for mutant in needs.mutants[:_SHORT])
    patterns = options["patterns"] or (short if options["short"] else ("*",))
    found = [mutant for mutant in needs.mutants if any(fnmatch.fnmatch(mutant.name, pattern) for pattern in patterns)]
    if not found:
        raise click.UsageError(f"no mutant has a name like {', '.join(patterns)}; --list shows them")
    if options["short"] and not options["patterns"]:
        # The slowest first, so that the others do not wait for it at the end.
        found.sort(key=lambda mutant: short.index(mutant.name))
    return found


def _by_rule(context: click.Context, contract: Contract, options: dict[str, Any]) -> None:
    """Judge generated mutants of the device that starts fastest; compare with Schemathesis only if requested."""
    from proof.cli.selftest_generated import chosen_mutants, run_generated  # noqa: PLC0415 - see _by_hand()
    from proof.mutation.self_test import self_test_of  # noqa: PLC0415 - see _by_hand()
    from proof.selftest.report import Report  # noqa: PLC0415 - see _by_hand()

    chosen, exist = chosen_mutants(contract, options)
    if options["listed"]:
        for mutant in chosen:
            click.echo(f"{mutant.name} {mutant.says}")
        return
    compared = options["compare"] and _is_given(context, "compare")
    target = _target(contract, options["target"] or self_test_of(contract).quick)
    report = Report(contract, target.name, seed=options["seed"], exist=exist, option=_option(options))
    _finish(report, lambda: run_generated(report, chosen, options, compared=compared), options)


def _by_api(context: click.Context, options: dict[str, Any]) -> None:
    """Judge generated mutants of a running device by its description."""
    from proof.cli.selftest_generated import chosen_of_api, described_device, run_api  # noqa: PLC0415 - see _by_hand()
    from proof.selftest.report import Report  # noqa: PLC0415 - see _by_hand()

    if not (options["generated"] or options["adversary"]):
        raise click.UsageError("--api takes mutants that are made by rule: say how many with --generated N")
    contract, base_url = described_device(options)
    chosen, exist = chosen_of_api(contract, base_url, options)
    if options["listed"]:
        for mutant in chosen:
            click.echo(f"{mutant.name} {mutant.says}")
        return
    report = Report(contract, base_url, seed=options["seed"], exist=exist, option=_option(options))
    compared = options["compare"] and _is_given(context, "compare")
    _finish(report, lambda: run_api(report, base_url, chosen, options, compared=compared), options)


def _option(options: dict[str, Any]) -> str:
    return "adversary" if options["adversary"] else "generated"


def _is_given(context: click.Context, name: str) -> bool:
    return context.get_parameter_source(name) is click.core.ParameterSource.COMMANDLINE


def _finish(report: Report, run: Callable[[], None], options: dict[str, Any]) -> None:
    """Run, write the results even after an interruption, and exit with the exit code."""
    from proof.selftest.robots import RobotError  # noqa: PLC0415 - see _by_hand()

    problem = lacking_soap(report.contract.interfaces, "'roaas selftest' of this contract")
    if problem:
        raise click.UsageError(problem)
    started, interrupted = time.monotonic(), False
    try:
        run()
    except RobotError as error:
        click.echo(str(error), err=True)
        sys.exit(ExitCode.UNREACHABLE)
    except KeyboardInterrupt:
        interrupted = True
        report.notes.append("The self-test was interrupted; this is what was judged until then.")
    report.seconds = time.monotonic() - started
    click.echo(report.summary())
    try:
        click.echo(f"result: {report.write(options['out'])}")
    except OSError as error:
        where = inert(str(options["out"]))
        click.echo(f"error: the result could not be written to {where}: {inert(str(error))}", err=True)
        sys.exit(ExitCode.INTERRUPTED if interrupted else ExitCode.INCONCLUSIVE)
    holds = report.holds
    if options["before"] is not None:
        holds = not _is_worse(report.contract, options["before"], [options["out"] / "selftest.json"])
    sys.exit(ExitCode.INTERRUPTED if interrupted else ExitCode.PASSED if holds else ExitCode.FAILED)


def _run(report: Report, chosen: list[Mutant], options: dict[str, Any]) -> None:
    from proof.selftest.mutant_run import RobotPool, run_mutants, run_unchanged  # noqa: PLC0415 - see _by_hand()

    progress = Progress(report, len(chosen))
    if chosen:
        target = _target(report.contract, report.target)
        with RobotPool(report.contract, target, options["parallel"], options["domain_id"]) as pool:
            already: frozenset[str] = frozenset()
            if not options["short"]:
                already = frozenset(run_unchanged(pool, options["effort"]).not_passed())
            report.mutant_results = run_mutants(
                pool, chosen, effort=options["effort"], seed=options["seed"], already=already, tell=progress.mutant
            )
            if options["compare"]:
                compare(report, pool, chosen, progress)
    if options["seeds"]:
        _run_controls(report, options, progress)


def _run_controls(report: Report, options: dict[str, Any], progress: Progress) -> None:
    from proof.selftest.controls import controls_of, run_controls  # noqa: PLC0415 - see _by_hand()

    controls = controls_of(report.contract, options["seeds"], short=options["short"], variants=options["variants"])
    report.notes += [f"Not among the good devices: {why}" for why in controls.missing]
    progress.total = len(controls.cases)
    report.control_results = run_controls(
        report.contract,
        controls.cases,
        effort=options["effort"],
        parallel=options["parallel"],
        domain_id=options["domain_id"],
        tell=progress.control,
    )
