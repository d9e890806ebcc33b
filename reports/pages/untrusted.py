"""Makes text that a robot controls fit to be shown: nothing invisible, nothing endless.

A robot under test may answer with anything: terminal escapes, a right-to-left override that turns a verdict
around, lone surrogates that no encoder takes, a gigabyte of one letter. What is shown has every character
that does not print written out as its escape, and is cut with its length told. Escaping for HTML, XML or
Markdown comes after.
"""

import re
from dataclasses import dataclass

_KEPT = "\n\t"


def visible(text: str) -> str:
    r"""Write every unprintable character out as its escape (`\x1b`, `\u202e`), but for line feed and tab.

    "Unprintable" is Python's notion: control, format (bidirectional overrides, zero width), surrogates,
    private and unassigned code points, and separators other than the space. The outcome can be encoded as
    UTF-8 and is made of characters that XML 1.0 allows.
    """
    if text.isprintable():
        return text
    return text.translate(_ESCAPES)


class _Escapes(dict[int, int | str]):
    """Code points to what stands for them; each is worked out once, which makes long texts ten times faster."""

    def __missing__(self, code: int) -> int | str:
        character = chr(code)
        shown = character.isprintable() or character in _KEPT
        self[code] = code if shown else character.encode("unicode_escape").decode()
        return self[code]


_ESCAPES = _Escapes()


def excerpt(text: str, limit: int) -> str:
    """The text on one line, cut to about `limit` characters: for messages and table cells."""
    line = " ".join(visible(text[: limit + 1]).split())
    return line if len(text) <= limit else f"{line[:limit]}…"


@dataclass(frozen=True, slots=True)
class Excerpt:
    """The beginning of a long text.

    Attributes:
        text: what is shown.
        omitted: how many characters of the text at hand are not shown.
        total: characters of the whole text, or its octets where the producer had cut it before (`unit` says
            which).
        unit: "characters" or "octets".
    """

    text: str
    omitted: int
    total: int
    unit: str = "characters"

    @property
    def cut(self) -> bool:
        """Whether the reader sees less than there was."""
        return self.omitted > 0


def beginning(text: str, limit: int, octets: int | None = None) -> Excerpt:
    """The first `limit` characters of a body, which was `octets` long before its producer cut it, where it did."""
    shown = visible(text[:limit])
    present = len(text.encode("utf-8", "surrogatepass"))
    if octets is not None and octets > present:
        return Excerpt(shown, octets - len(text[:limit].encode("utf-8", "surrogatepass")), octets, "octets")
    return Excerpt(shown, max(0, len(text) - limit), len(text))


def code_span(text: str, limit: int = 300) -> str:
    """A Markdown code span (GFM 6.3) that shows the text and nothing else.

    In a code span neither HTML nor a mention nor a link comes alive. The fence is longer than any run of
    backticks inside, and bars are escaped because GFM cuts table rows before it looks at code (GFM 4.10).
    """
    line = excerpt(text, limit) or " "
    fence = "`" * (1 + max((len(run) for run in re.findall("`+", line)), default=0))
    pad = " " if line.startswith("`") or line.endswith("`") else ""
    return f"{fence}{pad}{line.replace('|', chr(92) + '|')}{pad}{fence}"


def code_block(text: str, limit: int = 4000) -> str:
    """A fenced Markdown code block (GFM 4.5) whose fence no line of the text can close."""
    shown = beginning(text, limit)
    fence = "`" * max(3, 1 + max((len(run) for run in re.findall("`+", shown.text)), default=0))
    note = f"\n… {shown.omitted} more {shown.unit}" if shown.cut else ""
    return f"{fence}\n{shown.text}{note}\n{fence}"


def plain(text: str, limit: int = 600) -> str:
    """One line of running Markdown text in which nothing comes alive: markup, HTML, mention or reference.

    Punctuation is escaped (GFM 6.1); an empty comment after `@` and `#` keeps a forge from notifying the
    person or linking the issue that a robot happens to name.
    """
    line = re.sub(r"([\\`*_\[\]<>|~$&])", r"\\\1", excerpt(text, limit))
    return re.sub(r"([@#])(?=\w)", r"\1<!-- -->", line)
