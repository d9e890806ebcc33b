"""Report the results of generated mutants: in selftest.json, on the terminal, and in docs/coverage.md.

Of mutants before a described device, a page compares this suite with other tools.
"""

from collections import Counter
from collections.abc import Iterable, Mapping
from typing import Any

from conformance.contract.pack import Contract
from proof.selftest.comparison import Comparison
from proof.selftest.generated.adversary import Rate, group_of, rate_of, rates_by
from proof.selftest.generated.catalogue import every_change, generated_mutants, open_place, open_places
from proof.selftest.generated.judging import BROKEN, GIVEN_UP, KILLED, NOT_REACHED, SURVIVED, GeneratedResult

_WRITTEN = {KILLED: "caught"}  # the format roaas-selftest/1 says "caught" for a killed mutant
_KEYS = ("class", "clause", "operation", "when", "operator", "effort")
_COUNTED = frozenset({KILLED, SURVIVED})
# False alarms of a tool that the table names.
_ALARMS = 5


def _figures(rate: Rate) -> dict[str, Any]:
    return {
        "caught": rate.killed,
        "survived": rate.survived,
        "not_reached": rate.not_reached,
        "rate": round(rate.share, 4),
        "at_least": round(rate.bound, 4),
    }


def document(exist: int, results: Iterable[GeneratedResult], seed: int) -> dict[str, Any]:
    """Return the part of selftest.json on generated mutants, of which so many exist.

    ``at_least`` is the lower bound of Wilson's 95 % interval of the kill rate.
    """
    results = list(results)
    return {
        "exist": exist,
        "seed": seed,
        "all": _figures(rate_of(results)),
        **{f"by_{key}": {name: _figures(rate) for name, rate in rates_by(results, key).items()} for key in _KEYS},
        "mutants": [
            {
                "name": result.mutant.name,
                "says": result.mutant.says,
                "outcome": _WRITTEN.get(result.outcome, result.outcome),
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


def summary(exist: int, results: Iterable[GeneratedResult]) -> str:
    """Return the rates and the list of survivors for the terminal."""
    results = list(results)
    lines = [f"Mutants by rule killed: {rate_of(results).words()}; {exist} exist"]
    if warned := sum(result.outcome == KILLED and not result.fails for result in results):
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
    command: str, exist: int, results: Iterable[GeneratedResult], theirs: Mapping[str, bool], notes: Iterable[str]
) -> str:
    """Return a Markdown page with the rates, for selftest.md and docs/caught.md.

    Args:
        command: the command that gives this page.
        exist: how many mutants there are.
        results: result of each mutant.
        theirs: by mutant's name, whether plain Schemathesis killed it, for those it was run on.
        notes: remarks at the end of the page.
    """
    results = list(results)
    about = (
        f"`{command}`: {len(results)} of the {exist} mutants by rule. The sample takes each operator in each class in "
        "turn, so that rare ones weigh as much as frequent ones. A mutant is killed when a requirement fails or warns "
        "of it and passes the good device. A mutant that altered nothing in any run does not count. Bounds are the "
        "lower end of Wilson's 95 % interval."
    )
    lines = ["# Mutants by rule, and how many are killed", "", about, "", f"**{rate_of(results).words()}.**"]
    for key in _KEYS:
        lines += ["", f"| {key} | killed | altered something | rate | at least |", "|---|---|---|---|---|"]
        lines += [
            f"| `{name}` | {rate.killed} | {rate.reached} | {rate.share:.1%} | {rate.bound:.1%} |"
            for name, rate in rates_by(results, key).items()
        ]
    if theirs:
        both = [result for result in results if result.mutant.name in theirs and result.outcome != NOT_REACHED]
        ours, schemathesis = (
            Rate(killed, len(both) - killed, 0)
            for killed in (
                sum(result.outcome == KILLED for result in both),
                sum(theirs[result.mutant.name] for result in both),
            )
        )
        lines += ["", "Of those over REST that plain Schemathesis was tried on as well:", ""]
        lines += [f"- this suite: {ours.words()}", f"- plain Schemathesis: {schemathesis.words()}"]
    lines += ["", "| not killed | what it does | outcome | how often |", "|---|---|---|---|"]
    lines += [
        f"| `{_cell(result.mutant.name)}` | {_cell(result.mutant.says)} | {result.outcome} | {result.altered} |"
        for result in results
        if result.outcome not in {KILLED, NOT_REACHED}
    ]
    return "\n".join([*lines, *(f"\n{note}" for note in notes)]) + "\n"


def page_part(contract: Contract) -> list[str]:
    """Return lines for docs/coverage.md: the number of generated mutants, and the changes that break no clause."""
    mutants = generated_mutants(contract)
    operators = Counter(mutant.operator.partition("@")[0] for mutant in mutants)
    left = Counter(open_place(contract, change) for change in every_change(contract))
    covering = [place for place in open_places(contract) if left[place]]
    listed = ", ".join(f"`{name}` {number}" for name, number in sorted(operators.items()))
    about = (
        f"{len(mutants)} mutants by rule, at every field, status, header and operation of the pack's descriptions; "
        "`roaas selftest --generated N --seed S` judges a sample, with `--list` it shows them. "
        f"By operator: {listed}."
    )
    lines = ["", "## Mutants by rule", "", about]
    if covering:
        lines += ["", "The rules also make these changes, which break no clause and are not judged:", ""]
        lines += ["| changes (regular expression) | number | why they break no clause |", "|---|---|---|"]
        lines += [f"| `{_cell(place.pattern)}` | {left[place]} | {_cell(place.reason)} |" for place in covering]
    return lines


def _cell(text: str) -> str:
    return text.replace("|", "\\|")


def tools(
    results: Iterable[GeneratedResult], blamed: Mapping[str, str], compared: Iterable[Comparison]
) -> list[tuple[str, Rate, list[str]]]:
    """Return each tool's name, its kill rate on the same mutants, and its findings on the unchanged device.

    Args:
        results: ours of each mutant; those that altered nothing do not count.
        blamed: requirements that the unchanged device does not pass.
        compared: what the other tools report.
    """
    counted = [one for one in results if one.outcome in _COUNTED]
    rows = [("roaas certify", rate_of(counted), sorted(blamed))]
    for comparison in compared:
        both = [result.mutant.name for result in counted if result.mutant.name in comparison.tried]
        by_them = sum(name in comparison.killed for name in both)
        rows.append((comparison.tool, Rate(by_them, len(both) - by_them, 0), list(comparison.good)))
    return rows


def _cells(rate: Rate) -> str:
    return f"{rate.killed} | {rate.reached} | {rate.share:.1%} | {rate.bound:.1%} to {rate.top:.1%}"


def only_theirs(results: Iterable[GeneratedResult], compared: Iterable[Comparison]) -> list[str]:
    """Return the mutants that another tool kills and this suite does not, with the tool's report."""
    ours = {result.mutant.name for result in results if result.outcome == KILLED}
    return [
        f"{comparison.tool} alone: {name}: {', '.join(findings)}"
        for comparison in compared
        for name, findings in comparison.killed.items()
        if name not in ours
    ]


def page(
    target: str,
    results: Iterable[GeneratedResult],
    blamed: Mapping[str, str],
    compared: Iterable[Comparison],
    notes: Iterable[str],
) -> str:
    """Return a Markdown page."""
    results, compared = list(results), list(compared)
    not_reached = sum(result.outcome == NOT_REACHED for result in results)
    about = (
        f"{len(results)} mutants, of which {not_reached} altered nothing and do not count. A mutant alters a message "
        "only where the altered one breaks a norm or the description, so that what both leave open is never counted. "
        "It is killed when the tool says something that it does not say of the unchanged device. Bounds are those of "
        "Wilson's 95 % interval."
    )
    lines = [f"# Mutants by rule before {target}", "", about, ""]
    lines += [
        "| tool | killed | of | rate | interval | false alarms on the unchanged device |",
        "|---|---|---|---|---|---|",
    ]
    for name, rate, alarms in tools(results, blamed, compared):
        said = f"{len(alarms)}: {'; '.join(alarms[:_ALARMS])}" if alarms else "0"
        said += f"; and {len(alarms) - _ALARMS} more" if len(alarms) > _ALARMS else ""
        lines.append(f"| {name} | {_cells(rate)} | {said} |")
    heads = "".join(f" {comparison.tool} |" for comparison in compared), "---|" * len(compared)
    for key in ("class", "operator"):
        lines += ["", f"| {key} | killed | of | rate | interval |{heads[0]}", f"|---|---|---|---|---|{heads[1]}"]
        for name, rate in rates_by(results, key).items():
            named = {
                result.mutant.name for result in results if result.outcome in _COUNTED and group_of(result, key) == name
            }
            theirs = "".join(f" {len(named & comparison.killed.keys())} |" for comparison in compared)
            lines.append(f"| `{name}` | {_cells(rate)} |{theirs}")
    if compared:
        lines += ["", "Killed by another tool alone:", ""]
        lines += [f"- {text}" for text in only_theirs(results, compared)] or ["- none"]
    lines += ["", "| not killed | what it does | outcome | how often |", "|---|---|---|---|"]
    lines += [
        f"| `{result.mutant.name}` | {result.mutant.says} | {result.outcome} | {result.altered} |"
        for result in results
        if result.outcome not in {KILLED, NOT_REACHED}
    ]
    return "\n".join([*lines, *(f"\n{note}" for note in notes)]) + "\n"
