"""Devices that are hostile in what they say: whatever that is, a run ends with a documented exit code and clean output.

A row of `TEXTS` is a text that a device puts wherever it may name something. A row of `DEVICES` is a group of resources
that are judged in one run. Bytes and endless answers are in test_answers.py.
"""

import gzip
import json
import re
import shutil
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import moving_cart
import pytest
from aiohttp import web
from lxml import etree
from processes import ended
from small_device import REFUSED, answers, certified, described, error, small_device

EXIT_CODES = {0, 1, 2, 3, 4}  # docs/cli.md
SECONDS = 120.0  # of one run on a busy machine
LEAK = "http://127.0.0.1:9/leak"
TEXTS = {
    "terminal": "\x1b]0;owned\x07\x1b[2J\x1b[31mred\x9b31m",
    "direction": "\u202egnp.exe\u2066\u2069\u200f\u061c",
    "workflow command": "\n::error file=a,line=1::owned\r\n::set-output name=a::b\n##vso[task.complete result=Failed;]",
    "line separators": "a\u2028b\u2029c\x85d\x0be\x0cf",
    "script": f"<script>document.title='own'+'ed'</script><img src={LEAK} onerror=\"document.title='own'+'ed'\">",
    "attribute": "\" onmouseover=\"document.title='own'+'ed'\" style=\"background:url(" + LEAK + ')" x="',
    "Markdown": f"[a](javascript:alert(1)) ![a]({LEAK}) | a | b |\n\n# owned\n\n```\n</details>",
    "end of CDATA": "]]> --> <!-- </testsuite> &unknown; <?php ?>",
    "template": "{{7*7}} ${jndi:ldap://127.0.0.1:9/a} $(touch owned) `touch owned` %s%n {0}",
    "long": "x" * 5000,
    "no character": "a\ufffe\uffff\x00b",
}
ESCAPED = "/var/tmp/roaas-escaped"  # noqa: S108 - the device names this file; nobody may write it
NAMES = [
    *("../../escaped", ESCAPED, "CON", "nul.txt", "x" * 300, "-rf", "a/../../../b", "..", "a\\b", "%2e%2e%2f"),
    *("\u202etxt", "a b\tc", "*", "~", "$HOME"),
]
TEXT_SCHEMA = {"type": "object", "required": ["text"], "properties": {"text": {"type": "string"}}}
ANSWERS = {"200": answers(TEXT_SCHEMA), "4XX": REFUSED}


def operation(**members: Any) -> dict[str, Any]:
    return {"get": {"responses": ANSWERS, **members}}


def wrong(text: str = "") -> Any:
    """Return a handler that breaks its schema and says the text wherever a response can."""

    async def handle(_: web.Request) -> web.Response:
        phrase = re.sub(r"[^ -~\u00a0-\u00ff]", "?", text)[:200]
        headers = dict.fromkeys(("Server", "X-Powered-By", "ETag", "Link", "Warning"), phrase)
        body = json.dumps({"text": 1, text[:300]: text, "error": f'File "/srv/robot.py", line 1: {text}'})
        kind = {"content_type": "application/json", "headers": headers, "reason": phrase}
        return web.Response(status=500, text=body, **kind)

    return handle


def speaking() -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the description and the handlers of a device that says each of the texts wherever it can."""
    paths, routes = {}, {}
    for number, text in enumerate(TEXTS.values()):
        parameter = {"name": text, "in": "query", "description": text, "schema": {"type": "string", "example": text}}
        paths[f"/{number}"] = operation(
            operationId=f"{number}{text}", summary=text, description=text, tags=[text], parameters=[parameter]
        )
        routes[f"/{number}"] = {"GET": wrong(text)}
    for number, name in enumerate(NAMES):
        paths[f"/name/{number}"] = operation(operationId=name)
        routes[f"/name/{number}"] = {"GET": wrong(name)}
    everything = "".join(TEXTS.values())
    info = {"title": everything, "version": everything, "description": everything, "contact": {"name": everything}}
    tags = [{"name": text, "description": text} for text in TEXTS.values()]
    return described(paths, info=info, tags=tags), routes


def odd(make: Any) -> dict[str, Any]:
    """Return the handlers of a resource whose response `make` returns."""

    async def handle(request: web.Request) -> web.StreamResponse:
        return make(request)

    return {"GET": handle}


def fine(**headers: str) -> web.Response:
    return web.json_response({"text": "a"}, headers={name.replace("_", "-"): value for name, value in headers.items()})


def moved(to: str, status: int = 302) -> web.Response:
    return web.Response(status=status, headers={"Location": to, "Link": f'<{to}>; rel="next"'})


_TURNS = {"n": 0}


def in_turns(*made: Any) -> Any:
    def make(request: web.Request) -> web.StreamResponse:
        _TURNS["n"] += 1
        return made[_TURNS["n"] % len(made)](request)

    return make


LATER = ("1000000000", "-5", "Fri, 31 Dec 9999 23:59:59 GMT", "nan", "1e9", "9" * 400, "", "\u0665")
DEVICES = {
    "come again later": {
        f"/{status}/{number}": odd(lambda _, s=status, a=again: error(s, "later", Retry_After=a, **{"Retry-After": a}))
        for status in (429, 503)
        for number, again in enumerate(LATER)
    },
    "headers": {
        "/etag": odd(lambda _: fine(ETag='"' + "e" * 1_000_000 + '"')),
        "/cookies": odd(lambda _: fine(Set_Cookie="session=fixed; Path=/; Max-Age=99999999999999999999; Domain=.com")),
        "/vary": odd(lambda _: fine(Vary=", ".join(f"x{n}" for n in range(3000)))),
        "/past": odd(
            lambda _: fine(Date="Thu, 01 Jan 1970 00:00:00 GMT", Last_Modified="Fri, 31 Dec 9999 23:59:59 GMT")
        ),
        "/future": odd(lambda _: fine(Date="Fri, 31 Dec 9999 23:59:59 GMT", Age="9" * 300, Expires="-1")),
        "/no-date": odd(lambda _: fine(Date="32 Foo 20xx", Age="-1", Content_Language="\u00e9" * 100)),
        "/type": odd(lambda _: fine(Content_Type="application/json; charset=" + "x" * 5000 + '; a="b')),
        "/allow": odd(lambda _: fine(Allow=", ".join(["GET"] * 5000))),
        "/timing": odd(lambda _: fine(Server_Timing="app;dur=NaN, app;dur=-1, app;dur=1e999, " + "x;dur=1," * 500)),
    },
    "loops": {
        "/self": odd(lambda _: moved("/self")),
        "/308": odd(lambda _: moved("/308", 308)),
        "/a": odd(lambda _: moved("/b")),
        "/b": odd(lambda _: moved("/a")),
        "/grows": odd(lambda r: moved(f"/grows?{r.query_string}x")),
        "/300": odd(lambda _: moved("", 300)),
        "/nowhere": odd(lambda _: moved("http://[::1", 302)),
        "/scheme": odd(lambda _: moved("file:///etc/passwd", 302)),
        "/999": odd(lambda _: web.Response(status=999, text="{}")),
        "/100": odd(lambda _: web.Response(status=299, text="{}")),
    },
    "moods": {
        "/401": odd(
            in_turns(lambda _: fine(), lambda _: error(401, "no", **{"WWW-Authenticate": "Bearer " + "x" * 5000}))
        ),
        "/login": odd(lambda _: error(401, "no", **{"WWW-Authenticate": 'Digest realm="a", nonce="b", stale=true'})),
        "/negotiate": odd(lambda _: error(401, "no", **{"WWW-Authenticate": "Negotiate, NTLM, =, ,,"})),
        "/407": odd(lambda _: error(407, "no", **{"Proxy-Authenticate": "Basic"})),
        "/any": odd(in_turns(lambda _: fine(), lambda _: error(500, "a"), lambda _: web.Response(status=204))),
        "/echo": odd(lambda r: web.json_response({"text": str(dict(r.headers)) + r.query_string})),
        "/deep": odd(lambda _: web.Response(text="[" * 100_000, content_type="application/json")),
        "/numbers": odd(lambda _: web.Response(text='{"text": 1e99999, "n": NaN}', content_type="application/json")),
        "/twice": odd(lambda _: web.Response(text='{"text": 1, "text": "a"}', content_type="application/json")),
        "/surrogate": odd(lambda _: web.Response(text='{"text": "\\ud800"}', content_type="application/json")),
    },
}


@contextmanager
def watched(folder: Path) -> Iterator[Path]:
    """Yield a working directory in which nothing but the output may appear."""
    place = folder / "place"
    place.mkdir()
    yield place
    assert [one.name for one in place.iterdir() if one.name != "out"] == []
    assert [one.name for one in folder.iterdir()] == ["place"]
    assert not Path(ESCAPED).exists()


def files_of(out: Path) -> list[Path]:
    return [one for one in out.rglob("*") if one.is_file()]


def is_inert(text: str) -> bool:
    """Return whether a terminal, and a CI system that reads its lines, takes a text for nothing but text."""
    odd_ones = re.findall(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u2028-\u202e\u2066-\u2069\u200e\u200f\u061c]", text)
    return not odd_ones and not re.search(r"(?m)^\s*(::|##vso|##\[)", text)


@pytest.fixture(scope="module")
def spoken(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Any, Path]]:
    """The certification of the device that says each text, and its folder."""
    with watched(tmp_path_factory.mktemp("spoken")) as place, small_device(*speaking()) as url:
        command = (sys.executable, "-m", "roaas", "certify", f"{url}/openapi.json", "--effort", "quick")
        done = ended(*command, "--seed", 1, "--out", "out", cwd=place, timeout=SECONDS)
        yield done, place / "out"


def test_no_text_of_a_device_reaches_terminal_or_ci_as_a_command(spoken):
    done, out = spoken
    assert done.returncode in EXIT_CODES
    assert "Traceback (most recent call last):\n" not in done.stderr
    assert is_inert(done.stdout + done.stderr), ascii(done.stdout + done.stderr)
    assert all(re.fullmatch(r"[\w.-]+", one.name) for one in files_of(out))


def test_each_format_holds_the_texts_of_a_device_as_text(spoken):
    _, out = spoken
    formats = ("junit", "sarif", "ctrf", "gitlab", "markdown", "annotations", "badge")
    for name in formats:
        done = ended(sys.executable, "-m", "roaas", "report", out, "--format", name)
        assert done.returncode == 0, done.stderr
        assert not re.search(r"(?m)^\s*(::set-output|::error file=a|##vso)", done.stdout)
        assert is_inert(done.stderr)
    for path in files_of(out):
        content = path.read_bytes()
        text = (gzip.decompress(content) if path.suffix == ".gz" else content).decode()
        if path.suffix in {".json", ".sarif"}:
            json.loads(text)
        elif path.suffix == ".xml":
            etree.fromstring(text.encode())
        elif path.suffix == ".md":
            outside = re.sub(r"`+[^`]*`+", "", text)
            assert not re.search(r"(?<!\\)<(script|img)|(?<!\\)\]\((javascript|http://127\.0\.0\.1:9)", outside)
            assert not re.search("(?m)^# owned", outside)
            assert is_inert(text), path


def test_no_script_of_a_device_runs_on_a_page(spoken, tmp_path):
    _, out = spoken
    browser = shutil.which("chromium") or shutil.which("google-chrome")
    for page in out.glob("*.html"):
        text = page.read_text(encoding="utf-8")
        assert "<script>document" not in text
        assert not re.search(r"<img[^>]*127\.0\.0\.1:9", text)
        if browser:
            options = ("--headless", "--no-sandbox", "--disable-gpu", f"--user-data-dir={tmp_path}", "--dump-dom")
            shown = ended(browser, *options, f"file://{page}", timeout=SECONDS).stdout
            title = re.search("<title>(.*?)</title>", shown, re.DOTALL)
            assert title, shown[:500]
            assert title[1] != "owned"


@pytest.mark.parametrize("name", DEVICES)
def test_what_a_device_answers_ends_in_a_verdict(name, tmp_path):
    routes = DEVICES[name]
    # A run waits for such a device for 90 s in all.
    more = ("--minutes", 0.4) if name == "come again later" else ()
    began = time.monotonic()
    with watched(tmp_path) as place, small_device(described({path: operation() for path in routes}), routes) as url:
        done = certified(f"{url}/openapi.json", place / "out", *more)
    assert done.exit_code in {0, 1, 4}, done.text
    assert done.result["requirements"]
    assert time.monotonic() - began < SECONDS
    assert is_inert(done.text)


def some(number: int, **members: Any) -> dict[str, Any]:
    """Return a small right description; its text differs by number."""
    paths = {"/a": operation(description=f"reading {number}"), f"/{number}": operation()}
    return described(paths, **members)


def said(make: Any) -> dict[str, Any]:
    """Return the handlers of a description that `make` returns."""
    return {"/openapi.json": odd(make), "/a": odd(lambda _: fine())}


async def anything(_: web.Request) -> web.Response:
    return fine()


def by_accept(request: web.Request) -> web.Response:
    if "yaml" in request.headers.get("Accept", ""):
        return web.Response(
            text="openapi: 3.0.3\ninfo: {title: b, version: '1'}\npaths: {}\n", content_type="text/yaml"
        )
    return web.json_response(some(1))


METHODS = ("GET", "HEAD", "PUT", "POST", "DELETE", "PATCH", "OPTIONS", "TRACE")
TAGS = [{"name": f"tag {number}"} for number in range(10_000)]
CLIMBING = ("/a", "/../../x", "/%00", "/a/%2e%2e/b", "//a", "/a?b#c", "/{", "/\u202e")
DESCRIPTIONS = {
    "changes with each reading": said(in_turns(*(lambda _, n=n: web.json_response(some(n)) for n in range(7)))),
    "differs by Accept": said(by_accept),
    "ten thousand tags": said(lambda _: web.json_response(some(1, tags=TAGS))),
    "ten thousand tags of an operation": said(
        lambda _: web.json_response(described({"/a": operation(tags=[one["name"] for one in TAGS])}))
    ),
    "200 to everything": {
        "/openapi.json": odd(lambda _: web.json_response(some(1))),
        "/{all:.*}": dict.fromkeys(METHODS, anything),
    },
    "paths that climb": said(lambda _: web.json_response(described({path: operation() for path in CLIMBING}))),
    "gone after the first reading": said(in_turns(lambda _: web.json_response(some(1)), lambda _: error(500, "gone"))),
    "asks for a login": said(lambda _: error(401, "no", **{"WWW-Authenticate": "Bearer"})),
}


@pytest.mark.parametrize("name", DESCRIPTIONS)
def test_whatever_a_description_is_a_run_ends_as_documented(name, tmp_path):
    _TURNS["n"] = -1
    with watched(tmp_path) as place, small_device({}, DESCRIPTIONS[name]) as url:
        done = certified(f"{url}/openapi.json", place / "out")
    assert done.exit_code in EXIT_CODES, done.text
    assert is_inert(done.text), ascii(done.text)


LIES = ("NaN", "Infinity", "-1e999", '"0.1"', "null", "[]", "true", "1e308", '"\\u001b[31m"')


def lying() -> dict[str, Any]:
    """Return the handlers of a cart that lies about where it is."""

    async def accept(_: web.Request) -> web.Response:
        return web.json_response({})

    states = [
        lambda _, lie=lie: web.Response(text=f'{{"x": {lie}}}', content_type="application/json") for lie in ("0", *LIES)
    ]
    return {"/state": odd(in_turns(*states)), "/velocity": {"PUT": accept}, "/stop": {"POST": accept}}


def test_a_device_that_lies_about_its_motion_does_not_conform(tmp_path):
    with watched(tmp_path) as place, small_device(described(moving_cart.PATHS), lying()) as url:
        (place / "out").mkdir()
        statement = place / "out" / "cart.toml"
        statement.write_text(moving_cart.MAP, encoding="utf-8")
        done = certified(statement, place / "out" / "run", "--openapi", f"{url}/openapi.json", "--allow-motion")
    assert done.exit_code in {1, 4}, done.text
    assert is_inert(done.text), ascii(done.text)


@pytest.mark.parametrize("operation_name", ["GET /0", "GET /etag", "GET /429/0"])
def test_a_load_test_of_a_hostile_device_ends_as_documented(operation_name, tmp_path):
    description, routes = speaking()
    for group in DEVICES.values():
        routes |= group
        description["paths"] |= {path: operation() for path in group}
    plan = ("--operation", operation_name, "--duration", 1, "--warmup", 0.1, "--rate", 50, "--out", "out")
    with watched(tmp_path) as place, small_device(description, routes) as url:
        done = ended(sys.executable, "-m", "roaas", "load", f"{url}/openapi.json", *plan, cwd=place, timeout=SECONDS)
    assert done.returncode in EXIT_CODES, done.stderr
    assert "Traceback" not in done.stdout + done.stderr
    assert is_inert(done.stdout + done.stderr), ascii(done.stdout + done.stderr)


def service(namespace: str, url: str) -> str:
    """Return a WSDL with one operation that takes and returns a text."""
    element = '<xs:element name="{}"><xs:complexType><xs:sequence><xs:element name="t" type="xs:string"/></xs:sequence>'
    elements = "".join(element.format(name) + "</xs:complexType></xs:element>" for name in ("Read", "ReadResponse"))
    return (
        f'<definitions name="s" targetNamespace="{namespace}" xmlns="http://schemas.xmlsoap.org/wsdl/" '
        f'xmlns:s="http://schemas.xmlsoap.org/wsdl/soap/" xmlns:t="{namespace}"><types>'
        f'<xs:schema xmlns:xs="http://www.w3.org/2001/XMLSchema" targetNamespace="{namespace}">{elements}</xs:schema>'
        '</types><message name="i"><part name="p" element="t:Read"/></message>'
        '<message name="o"><part name="p" element="t:ReadResponse"/></message><portType name="P">'
        '<operation name="Read"><input message="t:i"/><output message="t:o"/></operation></portType>'
        '<binding name="B" type="t:P">'
        '<s:binding style="document" transport="http://schemas.xmlsoap.org/soap/http"/><operation name="Read">'
        '<s:operation soapAction=""/><input><s:body use="literal"/></input><output><s:body use="literal"/></output>'
        f'</operation></binding><service name="S"><port name="p" binding="t:B"><s:address location="{url}"/></port>'
        "</service></definitions>"
    )


_ENVELOPE = '<e:Envelope xmlns:e="http://schemas.xmlsoap.org/soap/envelope/"><e:Body>{}</e:Body></e:Envelope>'
_FAULT = _ENVELOPE.format("<e:Fault><faultcode>e:Client</faultcode><faultstring>{}</faultstring>{}</e:Fault>")
_INSTANCE = "http://www.w3.org/2001/XMLSchema-instance"
SOAP_ANSWERS = {
    "stylesheet": f'<?xml-stylesheet href="{LEAK}" type="text/xsl"?>' + _FAULT.format("a", ""),
    "DOCTYPE": f'<!DOCTYPE a [<!ENTITY b SYSTEM "{LEAK}"><!ENTITY c "&b;&b;">]>' + _FAULT.format("&c;", ""),
    "inclusion": _FAULT.format("a", f'<i:include xmlns:i="http://www.w3.org/2001/XInclude" href="{LEAK}"/>'),
    "schema elsewhere": _FAULT.format("a", f'<d x:schemaLocation="a {LEAK}" xmlns:x="{_INSTANCE}"/>'),
    "text": _FAULT.format("&#x202e;&#x9b;31m&#10;::error::owned &lt;script&gt;", "<detail><a>\u2028</a></detail>"),
    "no fault": "<html><script>alert(1)</script></html>",
    "deep": _ENVELOPE.format("<a>" * 5000 + "</a>" * 5000),
    "attributes": _ENVELOPE.format("<a " + " ".join(f'a{number}=""' for number in range(20_000)) + "/>"),
    "relates": _FAULT.format("a" * 1_000_000, ""),
}


@pytest.mark.parametrize("namespace", ["urn:s", "urn:" + "n" * 1_000_000], ids=["faults", "namespace of a megabyte"])
def test_a_hostile_soap_service_ends_as_documented(namespace, tmp_path):
    _TURNS["n"] = -1
    kind = {"status": 500, "content_type": "text/xml"}
    made = [lambda _, text=text: web.Response(text=text, **kind) for text in SOAP_ANSWERS.values()]
    answer = in_turns(*made)

    async def post(request: web.Request) -> web.StreamResponse:
        return answer(request)

    wsdl = odd(lambda r: web.Response(text=service(namespace, f"http://{r.host}/svc"), content_type="text/xml"))
    with watched(tmp_path) as place, small_device({}, {"/svc": {**wsdl, "POST": post}}) as url:
        done = certified(f"{url}/svc?wsdl", place / "out", "--call", "*")
    assert done.exit_code in EXIT_CODES, done.text
    assert is_inert(done.text), ascii(done.text)
