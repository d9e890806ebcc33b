"""Make text from a robot safe to show: without invisible characters, and of limited length.

A robot may send anything: terminal escapes, a right-to-left override that reverses a verdict, lone surrogates that
cannot be encoded, a gigabyte of one letter. Unprintable characters are shown as their escapes, and a long text is cut
and its length stated. Escaping for HTML, XML or Markdown is done afterwards.
"""

import re
from dataclasses import dataclass

from markupsafe import Markup, escape

_KEPT = "\n\t"
_COMMAND = re.compile(r"^(?=\s*::)|(?<=#)#(?=\w*\[)")


def visible(text: str) -> str:
    r"""Return the text with escapes (`\x1b`, `\u202e`) for unprintable characters, except line feed and tab.

    Unprintable, by Python's definition, are control and format characters (bidirectional overrides, zero width),
    surrogates, private and unassigned code points, and separators other than the space. The returned text can be
    encoded as UTF-8, and XML 1.0 allows all its characters.
    """
    if text.isprintable():
        return text
    return text.translate(_ESCAPES)


class _Escapes(dict[int, int | str]):
    """A translation table for `str.translate` that maps unprintable characters to escapes.

    Each entry is computed once, when it is first used, which is ten times faster for long texts.
    """

    def __missing__(self, code: int) -> int | str:
        character = chr(code)
        shown = character.isprintable() or character in _KEPT
        self[code] = code if shown else character.encode("unicode_escape").decode()
        return self[code]


_ESCAPES = _Escapes()


def excerpt(text: str, limit: int) -> str:
    """Return the text on one line, with escapes and cut to about `limit` characters, for messages and table cells."""
    line = " ".join(visible(text[: limit + 1]).split())
    return line if len(text) <= limit else f"{line[:limit]}…"


def on_a_line(text: str, limit: int = 2000) -> str:
    """Return an excerpt for a terminal or the log of a CI job, which runs nothing of it as a command.

    A text such as `::error::` (GitHub, at the beginning of a line), `##[group]` or `##vso[…]` (GitHub, Azure, anywhere)
    gets a backslash before it.
    """
    return _COMMAND.sub(lambda found: f"\\{found[0]}", excerpt(text, limit))


@dataclass(frozen=True, slots=True)
class Excerpt:
    """The beginning of a long text.

    Attributes:
        text: the beginning.
        omitted: number of characters or bytes that are not shown.
        total: length of the whole text.
        unit: "characters", or "bytes" if the text had been cut before it was stored.
    """

    text: str
    omitted: int
    total: int
    unit: str = "characters"

    @property
    def cut(self) -> bool:
        """Return whether a part of the text is not shown."""
        return self.omitted > 0


def beginning(text: str, limit: int, octets: int | None = None) -> Excerpt:
    """Return the first `limit` characters of a text, and how much is omitted.

    `octets` is the whole length in bytes if the text had been cut before it was stored.
    """
    shown = visible(text[:limit])
    present = len(text.encode("utf-8", "surrogatepass"))
    if octets is not None and octets > present:
        return Excerpt(shown, octets - len(text[:limit].encode("utf-8", "surrogatepass")), octets, "bytes")
    return Excerpt(shown, max(0, len(text) - limit), len(text))


def code_span(text: str, limit: int = 300) -> str:
    """Return a Markdown code span (GFM 6.3), in which HTML, mentions and links have no effect.

    The fence is longer than any run of backticks inside. Bars are escaped, because GFM splits table rows before it
    parses code spans (GFM 4.10).
    """
    line = excerpt(text, limit) or " "
    fence = "`" * (1 + max((len(run) for run in re.findall("`+", line)), default=0))
    pad = " " if line.startswith("`") or line.endswith("`") else ""
    return f"{fence}{pad}{line.replace('|', chr(92) + '|')}{pad}{fence}"


def coded(text: str) -> Markup:
    """Return the text as HTML, with `<code>` around each part between backticks."""
    parts = (escape(part) if number % 2 == 0 else Markup("<code>{}</code>").format(part)
             for number, part in enumerate(text.split("`")))  # fmt: skip
    return Markup().join(parts)


def code_block(text: str, limit: int = 4000) -> str:
    """Return a fenced Markdown code block (GFM 4.5) whose fence no line of the text can close."""
    shown = beginning(text, limit)
    fence = "`" * max(3, 1 + max((len(run) for run in re.findall("`+", shown.text)), default=0))
    note = f"\n… {shown.omitted} more {shown.unit}" if shown.cut else ""
    return f"{fence}\n{shown.text}{note}\n{fence}"


def plain(text: str, limit: int = 600) -> str:
    """Return one line of Markdown text in which markup, HTML, mentions and references have no effect.

    Punctuation is escaped (GFM 6.1). An empty comment after `@` and `#` keeps a code host from notifying a person or
    linking an issue.
    """
    line = re.sub(r"([\\`*_\[\]<>|~$&])", r"\\\1", excerpt(text, limit))
    return re.sub(r"([@#])(?=\w)", r"\1<!-- -->", line)
