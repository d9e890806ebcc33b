"""The page of mutants by rule before a described device: this suite beside plain Schemathesis, in one table."""

from collections.abc import Iterable, Mapping

from conformance.selftest.comparison import SchemathesisResult
from conformance.selftest.generated.judging import KILLED, NOT_REACHED, SURVIVED, GeneratedResult
from conformance.selftest.generated.sampling import Rate, group_of, rate_of, rates_by

_COUNTED = frozenset({KILLED, SURVIVED})


def tools(
    results: Iterable[GeneratedResult],
    blamed: Mapping[str, str],
    compared: Iterable[SchemathesisResult],
    good: Iterable[str],
) -> list[tuple[str, Rate, list[str]]]:
    """Return for each tool its name, its kill rate on the same mutants, and what it says of the unchanged device.

    Args:
        results: ours of each mutant; those that altered nothing do not count.
        blamed: requirements that the unchanged device does not pass.
        compared: those of plain Schemathesis; empty: it was not run.
        good: what Schemathesis reports of the unchanged device.
    """
    counted = [one for one in results if one.outcome in _COUNTED]
    rows = [("roaas certify", rate_of(counted), sorted(blamed))]
    killed = {one.mutant for one in compared if one.killed}
    there = {one.mutant for one in compared}
    if there:
        both = [one for one in counted if one.mutant.name in there]
        by_them = sum(one.mutant.name in killed for one in both)
        rows.append(("plain Schemathesis", Rate(by_them, len(both) - by_them, 0), sorted(good)))
    return rows


def _cells(rate: Rate) -> str:
    return f"{rate.killed} | {rate.reached} | {rate.share:.1%} | {rate.bound:.1%} to {rate.top:.1%}"


def only_theirs(results: Iterable[GeneratedResult], compared: Iterable[SchemathesisResult]) -> list[str]:
    """Return the mutants that Schemathesis kills and this suite does not, with what it reports."""
    theirs = {one.mutant: ", ".join(one.findings) for one in compared if one.killed}
    return [
        f"{one.mutant.name}: {theirs[one.mutant.name]}"
        for one in results
        if one.outcome != KILLED and one.mutant.name in theirs
    ]


def page(
    target: str,
    results: Iterable[GeneratedResult],
    blamed: Mapping[str, str],
    compared: Iterable[SchemathesisResult],
    good: Iterable[str],
    notes: Iterable[str],
) -> str:
    """Return a Markdown page."""
    results, compared = list(results), list(compared)
    not_reached = sum(one.outcome == NOT_REACHED for one in results)
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
    for name, rate, alarms in tools(results, blamed, compared, good):
        said = f"{len(alarms)}: {', '.join(alarms)}" if alarms else "0"
        lines.append(f"| {name} | {_cells(rate)} | {said} |")
    killed_by_them = {one.mutant for one in compared if one.killed}
    more = (" plain Schemathesis |", "---|") if compared else ("", "")
    for key in ("class", "operator"):
        lines += ["", f"| {key} | killed | of | rate | interval |{more[0]}", f"|---|---|---|---|---|{more[1]}"]
        for name, rate in rates_by(results, key).items():
            named = [one.mutant.name for one in results if one.outcome in _COUNTED and group_of(one, key) == name]
            theirs = f" {len(killed_by_them.intersection(named))} |" if compared else ""
            lines.append(f"| `{name}` | {_cells(rate)} |{theirs}")
    if compared:
        lines += ["", "Killed by plain Schemathesis alone:", ""]
        lines += [f"- `{one}`" for one in only_theirs(results, compared)] or ["- none"]
    lines += ["", "| not killed | what it does | outcome | how often |", "|---|---|---|---|"]
    lines += [
        f"| `{one.mutant.name}` | {one.mutant.says} | {one.outcome} | {one.altered} |"
        for one in results
        if one.outcome not in {KILLED, NOT_REACHED}
    ]
    return "\n".join([*lines, *(f"\n{note}" for note in notes)]) + "\n"
