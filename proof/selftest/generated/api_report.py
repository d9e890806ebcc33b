"""The page of mutants by rule before a described device: this suite beside other tools, in one table."""

from collections.abc import Iterable, Mapping

from proof.selftest.comparison import Comparison
from proof.selftest.generated.judging import KILLED, NOT_REACHED, SURVIVED, GeneratedResult
from proof.selftest.generated.sampling import Rate, group_of, rate_of, rates_by

_COUNTED = frozenset({KILLED, SURVIVED})
# False alarms of a tool that the table names.
_ALARMS = 5


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
    for one in compared:
        both = [result.mutant.name for result in counted if result.mutant.name in one.tried]
        by_them = sum(name in one.killed for name in both)
        rows.append((one.tool, Rate(by_them, len(both) - by_them, 0), list(one.good)))
    return rows


def _cells(rate: Rate) -> str:
    return f"{rate.killed} | {rate.reached} | {rate.share:.1%} | {rate.bound:.1%} to {rate.top:.1%}"


def only_theirs(results: Iterable[GeneratedResult], compared: Iterable[Comparison]) -> list[str]:
    """Return the mutants that another tool kills and this suite does not, with what it reports."""
    ours = {one.mutant.name for one in results if one.outcome == KILLED}
    return [
        f"{one.tool} alone: {name}: {', '.join(findings)}"
        for one in compared
        for name, findings in one.killed.items()
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
    for name, rate, alarms in tools(results, blamed, compared):
        said = f"{len(alarms)}: {'; '.join(alarms[:_ALARMS])}" if alarms else "0"
        said += f"; and {len(alarms) - _ALARMS} more" if len(alarms) > _ALARMS else ""
        lines.append(f"| {name} | {_cells(rate)} | {said} |")
    heads = "".join(f" {one.tool} |" for one in compared), "---|" * len(compared)
    for key in ("class", "operator"):
        lines += ["", f"| {key} | killed | of | rate | interval |{heads[0]}", f"|---|---|---|---|---|{heads[1]}"]
        for name, rate in rates_by(results, key).items():
            named = {one.mutant.name for one in results if one.outcome in _COUNTED and group_of(one, key) == name}
            theirs = "".join(f" {len(named & one.killed.keys())} |" for one in compared)
            lines.append(f"| `{name}` | {_cells(rate)} |{theirs}")
    if compared:
        lines += ["", "Killed by another tool alone:", ""]
        lines += [f"- {one}" for one in only_theirs(results, compared)] or ["- none"]
    lines += ["", "| not killed | what it does | outcome | how often |", "|---|---|---|---|"]
    lines += [
        f"| `{one.mutant.name}` | {one.mutant.says} | {one.outcome} | {one.altered} |"
        for one in results
        if one.outcome not in {KILLED, NOT_REACHED}
    ]
    return "\n".join([*lines, *(f"\n{note}" for note in notes)]) + "\n"
