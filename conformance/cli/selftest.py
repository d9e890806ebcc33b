"""``roaas selftest``: shows that the suite catches faulty robots (mutants) and blames no good one."""

from __future__ import annotations

import fnmatch
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from conformance.commandline.exit_codes import ExitCode

if TYPE_CHECKING:
    from collections.abc import Callable

    from conformance.mutation.mutant import Mutant
    from conformance.selftest.comparison import SchemathesisResult
    from conformance.selftest.controls import Case, ControlResult
    from conformance.selftest.mutant_run import MutantResult
    from conformance.selftest.report import Report

# A dozen and some different ones, for a check in less than a minute; the longest first.
_SHORT = (
    "safety-unactuated-ignored",
    "pose-without-child-frame",
    "sensors-twice",
    "plan-jumps",
    "format-no-vary",
    "http-405-without-allow",
    "http-nan",
    "delivery-text-is-zero",
    "soap-response-namespace",
    "bp-fault-200",
    "input-last-wins",
    "input-soap-missing-is-zero",
    "same-pose",
    "wsdl-float",
    "openapi-without-path",
)


@click.command(context_settings={"help_option_names": ["-h", "--help"]})
@click.option(
    "--faults", "patterns", multiple=True, metavar="PATTERN", help="Only faults whose names match (repeatable)."
)
@click.option(
    "--target",
    type=click.Choice(["reference", "plain", "baroque"]),
    default="reference",
    show_default=True,
    help="The good robot behind the faults; independent robots need no ROS.",
)
@click.option("--seeds", type=click.IntRange(min=0), default=20, show_default=True, help="Seeds for each good robot.")
@click.option("--short", is_flag=True, help="A dozen faults and one seed, in less than a minute.")
@click.option("--controls-only", is_flag=True, help="Only the good robots, and no faults.")
@click.option(
    "--effort",
    type=click.Choice(["quick", "standard"]),
    default="quick",
    show_default=True,
    help="Of the first run of each; a fault that is missed is tried again at standard.",
)
@click.option(
    "--compare/--no-compare", default=True, help="Run the plain Schemathesis command line against the REST faults too."
)
@click.option(
    "--variants/--no-variants",
    default=True,
    help="Try good robots behind TLS, a prefix, a token and the like, behind nginx and on other web servers.",
)
@click.option("--parallel", type=click.IntRange(min=1), default=2, show_default=True, help="Runs at once.")
@click.option(
    "--domain-id", type=click.IntRange(0, 100), default=80, show_default=True, help="First ROS domain to use."
)
@click.option(
    "--generated",
    type=click.IntRange(min=1),
    metavar="N",
    help="Judge N faults made by rule, in place of those that people thought of; the target is then baroque.",
)
@click.option("--seed", type=int, default=0, show_default=True, help="Of the sample of faults by rule.")
@click.option("--list", "listed", is_flag=True, help="List the faults, and run nothing.")
@click.option(
    "--out",
    type=click.Path(file_okay=False, path_type=Path),
    default=Path("out/selftest"),
    show_default=True,
    help="Folder for selftest.json and the matrix.",
)
@click.pass_context
def selftest(context: click.Context, /, **options: Any) -> None:
    """Show that the suite catches faulty robots and blames no good one.

    Each faulty robot is a good one behind a proxy with one named change. Exit code: 0 all caught and nobody blamed;
    1 otherwise; 2 usage; 3 a robot does not start; 130 interrupted.
    """
    # lxml and the like cost what --help need not pay.
    from conformance.packs.table1.mutants import MUTANTS  # noqa: PLC0415
    from conformance.selftest.report import Report  # noqa: PLC0415

    if options["generated"]:
        _generated(context, options)
        return
    if options["short"]:
        options.update(seeds=min(options["seeds"], 1), compare=False, variants=False)
    patterns = options["patterns"] or (_SHORT if options["short"] else ("*",))
    chosen = [mutant for mutant in MUTANTS if any(fnmatch.fnmatch(mutant.name, pattern) for pattern in patterns)]
    if options["short"] and not options["patterns"]:
        # The longest first, so that it does not keep the others waiting in the end.
        chosen.sort(key=lambda mutant: _SHORT.index(mutant.name))
    if not chosen:
        raise click.UsageError(f"no fault has a name like {', '.join(patterns)}; --list shows them")
    if options["controls_only"]:
        chosen = []
    if options["listed"]:
        for mutant in chosen:
            click.echo(f"{mutant.name:34} {mutant.says} [{', '.join(mutant.catches)}]")
        return
    report = Report(options["target"])
    _finish(report, lambda: _run(report, chosen, options), options)


def _generated(context: click.Context, options: dict[str, Any]) -> None:
    """Faults by rule: a robot that starts in a moment, and Schemathesis only where it is asked for."""
    from conformance.cli.selftest_generated import chosen_mutants, run_generated  # noqa: PLC0415 - see selftest()
    from conformance.selftest.report import Report  # noqa: PLC0415 - see selftest()

    chosen = chosen_mutants(options)
    if options["listed"]:
        for mutant in chosen:
            click.echo(f"{mutant.name} {mutant.says}")
        return
    given = {name for name in options if context.get_parameter_source(name) is click.core.ParameterSource.COMMANDLINE}
    if "target" not in given:
        options["target"] = "baroque"
    compared = options["compare"] and "compare" in given
    report = Report(options["target"], seed=options["seed"])
    _finish(report, lambda: run_generated(report, chosen, options, compared=compared), options)


def _finish(report: Report, run: Callable[[], None], options: dict[str, Any]) -> None:
    """Run, write the results, also those of a run that was interrupted, and end with the exit code."""
    from conformance.selftest.robots import RobotError  # noqa: PLC0415 - see selftest()

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
    path = report.write(options["out"])
    click.echo(report.summary())
    click.echo(f"result: {path}")
    sys.exit(ExitCode.INTERRUPTED if interrupted else ExitCode.PASSED if report.holds else ExitCode.FAILED)


def _run(report: Report, chosen: list[Mutant], options: dict[str, Any]) -> None:
    from conformance.selftest.mutant_run import RobotPool, run_mutants, run_unchanged  # noqa: PLC0415 - see selftest()

    progress = _Progress(report, len(chosen))
    if chosen:
        with RobotPool(options["target"], options["parallel"], options["domain_id"]) as pool:
            already: frozenset[str] = frozenset()
            if not options["short"]:
                already = frozenset(run_unchanged(pool, options["effort"]).caught())
            report.mutant_results = run_mutants(
                pool, chosen, effort=options["effort"], already=already, tell=progress.mutant
            )
            if options["compare"]:
                _compare(report, pool, chosen, progress)
    if options["seeds"]:
        _run_controls(report, options, progress)


def _compare(report: Report, pool: Any, chosen: list[Mutant], progress: _Progress) -> None:
    from conformance.selftest import comparison  # noqa: PLC0415 - see selftest()

    if comparison.command() is None:
        report.notes.append("Schemathesis' command line is not installed, so that nothing was compared with it.")
        return
    good, report.compared = comparison.compare(pool, chosen, tell=progress.compared)
    report.good = tuple(sorted(f"{operation} {code}" for operation, code in good))
    report.notes.append(
        f"Schemathesis ran with --max-examples {comparison.EXAMPLES}, phases examples, coverage, fuzzing, and at most "
        f"{comparison.LIMIT_S:g} s for each fault; findings that it has of the good robot as well do not count."
    )


def _run_controls(report: Report, options: dict[str, Any], progress: _Progress) -> None:
    from conformance.selftest import robots  # noqa: PLC0415 - see selftest()
    from conformance.selftest.controls import Case, run_controls  # noqa: PLC0415 - see selftest()
    from conformance.selftest.servers.fronts import FRONTS  # noqa: PLC0415 - see selftest()
    from conformance.selftest.variants import VARIANTS  # noqa: PLC0415 - see selftest()

    kinds = list(robots.INDEPENDENT_ROBOTS)
    try:
        robots.check_available(robots.REFERENCE)
        kinds += (robots.REFERENCE,) if options["short"] else robots.ON_ROS
    except robots.RobotError as error:
        report.notes.append(f"Not among the good robots: {error}")
    cases: list[Case] = []
    if options["variants"]:
        # The slow one first, so that it does not keep all others waiting in the end.
        cases += [Case(variant.robot, variant, 0) for variant in VARIANTS]
        cases += [Case(front.robot, front, 0) for front in FRONTS if front.robot in kinds]
        cases += [Case(kind, None, 0) for kind in robots.ON_SERVERS]
    cases += [Case(kind, None, seed) for seed in range(options["seeds"]) for kind in kinds]
    progress.total = len(cases)
    report.control_results = run_controls(
        cases,
        effort=options["effort"],
        parallel=options["parallel"],
        domain_id=options["domain_id"],
        tell=progress.control,
    )


class _Progress:
    """Tells of progress on stderr, and keeps each result in case that no more come."""

    def __init__(self, report: Report, total: int) -> None:
        self.total = total
        self._report = report
        self._done = 0
        self._compared = 0
        self._controls = 0

    def mutant(self, result: MutantResult) -> None:
        """A mutant has been tried."""
        self._report.mutant_results.append(result)
        self._done += 1
        said = result.not_tried or (
            f"MISSED by {', '.join(result.missed)}" if result.missed else f"caught by {_few(result)}"
        )
        click.echo(f"[{self._done}/{self.total}] {result.mutant.name}: {said} ({result.seconds:.1f} s)", err=True)

    def compared(self, result: SchemathesisResult) -> None:
        """Schemathesis has tried a mutant."""
        self._report.compared.append(result)
        self._compared += 1
        said = f"caught: {result.findings[0]}" if result.caught else "not caught"
        click.echo(f"[{self._compared}] Schemathesis, {result.mutant}: {said}", err=True)

    def control(self, result: ControlResult) -> None:
        """A good robot has been judged."""
        self._report.control_results.append(result)
        self._controls += 1
        name = f"{result.robot} {result.variant}".strip()
        said = result.not_tried or (
            "conformant" if result.conformant else f"BLAMED: {result.blamed or result.unjudged or 'given up'}"
        )
        click.echo(f"[{self._controls}/{self.total}] {name}, seed {result.seed}: {said}"[:400], err=True)


def _few(result: MutantResult) -> str:
    rest = len(result.caught) - len(result.mutant.catches)
    return ", ".join(result.mutant.catches) + (f" and {rest} more" if rest > 0 else "")
