"""Parsing of request bodies into dicts, lists and numbers: strict JSON (RFC 8259), and XML as the robot sends it.

Of XML, no entity is resolved, nothing is fetched, no DTD is loaded, and libxml2's usual limits apply (depth 256). A
document with a DOCTYPE or a processing instruction is refused (WS-I Basic Profile 1.1 R1008, R1009). The caller has
limited the document's size.

libxml2 keeps every name that a thread has parsed until that thread ends. A client that sends ever new names could fill
the robot's memory. So the main thread learns only a limited number of names, which slowly grows; a document with more
new names is parsed in a thread of its own.
"""

import codecs
import json
import math
import re
import time
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from typing import Any, Final

from lxml import etree

from reference_robot.webservices.representation.problems import Problem, check, clip
from reference_robot.webservices.representation.shapes import Real, Record, Series, Text, Truth, Whole
from reference_robot.webservices.representation.writing import JSON, XML

# The XML declaration, and a DOCTYPE after only white space, comments and processing instructions. Possessive
# quantifiers prevent slow backtracking.
_DECLARED: Final = re.compile(rb"<\?xml\s")
_DECLARATION: Final = re.compile(rb"""\A<\?xml\s[^>]*?encoding\s*=\s*["']([A-Za-z0-9._-]++)["']""")
_DOCTYPE: Final = re.compile(rb"\A(?:\s++|<\?(?s:.*?)\?>|<!--(?s:.*?)-->)*+<!DOCTYPE")
# WS-I R1012 and XML 1.0 4.3.3: every receiver must read UTF-8 and UTF-16. ASCII is a subset of UTF-8.
_UTF8: Final = frozenset({"utf-8", "ascii"})
_UTF16: Final = frozenset({"utf-16", "utf-16-le", "utf-16-be"})
# The largest number of attributes in a document. libxml2 before 2.12 compares an element's attributes pairwise.
_MOST_ATTRIBUTES: Final = 1000
_LEAST_ATTRIBUTE: Final = len(' a=""')
_ELEMENT_NAME: Final = re.compile(rb"<([^\x00-\x20/>!?]++)")  # faster than \s, which needs a table look-up per byte
_LONGEST_NAME: Final = 100  # bytes
_NEW_NAMES: Final = 32  # new names per document; ordinary messages have fewer


class KnownNames:
    """The XML names that the main thread's parser has stored, and a budget for new ones.

    Args:
        at_once: The largest budget of new names.
        interval: Seconds after which the budget grows by one name: at most some 0.9 MB a day.
        clock: The source of the time in seconds.
    """

    def __init__(
        self, at_once: int = 2000, interval: float = 10.0, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._known: set[bytes] = set()
        self._at_once = at_once
        self._interval = interval
        self._clock = clock
        self._left = float(at_once)
        self._counted_at = clock()

    def has_all(self, text: bytes) -> bool:
        """Return whether the main thread may parse a document: its new names, if any, are within the budget.

        The new names then count as known.
        """
        names = _ELEMENT_NAME.findall(text)
        # The word before an equals sign is an attribute's name, or harmlessly a word of a text.
        for before in text.split(b"=")[:-1]:
            names += before.rsplit(None, 1)[-1:]
        return self._known.issuperset(names) or self._learns(set(names) - self._known)

    def _learns(self, new: set[bytes]) -> bool:
        now = self._clock()
        self._left = min(self._at_once, self._left + (now - self._counted_at) / self._interval)
        self._counted_at = now
        if len(new) > min(_NEW_NAMES, self._left) or max(map(len, new)) > _LONGEST_NAME:
            return False
        self._left -= len(new)
        self._known.update(new)
        return True


_known_names: Final = KnownNames()


def _new_parser() -> etree.XMLParser:
    return etree.XMLParser(
        encoding="utf-8",  # the text has been converted; the declaration is ignored
        resolve_entities=False,
        no_network=True,
        load_dtd=False,
        huge_tree=False,
        remove_comments=True,  # otherwise a comment would split a value into two texts
    )


_PARSER: Final = _new_parser()


def parsed(body: bytes, charset: str | None = None) -> etree._Element:
    """Return the root element of an XML document; the media type's charset overrides its declaration (RFC 7303 3.2).

    Raises:
        Problem: 400 for a malformed document, a DOCTYPE, a processing instruction or too many attributes; 415 for an
            encoding other than UTF-8 and UTF-16.
    """
    text = _as_utf8(body, charset)
    may_have_doctype = b"<!DOCTYPE" in text
    if may_have_doctype and _DOCTYPE.match(text):
        raise Problem(400, "the document has a DOCTYPE, which is refused (WS-I BP R1008)")
    if len(text) > _MOST_ATTRIBUTES * _LEAST_ATTRIBUTE and text.count(b"=") > _MOST_ATTRIBUTES:
        raise Problem(400, f"the document has more than {_MOST_ATTRIBUTES} attributes")
    try:
        root = etree.fromstring(text, _PARSER) if _known_names.has_all(text) else _parsed_apart(text)
    except (etree.XMLSyntaxError, ValueError) as error:
        raise Problem(400, f"the body is not well-formed XML: {ascii(str(error))[1:-1]}") from error
    if may_have_doctype and root.getroottree().docinfo.internalDTD is not None:
        raise Problem(400, "the document has a DOCTYPE, which is refused (WS-I BP R1008)")
    if b"?" in text and text.find(b"<?", len(b"<?") if _DECLARED.match(text) else 0) >= 0:
        _refuse_instructions(root)
    return root


def _parsed_apart(text: bytes) -> etree._Element:
    with ThreadPoolExecutor(1) as thread:
        return thread.submit(etree.fromstring, text, _new_parser()).result()


def _as_utf8(body: bytes, charset: str | None) -> bytes:
    name = charset or _own_encoding(body)
    try:
        codec = name if name in _UTF8 else codecs.lookup(name).name
    except (LookupError, ValueError) as error:
        raise Problem(415, f"unknown charset {name!a}; send XML in UTF-8 or UTF-16") from error
    if codec in _UTF8:
        return body.removeprefix(codecs.BOM_UTF8)
    if codec not in _UTF16:
        raise Problem(415, f"charset {name!a} is not supported; send XML in UTF-8 or UTF-16 (WS-I BP R1012)")
    try:
        text = body.decode(codec)
    except UnicodeDecodeError as error:
        raise Problem(400, f"the body is not {name}: {error.reason} at byte {error.start}") from error
    return text.removeprefix("\ufeff").encode("utf-8", "surrogatepass")


def _own_encoding(body: bytes) -> str:
    """Return a document's encoding from its byte order mark, first bytes or declaration (XML 1.0 appendix F)."""
    if body[:1] == b"<" and body[1:2] not in b"?\0":
        return "utf-8"  # the usual case
    if body.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return "utf-16"
    if body.startswith(b"<\0"):
        return "utf-16-le"
    if body.startswith(b"\0<"):
        return "utf-16-be"
    declaration = _DECLARATION.match(body.removeprefix(codecs.BOM_UTF8))
    return declaration[1].decode("ascii") if declaration else "utf-8"


def _refuse_instructions(root: etree._Element) -> None:
    before_root = root.itersiblings(preceding=True)
    after_root = root.itersiblings()
    for group in (root.iter(), before_root, after_root):
        for node in group:
            if isinstance(node, etree._ProcessingInstruction):  # noqa: SLF001 - lxml has no public name for the class
                raise Problem(400, f"the document has the processing instruction {node.target!a} (WS-I BP R1009)")


ACCEPTED: Final = (JSON, XML)

# The contract's grammar of a number in paths, queries and XML; ASCII digits only. The quantifiers are
# possessive, because the text after a number never belongs to it.
NUMBER: Final = r"[+-]?+(?:[0-9]++(?:\.[0-9]++)?+|\.[0-9]++)(?:[eE][+-]?+[0-9]++)?+"
_REAL: Final = re.compile(NUMBER)
_WHOLE: Final = re.compile(r"[+-]?[0-9]{1,40}")  # more than 64 bits; Python refuses 5,000 digits
_DIGITS_READ: Final = 400  # an integer with more digits exceeds every double
_XML_SPACE: Final = " \t\r\n"


class _Beyond:
    """A JSON number that is too large for a double; its repr is the text that the client sent."""

    def __init__(self, lexeme: str) -> None:
        self.lexeme = lexeme

    def __repr__(self) -> str:
        return self.lexeme


def read(body: bytes, content_type: bytes | None, shape: Record) -> dict[str, Any]:
    """Return a JSON or XML request body as a dict that has the required shape (types of its fields).

    The caller has limited the body's size.

    Raises:
        Problem: 415 for another media type, 400 for a body that is not JSON or XML, 422 for a wrong shape or value.
    """
    media_type, charset = parsed_content_type(content_type)
    if media_type == JSON:
        if charset is not None and charset not in {"utf-8", "utf8", "us-ascii"}:
            raise _media_problem(f"charset {charset!a}")
        return dict(check(shape, read_json(body)))
    if media_type == XML:
        root = parsed(body, charset)
        if root.tag != shape.name:
            raise Problem(422, f"the root element must be {shape.name}, not {clip(root.tag)}")
        return dict(check(shape, _from_element(root, shape, shape.name)))
    raise _media_problem(f"Content-Type {(content_type or b'').decode('latin-1')[:200]!a}")


@lru_cache(maxsize=256)
def parsed_content_type(field: bytes | None) -> tuple[str, str | None]:
    """Return media type and charset of a Content-Type in lower case (RFC 9110 8.3.1); the charset may be None."""
    media_type, *parameters = (field or b"").decode("latin-1").lower().split(";")
    for parameter in parameters:
        name, _, value = parameter.partition("=")
        if name.strip() == "charset":
            return media_type.strip(), value.strip().strip('"')
    return media_type.strip(), None


def read_json(body: bytes) -> Any:
    """Return the value of a JSON text; numbers too large for a double become ``_Beyond`` objects.

    Raises:
        Problem: 400 for a byte order mark, invalid UTF-8, invalid JSON (including NaN and Infinity) and too deep
            nesting; 422 for a name that occurs twice in one object.
    """
    if body.startswith(codecs.BOM_UTF8):
        raise Problem(400, "the body begins with a byte order mark (RFC 8259 8.1)")
    try:
        return json.loads(
            body.decode(),
            object_pairs_hook=_object,
            parse_constant=_refuse_constant,
            parse_float=_real,
            parse_int=_whole,
        )
    except UnicodeDecodeError as error:
        raise Problem(400, f"the body is not UTF-8: {error.reason} at byte {error.start}") from error
    except json.JSONDecodeError as error:
        raise Problem(400, f"the body is not JSON: {error.msg} at line {error.lineno} column {error.colno}") from error
    except RecursionError as error:
        raise Problem(400, "the body is nested too deeply") from error


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    result = dict(pairs)
    if len(result) != len(pairs):
        twice, _ = Counter(name for name, _ in pairs).most_common(1)[0]
        raise Problem(422, f"the field {clip(twice)} occurs more than once in {clip(pairs)}")
    return result


def _refuse_constant(name: str) -> None:
    raise Problem(400, f"{name} is not a JSON number (RFC 8259 6)")


def _real(lexeme: str) -> float | _Beyond:
    number = float(lexeme)
    return number if math.isfinite(number) else _Beyond(lexeme)


def _whole(lexeme: str) -> int | _Beyond:
    return int(lexeme) if len(lexeme) <= _DIGITS_READ else _Beyond(lexeme)


def _from_element(element: etree._Element, shape: Any, where: str) -> Any:
    """Return the value of an XML element; a value of a wrong type remains text, which ``checked`` refuses later."""
    if element.attrib:
        raise Problem(422, f"unknown attribute {clip(next(iter(element.attrib)))} of {where}")
    if isinstance(shape, Record):
        return _from_children(element, shape, where)
    if len(element):
        raise Problem(422, f"{where} must hold a single value, not elements")
    text = element.text or ""
    value = text.strip(_XML_SPACE)
    if isinstance(shape, Real) and _REAL.fullmatch(value):
        return _real(value)
    if isinstance(shape, Whole) and _WHOLE.fullmatch(value):
        return int(value)
    if isinstance(shape, Truth) and value in {"true", "false", "1", "0"}:
        return value in {"true", "1"}
    return text


def _from_children(element: etree._Element, shape: Record, where: str) -> dict[str, Any]:
    result: dict[str, Any] = {name: [] for name, part in shape.fields if isinstance(part, Series)}
    _refuse_text(element.text, where)
    for child in element:
        _refuse_text(child.tail, where)
        part = shape.field(child.tag)
        path = f"{where}.{child.tag}"
        if isinstance(part, Series):
            result[child.tag].append(_from_element(child, part.item, path))
        elif child.tag in result:
            raise Problem(422, f"{clip(path)} occurs more than once")
        else:
            result[child.tag] = _from_element(child, part or Text(), path)
    return result


def _refuse_text(text: str | None, where: str) -> None:
    if text and text.strip(_XML_SPACE):
        raise Problem(422, f"{where} holds elements, not the text {clip(text.strip())}")


def _media_problem(what: str) -> Problem:
    accepted = ", ".join(ACCEPTED)
    return Problem(415, f"{what} is not supported; send {accepted} in UTF-8", ((b"accept", accepted.encode()),))
