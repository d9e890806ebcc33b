"""Hostile XML documents, made from a harmless one that the robot takes.

Each attack names the requirement that it is for and what a robot must not do with it.
"""

from __future__ import annotations

import codecs
import gzip
import zlib
from collections import Counter
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

# In a document: where text is that the robot reads as a value; and where it is that it may pass over.
VALUE: Final = "roaas-value-here"
ASIDE: Final = "roaas-aside-here"
# What an entity expands to that nobody wrote in one piece.
MARK: Final = "roaas-expanded-4711"
# How files begin that nearly every robot has (Unix, Windows).
LEAKS: Final = rb"root:[^:\n]{0,40}:0:0:|; for 16-bit app support|127\.0\.0\.1\s+localhost"
_FILES: Final = ("file:///etc/passwd", "file:///etc/hosts", "file:///c:/windows/win.ini")
_DEPTH: Final = 100_000
_ATTRIBUTES: Final = 20_000
_LONG: Final = 1_000_000
# Half a mebibyte over the limit that the contract sets (10 MiB).
_OVER: Final = 10 * 1024 * 1024 + 512 * 1024


@dataclass(frozen=True)
class Attack:
    """One hostile document.

    Attributes:
        name: of the requirement, in class xml-security.
        what: in a few words.
        body: octets.
        must_refuse: whether taking it is a breach. Where not, only what becomes of it counts.
        lure: what the trap's URL in it stands for, or empty.
        headers: further HTTP fields.
    """

    name: str
    what: str
    body: bytes = field(repr=False)
    must_refuse: bool = True
    lure: str = ""
    headers: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True)
class Carrier:
    """A harmless document to put attacks into.

    Attributes:
        document: with VALUE where a value is, and ASIDE at a place that a robot may pass over (or no ASIDE).
        root: qualified name of its document element, as written.
        value: what stands at VALUE in the harmless document.
    """

    document: str
    root: str
    value: str

    def written(self, value: str | None = None, aside: str = "", prolog: str = "") -> str:
        """The document with something in its places, after a prolog."""
        text = self.value if value is None else value
        # Without a place to pass over, what was meant for it stands in the value.
        if ASIDE not in self.document:
            text += aside
        return prolog + self.document.replace(VALUE, text).replace(ASIDE, aside)

    def octets(self, value: str | None = None, aside: str = "", prolog: str = "") -> bytes:
        """As written(), in UTF-8."""
        return self.written(value, aside, prolog).encode()


def attacks(carrier: Carrier, url: Callable[[str], str], each: int, place: str = "") -> Iterator[Attack]:
    """The attacks on one document.

    Args:
        carrier: the document.
        url: gives the trap's URL for a lure.
        each: how many for one requirement at most.
        place: tells the lures of this document from those of another.
    """
    for make in (_doctypes, _internal, _external, _expansions, _inclusions, _sizes, _instructions):
        made: Counter[str] = Counter()
        for attack in make(carrier, lambda lure: url(f"{place}{lure}")):
            made[attack.name] += 1
            if made[attack.name] <= each:
                yield replace(attack, lure=f"{place}{attack.lure}") if attack.lure else attack


def _doctypes(carrier: Carrier, _url: Callable[[str], str]) -> Iterator[Attack]:
    root = carrier.root
    bare = f"<!DOCTYPE {root}>"
    yield Attack("doctype", "a bare DOCTYPE", carrier.octets(prolog=bare))
    yield Attack(
        "doctype",
        "a DOCTYPE with an internal subset",
        carrier.octets(prolog=f"<!DOCTYPE {root} [<!ELEMENT {root} ANY>]>"),
    )
    yield Attack("doctype", "a DOCTYPE after a comment", carrier.octets(prolog=f"<!-- <a> -->\n\n{bare}"))
    yield Attack(
        "doctype",
        "a DOCTYPE after the XML declaration",
        carrier.octets(prolog=f'<?xml version="1.0" encoding="UTF-8"?>\n{bare}'),
    )
    # In UTF-16, so that who looks for the octets "<!DOCTYPE" does not find them.
    wide = carrier.written(prolog=f'<?xml version="1.0" encoding="UTF-16"?>{bare}')
    yield Attack("doctype", "a DOCTYPE in UTF-16", codecs.BOM_UTF16_LE + wide.encode("utf-16-le"))


def _internal(carrier: Carrier, _url: Callable[[str], str]) -> Iterator[Attack]:
    half = max(1, len(carrier.value) // 2)
    first, second = carrier.value[:half], carrier.value[half:]
    subset = f'<!DOCTYPE {carrier.root} [<!ENTITY a "{first}"><!ENTITY b "&a;{second}">]>'
    yield Attack("internal-entity", "a value made of entities", carrier.octets("&b;", prolog=subset))
    subset = f'<!DOCTYPE {carrier.root} [<!ENTITY a "{MARK[:9]}"><!ENTITY b "&a;{MARK[9:]}">]>'
    yield Attack("internal-entity", "a text made of entities", carrier.octets("&b;", prolog=subset))
    yield Attack("internal-entity", "an entity aside", carrier.octets(aside="&b;", prolog=subset))
    attribute = f'<!DOCTYPE {carrier.root} [<!ENTITY a "x"><!ATTLIST {carrier.root} id CDATA "{MARK}">]>'
    yield Attack("internal-entity", "an attribute that the DTD adds", carrier.octets(prolog=attribute))


def _external(carrier: Carrier, url: Callable[[str], str]) -> Iterator[Attack]:
    root = carrier.root
    for file in _FILES:
        subset = f'<!DOCTYPE {root} [<!ENTITY x SYSTEM "{file}">]>'
        yield Attack("external-entity", f"{file} as a value", carrier.octets("&x;", prolog=subset))
    subset = f'<!DOCTYPE {root} [<!ENTITY x SYSTEM "{_FILES[0]}">]>'
    yield Attack("external-entity", f"{_FILES[0]} aside", carrier.octets(aside="&x;", prolog=subset))
    subset = f'<!DOCTYPE {root} [<!ENTITY x SYSTEM "{url("entity")}">]>'
    yield Attack("external-entity", "an entity from elsewhere", carrier.octets("&x;", prolog=subset), lure="entity")
    subset = f'<!DOCTYPE {root} [<!ENTITY x PUBLIC "-//A//B//EN" "{url("public")}">]>'
    yield Attack("external-entity", "a public entity", carrier.octets("&x;", prolog=subset), lure="public")
    for what, prolog, lure in (
        ("an external DTD", f'<!DOCTYPE {root} SYSTEM "{url("dtd")}">', "dtd"),
        ("an external DTD that is a file", f'<!DOCTYPE {root} SYSTEM "{_FILES[0]}">', ""),
        (
            "a parameter entity from elsewhere",
            f'<!DOCTYPE {root} [<!ENTITY % p SYSTEM "{url("parameter")}"> %p;]>',
            "parameter",
        ),
        (
            "a parameter entity that is a file",
            f'<!DOCTYPE {root} [<!ENTITY % p SYSTEM "{_FILES[0]}"> %p;]>',
            "",
        ),
    ):
        yield Attack("parameter-entity", what, carrier.octets(prolog=prolog), lure=lure)


def _expansions(carrier: Carrier, _url: Callable[[str], str]) -> Iterator[Attack]:
    levels = "".join(f'<!ENTITY l{level} "{f"&l{level - 1};" * 10}">' for level in range(1, 10))
    subset = f'<!DOCTYPE {carrier.root} [<!ENTITY l0 "lol">{levels}]>'
    # Aside, where a robot that expands them may pass over what comes out; as a value, where it would have to keep it.
    yield Attack("expansion", "a thousand million laughs aside", carrier.octets(aside="&l9;", prolog=subset))
    yield Attack("expansion", "a thousand million laughs", carrier.octets("&l9;", prolog=subset))
    levels = "".join(f'<!ENTITY % q{level} "{f"&#37;q{level - 1};" * 10}">' for level in range(1, 10))
    subset = f'<!DOCTYPE {carrier.root} [<!ENTITY % q0 "<!-- -->">{levels} %q9;]>'
    yield Attack("expansion", "laughs in parameter entities", carrier.octets(prolog=subset))
    subset = f'<!DOCTYPE {carrier.root} [<!ENTITY a "&b;"><!ENTITY b "&a;">]>'
    yield Attack("expansion", "entities that hold each other", carrier.octets("&a;", prolog=subset))
    subset = f'<!DOCTYPE {carrier.root} [<!ENTITY a "{"a" * 50_000}">]>'
    yield Attack("quadratic", "one long entity 5,000 times aside", carrier.octets(aside="&a;" * 5000, prolog=subset))
    yield Attack("quadratic", "one long entity 5,000 times", carrier.octets("&a;" * 5000, prolog=subset))


def _inclusions(carrier: Carrier, url: Callable[[str], str]) -> Iterator[Attack]:
    for where in ("value", "aside"):
        for what, target, lure in (
            ("a file", _FILES[0], ""),
            ("elsewhere", url(f"xinclude-{where}"), f"xinclude-{where}"),
        ):
            include = f'<xi:include xmlns:xi="http://www.w3.org/2001/XInclude" href="{target}" parse="text"/>'
            body = carrier.octets(include) if where == "value" else carrier.octets(aside=include)
            yield Attack("xinclude", f"XInclude of {what} ({where})", body, must_refuse=False, lure=lure)
    hint = (
        ' xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance"'
        f' xsi:schemaLocation="urn:example:a {url("schema")}" xsi:noNamespaceSchemaLocation="{url("schema")}"'
    )
    yield Attack("no-callback", "xsi:schemaLocation", _with_attributes(carrier, hint), must_refuse=False, lure="schema")


def _with_attributes(carrier: Carrier, attributes: str) -> bytes:
    """The document with attributes on its document element."""
    start = f"<{carrier.root}"
    return carrier.octets().replace(start.encode(), f"{start}{attributes}".encode(), 1)


def _sizes(carrier: Carrier, _url: Callable[[str], str]) -> Iterator[Attack]:
    yield Attack("depth", "100,000 elements in each other", carrier.octets(aside="<d>" * _DEPTH + "</d>" * _DEPTH))
    yield Attack("depth", "100,000 start tags", carrier.octets("<d>" * _DEPTH))
    many = ' xmlns:q="urn:example:q"' + "".join(f' q:a{number}=""' for number in range(_ATTRIBUTES))
    yield Attack("attributes", "20,000 attributes", _with_attributes(carrier, many))
    name = "n" * _LONG
    yield Attack("long-name", "a name of a million characters", carrier.octets(aside=f"<{name}/>"))
    yield Attack("size", "a comment of 10.5 MiB", carrier.octets(aside=f"<!--{' ' * _OVER}-->"))
    yield Attack("size", "white space of 10.5 MiB", carrier.octets(" " * _OVER + carrier.value))
    wide = carrier.octets(aside=f"<!--{' ' * _OVER}-->")
    for coding, packed in (("gzip", gzip.compress(wide, 6, mtime=0)), ("deflate", zlib.compress(wide, 6))):
        yield Attack(
            "compressed",
            f"10.5 MiB in {len(packed) // 1024} KiB of {coding}",
            packed,
            headers=(("Content-Encoding", coding),),
        )


def _instructions(carrier: Carrier, url: Callable[[str], str]) -> Iterator[Attack]:
    sheet = f'<?xml-stylesheet type="text/xsl" href="{url("stylesheet")}"?>'
    yield Attack("processing-instruction", "a style sheet", carrier.octets(prolog=sheet), lure="stylesheet")
    yield Attack("processing-instruction", "an instruction aside", carrier.octets(aside="<?run this?>"))
    yield Attack("processing-instruction", "an instruction at the end", carrier.octets() + b"<?run this?>")
