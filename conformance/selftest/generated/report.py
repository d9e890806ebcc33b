"""What is said of mutants by rule: for selftest.json, for people, and on the page on coverage."""

from collections import Counter
from collections.abc import Iterable, Mapping
from typing import Any

from conformance.selftest.generated.catalogue import every_change, generated_mutants
from conformance.selftest.generated.judging import BROKEN, CAUGHT, GIVEN_UP, NOT_REACHED, SURVIVED, GeneratedResult
from conformance.selftest.generated.open_places import RULES, reason_for
from conformance.selftest.generated.sampling import Rate, rate_of, rates_by

_KEYS = ("class", "operator", "effort")


def _figures(rate: Rate) -> dict[str, Any]:
    return {
        "caught": rate.caught,
        "survived": rate.survived,
        "not_reached": rate.not_reached,
        "rate": round(rate.share, 4),
        "at_least": round(rate.bound, 4),
    }


def document(results: Iterable[GeneratedResult], seed: int) -> dict[str, Any]:
    """The part of selftest.json on mutants by rule; ``at_least`` is the lower end of Wilson's 95 % interval."""
    results = list(results)
    return {
        "exist": len(generated_mutants()),
        "seed": seed,
        "all": _figures(rate_of(results)),
        **{f"by_{key}": {name: _figures(rate) for name, rate in rates_by(results, key).items()} for key in _KEYS},
        "mutants": [
            {
                "name": result.mutant.name,
                "says": result.mutant.says,
                "outcome": result.outcome,
                "by": list(result.by),
                "not_conformant": result.fails,
                "effort": result.effort,
                "altered": result.altered,
                "runs": result.runs,
                "seconds": round(result.seconds, 2),
                "reason": result.reason,
            }
            for result in results
        ],
    }


def summary(results: Iterable[GeneratedResult]) -> str:
    """What a person wants to know: the rates, then every survivor."""
    results = list(results)
    lines = [f"Faulty robots by rule: {rate_of(results).words()}; {len(generated_mutants())} exist"]
    if warned := sum(result.outcome == CAUGHT and not result.fails for result in results):
        lines.append(f"{warned} of them by a SHOULD alone")
    for key in _KEYS:
        lines.append(f"by {key}:")
        lines += [f"  {name:20} {rate.words()}" for name, rate in rates_by(results, key).items()]
    for result in results:
        if result.outcome == SURVIVED:
            lines.append(f"SURVIVED {result.mutant.name} ({result.mutant.says}) altered {result.altered} times")
        if result.outcome in {BROKEN, GIVEN_UP}:
            lines.append(f"{result.outcome.upper()} {result.mutant.name}: {result.reason or 'a run came to no end'}")
    return "\n".join(lines)


def rates_page(
    results: Iterable[GeneratedResult], target: str, seed: int, theirs: Mapping[str, bool], notes: Iterable[str]
) -> str:
    """A page of the rates, for selftest.md and docs/caught.md.

    Args:
        results: of each mutant.
        target: the good robot behind them.
        seed: of the sample.
        theirs: whether plain Schemathesis caught it, by name, of those that it was tried on.
        notes: remarks in the end.
    """
    results = list(results)
    about = (
        f"`roaas selftest --generated {len(results)} --seed {seed} --target {target}`: {len(results)} of the "
        f"{len(generated_mutants())} changes by rule that a client could see. The sample takes each operator in each "
        "class in turn, so that rare ones weigh as much as frequent ones. A change counts as caught when a requirement "
        "says so that does not say it of the good robot; what altered nothing in any run does not count. Bounds are "
        "the lower end of Wilson's 95 % interval."
    )
    lines = ["# Faulty robots by rule, and how many are caught", "", about, "", f"**{rate_of(results).words()}.**"]
    for key in _KEYS:
        lines += ["", f"| {key} | caught | altered something | rate | at least |", "|---|---|---|---|---|"]
        lines += [
            f"| `{name}` | {rate.caught} | {rate.reached} | {rate.share:.1%} | {rate.bound:.1%} |"
            for name, rate in rates_by(results, key).items()
        ]
    if theirs:
        both = [result for result in results if result.mutant.name in theirs and result.outcome != NOT_REACHED]
        ours, schemathesis = (
            Rate(caught, len(both) - caught, 0)
            for caught in (
                sum(result.outcome == CAUGHT for result in both),
                sum(theirs[result.mutant.name] for result in both),
            )
        )
        lines += ["", "Of those over REST that plain Schemathesis was tried on as well:", ""]
        lines += [f"- this suite: {ours.words()}", f"- plain Schemathesis: {schemathesis.words()}"]
    lines += ["", "| not caught | what it does | outcome | how often |", "|---|---|---|---|"]
    lines += [
        f"| `{_cell(result.mutant.name)}` | {_cell(result.mutant.says)} | {result.outcome} | {result.altered} |"
        for result in results
        if result.outcome not in {CAUGHT, NOT_REACHED}
    ]
    return "\n".join([*lines, *(f"\n{note}" for note in notes)]) + "\n"


def page_part() -> list[str]:
    """Lines of the page on coverage: how many there are, and what the rules make that breaks no clause."""
    mutants = generated_mutants()
    operators = Counter(mutant.operator.partition("@")[0] for mutant in mutants)
    left = Counter(reason_for(change.name) for change in every_change())
    listed = ", ".join(f"`{name}` {number}" for name, number in sorted(operators.items()))
    about = (
        f"{len(mutants)} changes by rule, at every field, status, header and operation of the contract's files; "
        "`roaas selftest --generated N --seed S` judges a sample, with `--list` it shows them. "
        f"By operator: {listed}."
    )
    return [
        "",
        "## Faulty robots by rule",
        "",
        about,
        "",
        "These changes the rules make as well; they break no clause, and are not judged:",
        "",
        "| changes (regular expression) | number | why they break no clause |",
        "|---|---|---|",
        *(f"| `{_cell(rule.pattern)}` | {left[rule.reason]} | {_cell(rule.reason)} |" for rule in RULES),
    ]


def _cell(text: str) -> str:
    return text.replace("|", "\\|")
