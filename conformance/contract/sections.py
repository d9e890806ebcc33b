"""The sections of a contract's text, by the anchors that requirements cite (``contract.md#goals``)."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Iterable

TEXT_NAME = "contract.md"
_HEADING = re.compile(r"^#{1,6} +(?P<title>.+?) *$", re.MULTILINE)
_CITED = re.compile(rf"(?:^|; ){re.escape(TEXT_NAME)}#(?P<anchor>[\w-]+)")


class Section(NamedTuple):
    """A heading, and what stands below it up to the next one, as Markdown."""

    title: str
    text: str


def anchor_of(title: str) -> str:
    """The anchor that GitHub gives a heading: lower case, no punctuation, hyphens for blanks."""
    return re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-")


def sections_of(text: str) -> dict[str, Section]:
    """All sections of a Markdown text by their anchor."""
    headings = list(_HEADING.finditer(text))
    ends = [heading.start() for heading in headings[1:]] + [len(text)]
    return {
        anchor_of(heading["title"]): Section(heading["title"], text[heading.end() : end].strip())
        for heading, end in zip(headings, ends, strict=True)
    }


def cited_in(sources: Iterable[str]) -> set[str]:
    """The anchors of the text that requirements' sources name."""
    return {anchor for source in sources for anchor in _CITED.findall(source)}
