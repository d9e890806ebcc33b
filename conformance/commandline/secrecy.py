r"""Mask the secrets of this process in everything that it writes.

``SECRETS`` knows each credential as soon as it is read, and what writes asks it: result files, traces, stdout and
stderr, logs and tracebacks. A secret is recognized in these forms, and in each of them inside another one:

- as it is, in any case, and as UTF-16;
- percent-encoded, as JSON (``\u0073``), as entities (``&#115;``), with backslashes, quoted-printable, in whole or part;
- in base64 (both alphabets, at each of the three alignments);
- as a dump of its bytes: hexadecimal digits, also with a mark between them or ``0x`` before each, or decimal numbers;
- broken over several lines, or cut short before an ellipsis or a quotation mark.

Not recognized are a reversed or encrypted secret, and base64 of an escaped one.
"""

import gzip
import re
import threading
import zlib
from base64 import b64encode
from bisect import bisect_right
from collections.abc import Iterator
from itertools import takewhile
from operator import itemgetter
from pathlib import Path
from typing import Any, Final, NamedTuple
from urllib.parse import unquote

# Shortest secret that is masked, and shortest one that is a word or number: shorter ones occur by chance.
_SHORTEST: Final = 5
_SHORTEST_WORD: Final = 8
_MOST_KNOWN: Final = 100
_REMEMBERED: Final = 1000
_MOST_REMEMBERED: Final = 4096
_BEGINNING: Final = 8  # a cut text may end in this many first characters of a secret: mask them
_LONG: Final = 12  # only for secrets that are at least this long
_CUT: Final = re.compile(r"\Z|[\s\"'`<\\]")
_ELLIPSIS: Final = re.compile(r"…+|\.{3,}")
_SHORTEST_CUT: Final = 4  # fewest characters of a secret before an ellipsis that are recognised
_LONGEST_CUT: Final = 256
# Escapes may be nested: decode them up to this many times.
_DEPTH: Final = 4
_ESCAPE: Final = re.compile(
    r"%(?:25){0,8}(?:(?P<wide>(?:[C-Dc-d][0-9A-Fa-f]|[Ee][0-9A-Fa-f]%(?:25){0,8}[89ABab][0-9A-Fa-f])"
    r"%(?:25){0,8}[89ABab][0-9A-Fa-f])|(?P<percent>[0-9A-Fa-f]{2}))"
    r"|%u(?P<percent_u>[0-9A-Fa-f]{4})"
    r"|\\\\{0,15}(?:u(?P<u>[0-9A-Fa-f]{4})|u\{0{0,5}(?P<braced>[0-9A-Fa-f]{1,4})\}|U0{4}(?P<long>[0-9A-Fa-f]{4})"
    r"|x(?P<x>[0-9A-Fa-f]{2})|(?P<octal>[01][0-7]{2})|(?P<itself>[\"'/<>&]))"
    r"|\\\\{1,15}(?P<backslash>)"
    r"|&(?:amp;){0,8}(?:#[xX]0{0,6}(?P<hex>[0-9A-Fa-f]{1,4})|#0{0,6}(?P<decimal>[0-9]{1,5})"
    r"|(?P<name>amp|lt|gt|quot|apos));?"
)
_NAMED: Final = {"amp": "&", "lt": "<", "gt": ">", "quot": '"', "apos": "'"}
_LINE_END: Final = r"(?:\\{1,16}[rn]|[\r\n])"
_QUOTED_PRINTABLE: Final = re.compile(rf"=(?:(?P<hex>[0-9A-F]{{2}})|{_LINE_END}{{1,4}})")
_FOLDED: Final = re.compile(rf"{_LINE_END}[ \t]*")
_UNITS: Final = (_ESCAPE, _QUOTED_PRINTABLE, _FOLDED)
_URLSAFE: Final = str.maketrans("+/", "-_")
# Secrets recognised by their place: cookies that a device sets, and password digests, from which a password can be
# guessed (RFC 7616 3.4.1; UsernameToken Profile 1.0, 3.1).
_SET_COOKIE: Final = re.compile(r"([Ss][Ee][Tt]-[Cc][Oo][Oo][Kk][Ii][Ee]2?: ?[^=;,\s\"]{1,99}=)[^;,\s\"]+")
_ANSWER: Final = re.compile(r"(\bresponse=[\\\"']{0,9})[0-9A-Fa-f]{32,64}")
_PASSWORD_DIGEST: Final = re.compile(r"(#PasswordDigest[^<>]{0,99}>)[^<]{1,99}")
_PLACES: Final = (
    ("ookie", _SET_COOKIE, r"\1$ROAAS_SET_COOKIE"),
    ("OOKIE", _SET_COOKIE, r"\1$ROAAS_SET_COOKIE"),
    ("response=", _ANSWER, r"\1$ROAAS_DIGEST"),
    ("#PasswordDigest", _PASSWORD_DIGEST, r"\1$WSSE_DIGEST"),
)
_COOKIE: Final = re.compile(r"^([^=;]{1,99}=)[^;]+")
# A password in a URL (RFC 3986 3.2.1).
_USERINFO: Final = re.compile(r"://[^/?#\s:@\"']{0,99}:([^/?#\s@\"']{1,999})@")
# Gzipped bodies up to this many bytes are unpacked and searched too.
_GZIP: Final = b"\x1f\x8b"
_MOST: Final = 1 << 24
# Words of the result formats and requirements are never masked: no program could read the result without them.
_ROOMS: Final = Path(__file__).parents[2]
_OUR_WORDS: Final = ("reports/schemas/*.json", "conformance/rules/requirements.toml", "conformance/packs/*/*.toml")


class _Form(NamedTuple):
    """One form of a secret: the text to search for first, the whole form, and its replacement."""

    beginning: str
    whole: str
    variable: str


class Secrets:
    """The secrets of a process, each with the variable that replaces it in all output."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self.forget()

    def forget(self) -> None:
        """Forget all secrets, as the tests of one process do between two runs."""
        self._known: set[str] = set()
        self._names: set[str] = set()
        # Cache: many texts are written repeatedly.
        self._seen: dict[str, str] = {}
        self._weak: dict[str, str] = {}
        # Forms of secrets that are compared without regard to case.
        self._folded: tuple[_Form, ...] = ()
        self._exact: tuple[_Form, ...] = ()  # all other forms
        self._dumps: tuple[_Form, ...] = ()
        # Secrets that may be cut there, and after how many characters, by the last characters before an ellipsis.
        self._cuts: dict[str, list[tuple[_Form, int]]] = {}

    def __bool__(self) -> bool:
        return bool(self._known)

    def keep(self, secret: str, variable: str) -> None:
        """Mask a secret from now on.

        Args:
            secret: the text.
            variable: what stands in its place, such as ``$ROAAS_TOKEN``.
        """
        with self._lock:
            if not secret or secret in self._known:
                return
            if len(self._known) >= _MOST_KNOWN:
                # A device may issue tokens without end, and each is searched for in every text.
                self._weak[variable] = f"is one of more than {_MOST_KNOWN}"
                return
            self._known.add(secret)
            self._seen.clear()
            if why := _weakness(secret):
                self._weak[variable] = why
                return
            folded, exact = _forms(secret)
            self._folded = _with(self._folded, folded, variable)
            self._exact = _with(self._exact, exact, variable)
            # A truncated dump would be a few numbers, as any list has them.
            self._dumps = (*self._dumps, *(_Form(dump, dump, variable) for dump in _dumps(secret)))
            cuts: dict[str, list[tuple[_Form, int]]] = {}
            for form in (*self._folded, *self._exact):
                for length in range(min(len(form.whole), _LONGEST_CUT), _SHORTEST_CUT - 1, -1):
                    cuts.setdefault(form.whole[length - _SHORTEST_CUT : length].lower(), []).append((form, length))
            self._cuts = cuts

    def spare(self, name: str) -> None:
        """Show a name that results need, although a secret may begin with it: ``conveyor`` of ``conveyor-token``."""
        with self._lock:
            self._names.add(name.lower())
            self._seen.clear()

    def keep_userinfo(self, text: str) -> None:
        """Mask the passwords of all URLs in a text that have one (``http://user:password@robot``)."""
        for found in _USERINFO.finditer(text):
            self.keep(found[1], "$ROAAS_URL_PASSWORD")
            self.keep(unquote(found[1]), "$ROAAS_URL_PASSWORD")

    @property
    def notes(self) -> tuple[str, ...]:
        """A sentence on each secret that is not masked."""
        return tuple(
            f"The secret behind {variable} {why}: it is not masked, and may appear in the results."
            for variable, why in self._weak.items()
        )

    def masked(self, text: str) -> str:
        """Return a text with variables in place of all secrets."""
        if not self._known:
            return text
        shown = self._seen.get(text)
        if shown is None:
            shown = self._masked(text)
            if len(text) <= _REMEMBERED:
                if len(self._seen) >= _MOST_REMEMBERED:
                    self._seen.clear()
                self._seen[text] = shown
        return shown

    def _masked(self, text: str) -> str:
        for mark, place, shown in _PLACES:
            if mark in text:
                text = place.sub(shown, text)
        parts, end = list[str](), 0
        spared = self._names - {secret.lower() for secret in self._known}
        for begin, until, variable in sorted(self._spans(text), key=lambda span: (span[0], -span[1])):
            if text[begin:until].lower() in spared:
                continue
            if begin >= end:
                parts += (text[end:begin], variable)
            end = max(end, until)
        return "".join((*parts, text[end:])) if parts else text

    def masked_bytes(self, octets: bytes) -> bytes:
        """Return bytes with variables in place of all secrets; gzipped ones stay gzipped."""
        if not self._known or not octets:
            return octets
        if octets.startswith(_GZIP):
            try:
                plain = zlib.decompressobj(31).decompress(octets, _MOST)
            except zlib.error:
                plain = b""
            shown = self.masked_bytes(plain)
            return octets if shown == plain else gzip.compress(shown, mtime=0)
        text = octets.decode("latin-1")
        shown_text = self.masked(text)
        return octets if shown_text == text else shown_text.encode("latin-1", "replace")

    def masked_json(self, value: Any) -> Any:
        """Return JSON, which may have bytes in it, with variables in place of the secrets in texts, names and bytes."""
        return self._mask(value) if self._known else value

    def _mask(self, value: Any) -> Any:
        if isinstance(value, str):
            return self.masked(value)
        if isinstance(value, bytes):
            return self.masked_bytes(value)
        if isinstance(value, dict):
            return {self._mask(key): _without_cookie(key, self._mask(item)) for key, item in value.items()}
        if isinstance(value, list | tuple):
            items = [self._mask(item) for item in value]
            return [items[0], _without_cookie(*items)] if len(items) == 2 else items  # noqa: PLR2004 - name and value
        return value

    def _spans(self, text: str, depth: int = 0) -> Iterator[tuple[int, int, str]]:
        """Yield where a text shows a secret: begin, end, variable."""
        lowered = text.lower()
        if len(lowered) != len(text):
            lowered = "".join(small if len(small := char.lower()) == 1 else char for char in text)
        for forms, where in ((self._folded, lowered), (self._exact, text), (self._dumps, lowered)):
            for form in (form for form in forms if form.beginning in where):
                yield from _find(form, where)
        for cut in _ELLIPSIS.finditer(lowered):
            end = cut.start()
            for form, length in self._cuts.get(lowered[max(0, end - _SHORTEST_CUT) : end], ()):
                if lowered.startswith(form.whole[:length].lower(), end - length):
                    yield end - length, end, form.variable
                    break
        for unit in (_UNITS if depth == 0 else _UNITS[:1]) if depth < _DEPTH else ():
            plain, places = _unescape(unit, text)
            for begin, end, variable in self._spans(plain, depth + 1) if places else ():
                yield _outer(begin, places)[0], _outer(end - 1, places)[1], variable


def _weakness(secret: str) -> str:
    """Return why a secret cannot be masked without masking other text, or an empty text."""
    if len(secret) < _SHORTEST:
        return f"has {len(secret)} character{'' if len(secret) == 1 else 's'}, too few to be recognized"
    if len(secret) < _SHORTEST_WORD and (secret.isalpha() or secret.isdigit()):
        return "is a short word or number, as other texts have it"
    ours = (path for pattern in _OUR_WORDS for path in _ROOMS.glob(pattern))
    if any(secret.lower() in path.read_text(encoding="utf-8").lower() for path in ours):
        return "is a word that the results use themselves"
    return ""


def _forms(secret: str) -> tuple[set[str], set[str]]:
    """Return the forms of a secret that are compared without case, in lower case, and the others."""
    octets, wide = secret.encode("utf-8", "surrogateescape"), secret.encode("utf-16-le", "surrogatepass")
    small = {secret, secret.replace(" ", "+"), re.sub(r"\\+", r"\\", secret)}
    small |= {form.encode("utf-8", "surrogateescape").decode("latin-1") for form in small}
    small |= {"\0".join(secret), octets.hex(), wide.hex()}
    exact = {_base64(form, shift) for form in (octets, wide) for shift in range(3)}
    exact |= {form.translate(_URLSAFE) for form in exact}
    return {form.lower() for form in small}, {form for form in exact if len(form) >= _SHORTEST}


def _dumps(secret: str) -> set[str]:
    """Return the bytes of a secret as lists of numbers."""
    octets = secret.encode("utf-8", "surrogateescape")
    numbers = [gap.join(map(write, octets)) for gap in (" ", ",", ", ") for write in (str, hex)]
    return {*numbers, *(octets.hex(mark) for mark in ":- ")}


def _base64(octets: bytes, shift: int) -> str:
    """Return the characters of base64 that bytes alone decide where ``shift`` others are before them."""
    encoded = b64encode(bytes(shift) + octets).decode()
    return encoded[(0, 2, 3)[shift] : (shift + len(octets)) * 8 // 6]


def _with(before: tuple[_Form, ...], forms: set[str], variable: str) -> tuple[_Form, ...]:
    made = (_Form(form[:_BEGINNING] if len(form) >= _LONG else form, form, variable) for form in forms)
    return tuple(sorted({*before, *made}, key=lambda form: -len(form.whole)))


def _find(form: _Form, text: str) -> Iterator[tuple[int, int, str]]:
    """Yield where a text has a form of a secret, or its beginning before a cut."""
    begin = text.find(form.beginning)
    while begin >= 0:
        end = begin + len(form.beginning)
        if len(form.beginning) < len(form.whole):
            alike = zip(form.whole, text[begin : begin + len(form.whole)], strict=False)
            end = begin + len([*takewhile(lambda pair: pair[0] == pair[1], alike)])
        if end - begin == len(form.whole) or _CUT.match(text, end):
            yield begin, end, form.variable
        begin = text.find(form.beginning, end)


def _decode(unit: re.Match[str]) -> str:
    """Return the character that an escape stands for."""
    kind, digits = unit.lastgroup, unit[unit.lastgroup] if unit.lastgroup else ""
    if kind is None:
        return ""
    if kind == "name":
        return _NAMED[digits]
    if kind == "wide":
        return bytes.fromhex(re.sub("%(?:25)*", "", digits)).decode("utf-8", "replace")
    if kind in {"itself", "backslash"}:
        return digits or "\\"
    return chr(int(digits, {"decimal": 10, "octal": 8}.get(kind, 16)))


def _unescape(unit: re.Pattern[str], text: str) -> tuple[str, list[tuple[int, int, int, int]]]:
    """Return a text without its escapes, and their places: begin and end in it, begin and end in the escaped text."""
    parts, places, last, at = list[str](), list[tuple[int, int, int, int]](), 0, 0
    for found in unit.finditer(text):
        (begin, end), char = found.span(), _decode(found)
        at += begin - last
        parts += (text[last:begin], char)
        places.append((at, at + len(char), begin, end))
        last, at = end, at + len(char)
    return "".join((*parts, text[last:])), places


def _outer(position: int, places: list[tuple[int, int, int, int]]) -> tuple[int, int]:
    """Return where a character of the text without escapes begins and ends in the escaped one."""
    before = bisect_right(places, position, key=itemgetter(0))
    _, until, begin, end = places[before - 1] if before else (0, 0, 0, 0)
    return (begin, end) if position < until else (end + position - until, end + position - until + 1)


def _without_cookie(name: Any, value: Any) -> Any:
    """Return a header's value, or values, without the secrets in a Set-Cookie."""
    if not (isinstance(name, str) and name.lower() == "set-cookie"):
        return value
    if isinstance(value, list):
        return [_without_cookie(name, item) for item in value]
    return _COOKIE.sub(r"\1$ROAAS_SET_COOKIE", value) if isinstance(value, str) else value


#: The secrets of this process.
SECRETS: Final = Secrets()
