"""Write the output of `roaas compare`: a table for the terminal, an HTML page with figures, and Markdown."""

from collections.abc import Sequence
from typing import Any

from reports.latency.comparison import Change, Comparison
from reports.latency.figures.canvas import COLOUR
from reports.latency.figures.ratios import Ratio, ratios
from reports.latency.figures.spectrum import change
from reports.latency.findings import Verdict
from reports.latency.numbers import interval, ms, ratio, share
from reports.pages.page import html_page, markdown_page
from reports.pages.untrusted import on_a_line

_CELL = 200
QUANTILE_WORDS = {"p50": "50 %", "p99": "99 %"}
_TONES = {"slower": "bad", "faster": "good", "same": "quiet", "unclear": "warning"}
_SIGNS = {"slower": "✗", "faster": "✓", "same": "=", "unclear": "?"}
_HEAD = ("series", "time", "at", "old ms", "new ms", "new/old", "95 % interval", "noise", "verdict")


def verdict(comparison: Comparison) -> Verdict:
    """Return the verdict on a comparison of two latency results, with the change that is known best."""
    if not comparison.valid:
        because = " ".join(comparison.remarks) or "No quantile has an interval in both results."
        return Verdict("warning", "?", "Not comparable", because)
    slower, faster = comparison.with_verdict("slower"), comparison.with_verdict("faster")
    counted = f"(Of {len(comparison.changes)} quantiles {len(slower)} got slower and {len(faster)} faster.)"
    again = f" {hint}" if (hint := comparison.busy) else ""
    if slower:
        return Verdict("bad", "✗", "It got slower", f"{sentence(slower[0])} {counted}{again}")
    if faster:
        return Verdict("good", "✓", "It got faster", f"{sentence(faster[0])} {counted}{again}")
    unclear = comparison.with_verdict("unclear")
    if unclear:
        best = sentence(unclear[0])
        longer = again or " Longer runs give narrower intervals."
        return Verdict("quiet", "=", "No change can be shown", f"Of these the best known: {best}{longer}")
    return Verdict("quiet", "=", "No change", "Every quantile with an interval stayed within the threshold.")


def sentence(of: Change) -> str:
    """Return a sentence on one changed quantile: old and new time, their ratio, and its 95 % interval."""
    return (
        f"{of.series}: the {of.time} time at {QUANTILE_WORDS[of.quantile]} went from {ms(of.old_ms)} to "
        f"{ms(of.new_ms)} ms, {ratio(of.ratio)} times (95 % interval {interval(of.interval, of_ratio=True)}, "
        f"noise up to {share(of.threshold)})."
    )


def table(comparison: Comparison) -> str:
    """Return all compared quantiles as a table in aligned columns, for a terminal."""
    rows = [_HEAD, *([on_a_line(cell, _CELL) for cell in _row(one)] for one in comparison.changes)]
    widths = [max(len(row[column]) for row in rows) for column in range(len(_HEAD))]
    # Words are aligned to the left, numbers to the right.
    lines = (
        "  ".join(
            cell.ljust(width) if column in {0, 1, 8} else cell.rjust(width)
            for column, (cell, width) in enumerate(zip(row, widths, strict=True))
        )
        for row in rows
    )
    return "\n".join(line.rstrip() for line in lines)


def comparison_html(comparison: Comparison, names: tuple[str, str]) -> str:
    """Return the comparison as an HTML page; `names` are the names of the old and the new file."""
    pictures = {"ratios": _ratios(comparison.changes), "change": change(comparison.old_series, comparison.new_series)}
    return html_page("compare.html.j2", pictures=pictures, **_values(comparison, names))


def comparison_markdown(comparison: Comparison, names: tuple[str, str]) -> str:
    """Return the comparison of two latency results as short Markdown; `names` are the paths of the two files."""
    return markdown_page("compare.md.j2", **_values(comparison, names))


def _values(comparison: Comparison, names: tuple[str, str]) -> dict[str, Any]:
    return {
        "comparison": comparison,
        "names": names,
        "verdict": verdict(comparison),
        "head": _HEAD,
        "rows": [(one, _row(one)) for one in comparison.changes],
        "tones": _TONES,
        "signs": _SIGNS,
    }


def _row(one: Change) -> tuple[str, ...]:
    return (
        one.series,
        one.time,
        QUANTILE_WORDS[one.quantile],
        ms(one.old_ms),
        ms(one.new_ms),
        ratio(one.ratio),
        interval(one.interval, of_ratio=True),
        share(one.threshold),
        one.verdict,
    )


def _ratios(changes: Sequence[Change]) -> Any:
    rows = [
        Ratio(f"{one.series}, {QUANTILE_WORDS[one.quantile]}", one.ratio, one.interval, COLOUR[one.interface])
        for one in changes
        if one.ratio is not None and one.time == "service"
    ]
    return ratios(
        "ratios",
        "new over old, service time",
        rows,
        "New service time divided by the old one, with 95 % intervals. Right of 1 requests got slower. A change within "
        "the noise, which is in the table, does not count.",
    )
