"""Write the output of `roaas diff`, of two results or two descriptions: for the terminal, as HTML, and as Markdown."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

from reports.certificate.difference import MEANINGS, Difference, Kind
from reports.pages.page import html_page, markdown_page, opened
from reports.pages.untrusted import on_a_line

SHOWN = 50
"""Requirements of one kind of change that are listed; the rest are counted."""
_TONES = {Kind.NEW_FAILURE: "bad", Kind.LOST: "warning", Kind.FIXED: "good"}
_OPERATIONS_NAMED = 5
_NAME_SHOWN = 200


def headline(found: Difference) -> str:
    """Return a summary of the changes in one sentence, such as "1 regression: 1 new failure, 2 fixed."."""
    counts = []
    for kind, changes in found.groups.items():
        beside = sum(not change.regression for change in changes) if kind is Kind.LOST else 0
        more = f" ({beside} of them no regression)" if beside else ""
        counts += [f"{len(changes)} {kind.removesuffix('s') if len(changes) == 1 else kind}{more}"] * (kind in _TONES)
    still = [f"{n} {words}" for n, words in zip(found.still, ("still failing", "still warned of"), strict=True) if n]
    summary = ", ".join([*counts, *still]) or "no requirement changed its verdict"
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


@dataclass(frozen=True, slots=True)
class DescriptionChanges:
    """The changes between two descriptions.

    Attributes:
        breaking: what breaks clients of the older one: the change, with the operations that have it.
        unknown: what could not be compared, likewise.
        other: what does not break clients, likewise.
    """

    breaking: dict[str, list[str]]
    unknown: dict[str, list[str]]
    other: dict[str, list[str]]

    @property
    def headline(self) -> str:
        """Return in a sentence how much breaks."""
        number, unknown, rest = len(self.breaking), len(self.unknown), len(self.other)
        parts = [f"{number or 'No'} {'change breaks' if number < 2 else 'changes break'} existing clients"]  # noqa: PLR2004 - plural
        if unknown:
            # "no change" is not written where something may break.
            parts = [
                *(parts if number else ()),
                f"of {_changes(unknown)} it is not known whether existing clients break",
            ]
        parts += [_changes(rest).replace(" ", " other ")] if rest else []
        text = "; ".join(parts)
        return f"{text[0].upper()}{text[1:]}."

    @property
    def groups(self) -> Iterator[tuple[str, dict[str, list[str]]]]:
        """Yield the groups with their headings, if there is something in them."""
        for heading, found in (
            ("Breaks existing clients", self.breaking),
            ("Not known whether it breaks existing clients", self.unknown),
            ("Other changes", self.other),
        ):
            if found:
                yield heading, found


def _changes(number: int) -> str:
    return "1 change" if number == 1 else f"{number} changes"


def description_changes(found: Iterable[tuple[bool | None, str, str]]) -> DescriptionChanges:
    """Return changes by what they are; each is whether it breaks clients, the operation, and a text."""
    groups: dict[bool | None, dict[str, list[str]]] = {True: {}, None: {}, False: {}}
    for breaking, operation, text in found:
        groups[breaking].setdefault(text, []).append(operation)
    return DescriptionChanges(groups[True], groups[None], groups[False])


def changes_text(found: DescriptionChanges) -> str:
    """Return the changes as text for a terminal."""
    lines = [found.headline]
    for heading, changes in found.groups:
        lines += ["", f"{heading} ({len(changes)}):"]
        lines += [
            f"  {on_a_line(_first_names(operations), 400)}: {on_a_line(text, 400)}"
            for text, operations in changes.items()
        ]
    return "\n".join(lines)


def _first_names(operations: list[str]) -> str:
    more = f" and {len(operations) - _OPERATIONS_NAMED} more" if len(operations) > _OPERATIONS_NAMED else ""
    return ", ".join(operations[:_OPERATIONS_NAMED]) + more


def changes_pages(found: DescriptionChanges, names: tuple[str, str], stem: str) -> dict[str, str]:
    """Return the pages with the changes, by file name; ``names`` say where the descriptions are from."""
    values: dict[str, Any] = {"found": found, "names": names, "shown": _NAME_SHOWN, "named": _OPERATIONS_NAMED}
    return {
        f"{stem}.html": html_page("description-changes.html.j2", **values),
        f"{stem}.md": markdown_page("description-changes.md.j2", **values),
    }
