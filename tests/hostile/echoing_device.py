"""A device that repeats whatever it is sent, in its responses, error texts, headers and description, in each encoding.

And the search for a secret in what a run wrote, by other means than those that mask it.
"""

import base64
import binascii
import gzip
import hashlib
import html
import json
import quopri
import re
import zlib
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any
from urllib.parse import quote, unquote

from aiohttp import web
from small_device import REFUSED, answers, described, small_device
from soap_devices import SCALE, Device

#: How the device writes what it was sent, by name.
ENCODINGS = {
    "plain": str,
    "upper": str.upper,
    "percent": lambda text: quote(text, safe=""),
    "percent_all": lambda text: "".join(f"%{octet:02x}" for octet in text.encode()),
    "percent_twice": lambda text: quote("".join(f"%{octet:02X}" for octet in text.encode())),
    "escaped": lambda text: "".join(f"\\u{ord(char):04x}" for char in text),
    "json": lambda text: json.dumps(json.dumps({"sent": text})),
    "hex_escaped": lambda text: "".join(f"\\x{octet:02x}" for octet in text.encode()),
    "html": lambda text: html.escape(html.escape(text)),
    "entities": lambda text: "".join(f"&#x{ord(char):x};" for char in text),
    "base64": lambda text: base64.b64encode(text.encode()).decode(),
    "base64_1": lambda text: base64.b64encode(b"#" + text.encode()).decode(),
    "base64_2": lambda text: base64.urlsafe_b64encode(b"##" + text.encode()).decode(),
    "hex": lambda text: text.encode().hex().upper(),
    "quoted_printable": lambda text: quopri.encodestring(text.encode(), quotetabs=True).decode(),
    "utf_16": "\0".join,
}
_SHORT = {"plain", "percent", "base64", "hex"}
_BASE64 = re.compile(rb"[A-Za-z0-9+/_-]{12,}={0,2}")
_READABLE = bytes([0, 9, 10, 13, *range(32, 127)])
#: What `_undone` undoes.
_ESCAPED = re.compile(r"%[0-9a-fA-F]{2}|&[#a-zA-Z]|\\[ux\"'/\\]")


def _sent(request: web.Request, body: bytes) -> str:
    fields = "; ".join(f"{name}: {value}" for name, value in request.headers.items())
    return f"{request.raw_path} {fields} {body.decode('latin-1')}"


def echoed(request: web.Request, body: bytes) -> dict[str, str]:
    """Return what a request consists of, in each encoding."""
    return {name: write(_sent(request, body)) for name, write in ENCODINGS.items()}


def _headers(request: web.Request) -> dict[str, str]:
    sent = " ".join(value for name, value in request.headers.items() if name.lower() not in {"accept", "host"})
    shown = {f"X-Echo-{name}": ENCODINGS[name](sent)[:6000] for name in sorted(_SHORT)}
    return shown | {"Set-Cookie": "session=5e55ion-0f-th1s-run; Path=/"}


async def _wrong(request: web.Request) -> web.Response:
    """Answer 200 with what the schema does not have."""
    return web.json_response(echoed(request, await request.read()), headers=_headers(request))


async def _zipped(request: web.Request) -> web.Response:
    body = gzip.compress(json.dumps(echoed(request, await request.read())).encode())
    return web.Response(body=body, headers={**_headers(request), "Content-Type": "application/json"})


async def _failing(request: web.Request) -> web.Response:
    """Answer 500 with a traceback that has the request in it."""
    said = "\n".join(echoed(request, await request.read()).values())
    text = f'Traceback (most recent call last):\n  File "app.py", line 1\nKeyError: {said}'
    return web.Response(status=500, text=text, headers=_headers(request))


class _Tiring:
    """Answers as it should twelve times, and then with 500 and what it was sent."""

    def __init__(self) -> None:
        self.calls = 0

    async def __call__(self, request: web.Request) -> web.Response:
        self.calls += 1
        if self.calls > 12 and self.calls % 4 == 0:
            return await _failing(request)
        return web.json_response({"number": 1}, headers={**_headers(request), "Server": _sent(request, b"")[:4000]})


_NUMBER = {"type": "object", "required": ["number"], "properties": {"number": {"type": "integer"}}}


def _described(request: web.Request) -> dict[str, Any]:
    operation = {"responses": {"200": answers(_NUMBER), "4XX": REFUSED}}
    posted = operation | {"requestBody": {"content": {"application/json": {"schema": _NUMBER}}}}
    paths = {f"/{name}": {"get": operation, "post": posted} for name in ("wrong", "zipped", "failing", "tiring")}
    return described(
        paths | {"/wrong": {"get": operation | {"description": str(echoed(request, b""))}, "post": posted}}
    )


@contextmanager
def echoing_device(user: str = "", password: str = "", token: str = "") -> Iterator[str]:
    """Serve the device; with a user it demands digest authentication, and ``POST /login`` gives the token."""

    def guarded(answer: Any) -> Any:
        async def handle(request: web.Request) -> web.StreamResponse:
            if user and not authenticated(request, user, password):
                challenge = 'Digest realm="lab", nonce="dcd98b7102dd", qop="auth", algorithm=MD5'
                return web.json_response(
                    {"error": _sent(request, b"")}, status=401, headers={"WWW-Authenticate": challenge}
                )
            response: web.StreamResponse = await answer(request)
            return response

        return handle

    async def description(request: web.Request) -> web.Response:
        return web.json_response(_described(request))

    async def login(request: web.Request) -> web.Response:
        tokens = {"access_token": token, "refresh_token": f"refresh-{token[::-1]}", "token_type": "bearer"}
        return web.json_response(tokens, headers=_headers(request))

    routes = {
        f"/{name}": {"GET": guarded(answer), "POST": guarded(answer)}
        for name, answer in (("wrong", _wrong), ("zipped", _zipped), ("failing", _failing), ("tiring", _Tiring()))
    }
    routes |= {"/openapi.json": {"GET": guarded(description)}, "/login": {"POST": login}}
    with small_device({}, routes) as url:
        yield url


def authenticated(request: web.Request, user: str, password: str) -> bool:
    given = dict(re.findall(r'(\w+)="?([^",]+)', request.headers.get("Authorization", "")))
    if "response" not in given:
        return False

    def digest(text: str) -> str:
        return hashlib.md5(text.encode(), usedforsecurity=False).hexdigest()

    asked = digest(f"{request.method}:{given['uri']}")
    middle = [given["nonce"], given.get("nc", ""), given.get("cnonce", ""), given.get("qop", "")]
    return given["response"] == digest(":".join([digest(f"{user}:lab:{password}"), *middle, asked]))


class EchoingService(Device):
    """A SOAP service whose WSDL, faults and headers repeat what it was sent."""

    def __init__(self) -> None:
        super().__init__("scale", SCALE, "<none/>", {})

    def app(self, environ: dict[str, Any], start: Callable[..., Any]) -> list[bytes]:
        """Serve the WSDL, and a fault for each message (WSGI)."""
        fields = " ".join(str(value) for name, value in environ.items() if name.startswith("HTTP_"))
        body = environ["wsgi.input"].read(int(environ.get("CONTENT_LENGTH") or 0)).decode("latin-1")
        sent = f"{environ['PATH_INFO']} {fields} {body}"
        written = [html.escape(write(sent)) for name, write in ENCODINGS.items() if name != "utf_16"]
        comment = "".join(f"<!--{text.replace('--', '- -')}-->" for text in written)
        headers = [("X-Echo", ENCODINGS["percent"](sent)[:9000]), ("Content-Type", "text/xml; charset=utf-8")]
        if environ["REQUEST_METHOD"] == "GET":
            start("200 OK", headers)
            text = self.wsdl.replace("ADDRESS", f"http://{environ.get('HTTP_HOST', '')}")
            return [(text + comment).encode()]
        if len(body) % 2:
            start("500 Internal Server Error", headers)
            return [self.fault("Server", "".join(written))[1]]
        start("200 OK", headers)
        load = f"<load><grams>{written[0]}</grams><stable>true</stable></load>"
        return [self.envelope(f'<c:GetLoadResponse xmlns:c="urn:scale">{load}</c:GetLoadResponse>{comment}')]


def leaks(folder: Path, secrets: Iterable[str], *texts: str) -> list[str]:
    """Return where a secret is in the files of a folder, or in texts, in any form."""
    secrets = tuple(secrets)
    found = [
        f"{path.relative_to(folder)}: {said}" for path in sorted(folder.rglob("*")) if path.is_file()
        for said in _shown(path.read_bytes(), secrets)
    ]  # fmt: skip
    return found + [f"terminal: {said}" for text in texts for said in _shown(text.encode("utf-8", "replace"), secrets)]


@cache
def _forms(secret: str) -> set[str]:
    octets = {text.encode() for text in (secret, secret.lower(), secret.upper())}
    return {form.lower() for one in octets for form in (one.decode(), one.decode("latin-1"), one.hex())}


def _shown(octets: bytes, secrets: tuple[str, ...], depth: int = 0) -> Iterator[str]:
    if octets.startswith(b"\x1f\x8b"):
        octets = gzip.decompress(octets)
    readings = [octets.decode("latin-1")]
    for _ in range(4):
        readings.append(_undone(readings[-1]))
    readings += [re.sub(r"=?(?:\\[rn]|[\r\n])[ \t]*", "", text) for text in readings[:2]]
    readings += [quopri.decodestring(text.encode("latin-1", "replace")).decode("latin-1") for text in readings[-2:]]
    readings.append(_undone(readings[-2]))
    for text in dict.fromkeys(readings):
        plain = text.replace("\0", "").lower()
        for secret in secrets:
            if at := next((at for form in _forms(secret) if (at := plain.find(form)) >= 0), 0):
                yield f"{secret!r} in {plain[max(0, at - 60) : at + 80]!r}"
    if depth < 2:
        for packed in {found[0] for text in readings for found in _BASE64.finditer(text.encode("latin-1", "replace"))}:
            for shift in range(4):
                yield from _unpacked(packed.rstrip(b"=")[shift:], secrets, depth)


@cache  # several files have the same text
def _unpacked(packed: bytes, secrets: tuple[str, ...], depth: int) -> list[str]:
    """Return what base64 shows, also where it is compressed."""
    packed = packed[: len(packed) - (len(packed) % 4 == 1)].replace(b"-", b"+").replace(b"_", b"/")
    try:
        octets = base64.b64decode(packed + b"==")
    except binascii.Error:
        return []
    for wbits in (15, 31):
        try:
            octets = zlib.decompressobj(wbits).decompress(octets)
        except zlib.error:
            continue
        return list(_shown(octets, secrets, depth + 1))
    plain = octets.decode("latin-1").replace("\0", "").lower()
    if 2 * len(octets.translate(None, _READABLE)) < len(octets) and _ESCAPED.search(plain):
        plain += unquote(plain) + _undone(plain)
    found = (secret for secret in secrets if any(form in plain for form in _forms(secret)))
    return [f"base64 of {secret!r} in {plain[:200]!r}" for secret in found]


def _undone(text: str) -> str:
    text = html.unescape(unquote(text, "latin-1"))
    text = re.sub(r"\\+u([0-9a-fA-F]{4})", lambda found: chr(int(found[1], 16)), text)
    text = re.sub(r"\\+x([0-9a-fA-F]{2})", lambda found: chr(int(found[1], 16)), text)
    return re.sub(r"\\+(?=[\"'/\\])", "", text)
