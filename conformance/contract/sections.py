"""The sections of a contract's text, by the anchors that requirements cite (``contract.md#goals``)."""

import re
from collections.abc import Iterable
from typing import NamedTuple

TEXT_NAME = "contract.md"
_HEADING = re.compile(r"^#{1,6} +(?P<title>.+?) *$", re.MULTILINE)
_CITED = re.compile(rf"(?:^|; ){re.escape(TEXT_NAME)}#(?P<anchor>[\w-]+)")


class Section(NamedTuple):
    """A heading, and the Markdown text up to the next heading."""

    title: str
    text: str


def anchor_of(title: str) -> str:
    """Return the anchor that GitHub gives a heading: lower case, no punctuation, hyphens for spaces."""
    return re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-")


def sections_of(text: str) -> dict[str, Section]:
    """Return all sections of a Markdown text by anchor."""
    headings = list(_HEADING.finditer(text))
    ends = [heading.start() for heading in headings[1:]] + [len(text)]
    return {
        anchor_of(heading["title"]): Section(heading["title"], text[heading.end() : end].strip())
        for heading, end in zip(headings, ends, strict=True)
    }


def cited_in(sources: Iterable[str]) -> set[str]:
    """Return the anchors of the contract's text in requirements' sources."""
    return {anchor for source in sources for anchor in _CITED.findall(source)}
