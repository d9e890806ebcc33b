"""Write the output of `roaas diff`: text for the terminal, an HTML page, and Markdown."""

from typing import Any

from reports.certificate.difference import MEANINGS, Difference, Kind
from reports.pages.page import html_page, markdown_page, opened
from reports.pages.untrusted import on_a_line

SHOWN = 50
"""Requirements of one kind of change that are listed; the rest are counted."""
_TONES = {Kind.NEW_FAILURE: "bad", Kind.LOST: "warning", Kind.FIXED: "good"}


def headline(found: Difference) -> str:
    """Return a summary of the changes in one sentence, such as "1 regression: 1 new failure, 2 fixed."."""
    counts = [
        f"{len(changes)} {kind.removesuffix('s') if len(changes) == 1 else kind}"
        for kind, changes in found.groups.items()
        if kind in _TONES
    ]
    still = f"{found.still_failing} still failing" if found.still_failing else ""
    summary = ", ".join([*counts, *filter(None, [still])]) or "no requirement changed its verdict"
    number = len(found.regressions)
    worse = f"{number} {'regression' if number == 1 else 'regressions'}" if number else "No regression"
    return f"{worse}: {summary}."


def difference_text(found: Difference) -> str:
    """Return the changes between two results as text for a terminal, at most 50 of each kind."""
    lines = [headline(found), on_a_line(found.origin)]
    for kind, changes in found.groups.items():
        lines += ["", f"{opened(kind)} ({len(changes)}). {MEANINGS[kind]}"]
        for change in changes[:SHOWN]:
            lines.append(f"  {on_a_line(change.id)} ({on_a_line(change.course)})")
            if change.reason and kind in {Kind.NEW_FAILURE, Kind.LOST, Kind.NEW_WARNING}:
                lines.append(f"      {on_a_line(change.reason, 200)}")
        if len(changes) > SHOWN:
            lines.append(f"  and {len(changes) - SHOWN} more")
    if found.circumstances:
        lines += ["", "The runs differ:"]
        lines += [f"  {name}: {on_a_line(old, 100)} → {on_a_line(new, 100)}" for name, old, new in found.circumstances]
    return "\n".join(lines)


def difference_html(found: Difference, names: tuple[str, str]) -> str:
    """Return the changes between two results as an HTML page; `names` are the paths of the two files."""
    return html_page("diff.html.j2", **_values(found, names))


def difference_markdown(found: Difference, names: tuple[str, str]) -> str:
    """Return the changes between two results as Markdown for a pull request; `names` are the paths of the two files."""
    return markdown_page("diff.md.j2", **_values(found, names))


def _values(found: Difference, names: tuple[str, str]) -> dict[str, Any]:
    return {
        "found": found,
        "names": names,
        "headline": headline(found),
        "meanings": MEANINGS,
        "tones": _TONES,
        "shown": SHOWN,
    }
