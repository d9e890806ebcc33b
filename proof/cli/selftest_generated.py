"""``roaas selftest --generated``: judge a sample of generated mutants instead of the hand-written ones."""

import fnmatch
from typing import Any

import click

from conformance.contract.pack import Contract
from proof.cli.selftest_progress import Progress, compare
from proof.selftest.generated.mutant import GeneratedMutant
from proof.selftest.report import Report


def chosen_mutants(contract: Contract, options: dict[str, Any]) -> tuple[list[GeneratedMutant], int]:
    """Return the sample of generated mutants that the options select, and how many there are.

    Raises:
        click.UsageError: no mutant has such a name.
    """
    from proof.selftest.generated.adversary import composed, kinds_in_requests  # noqa: PLC0415 - see selftest.py
    from proof.selftest.generated.catalogue import generated_mutants, open_place  # noqa: PLC0415 - as above
    from proof.selftest.generated.sampling import sample  # noqa: PLC0415 - see selftest.py

    patterns = options["patterns"] or ("*",)
    every = generated_mutants(contract)
    if options["adversary"]:
        made = composed(every, kinds_in_requests(contract))
        every = tuple(one for one in made if open_place(contract, one) is None)
    fitting = [one for one in every if any(fnmatch.fnmatch(one.name, pattern) for pattern in patterns)]
    if not fitting:
        raise click.UsageError(f"no mutant by rule has a name like {', '.join(patterns)}; --list shows them")
    return sample(fitting, options["generated"] or options["adversary"], options["seed"]), len(every)


def run_generated(report: Report, mutants: list[GeneratedMutant], options: dict[str, Any], *, compared: bool) -> None:
    """Judge generated mutants, and add the results to the report; with ``compared``, also run Schemathesis on them.

    Raises:
        RobotError: the device does not start.
    """
    from proof.selftest.generated.judging import judge  # noqa: PLC0415 - see selftest.py
    from proof.selftest.generated.reach import Recorder, unreached  # noqa: PLC0415 - see selftest.py
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
        never = unreached(mutants, seen.messages) if seen.messages else frozenset()
        report.generated_results = judge(pool, mutants, efforts=efforts, unreached=never, tell=progress.by_rule)
        if compared:
            compare(report, pool, [mutant.as_mutant() for mutant in mutants], progress)
