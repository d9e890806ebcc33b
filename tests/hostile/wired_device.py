"""A tube rack with 23 operations on the standard library's server: right in several styles, or with faults.

What a style changes is right; what a fault changes breaks HTTP or the description, mostly under a condition.
"""

import gzip
import hashlib
import json
import re
import sys
import threading
from collections import Counter
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any
from urllib.parse import parse_qs, unquote, urlsplit

from small_device import answers, body_of, described, object_of

_ERROR = {
    "type": "object",
    "required": ["error"],
    "additionalProperties": False,
    "properties": {"error": {"type": "string"}},
}
_NEW = {
    "type": "object",
    "required": ["label", "level"],
    "additionalProperties": False,
    "properties": {
        "label": {"type": "string", "minLength": 1, "maxLength": 40},
        "level": {"type": "integer", "minimum": 0, "maximum": 90},
        "sealed": {"type": "boolean"},
    },
}
_TUBE = {
    **_NEW,
    "required": ["id", "label", "level", "sealed"],
    "properties": {"id": {"type": "integer"}, **_NEW["properties"]},
}
_LEVEL = {
    "type": "object",
    "required": ["level"],
    "additionalProperties": False,
    "properties": {"level": {"type": "number"}},
}
_CONFIG = {
    "type": "object",
    "required": ["name", "speed"],
    "additionalProperties": False,
    "properties": {
        "name": {"type": "string", "maxLength": 60},
        "speed": {"type": "integer", "minimum": 1, "maximum": 1000},
    },
}
_ANY = {"type": "object", "additionalProperties": False, "properties": {"up": {"type": "integer"}}}
_IF_MATCH = {"in": "header", "name": "If-Match", "schema": {"type": "string"}}
CALLS = tuple(
    f"--call={one}"
    for one in ("POST /tubes", "PUT /tubes/*", "PATCH /tubes/*", "DELETE /tubes/*", "POST /tubes/*", "PUT /config",
                "PATCH /config", "POST /jobs", "DELETE /jobs/*")
)  # fmt: skip


def _op(ok: str, schema: Any = None, *, body: Any = None, headers: Any = None, **more: Any) -> dict[str, Any]:
    success = answers(schema) if schema else {"description": "done"}
    if headers:
        success["headers"] = {name: {"required": True, "schema": {"type": "string"}} for name in headers}
    errors = {code: answers(_ERROR) for code in ("400", "404", "405", "409", "411", "412", "413", "415", "422")}
    if body:
        more["requestBody"] = body_of(body)
    return {"responses": {ok: success, **errors}, **more}


def _id(name: str, kind: str = "integer") -> dict[str, Any]:
    return {"in": "path", "name": name, "required": True, "schema": {"type": kind}}


def _query(name: str, schema: Any) -> dict[str, Any]:
    return {"in": "query", "name": name, "schema": schema}


def _optional(schema: Any) -> dict[str, Any]:
    return {name: one for name, one in schema.items() if name != "required"}


def document() -> dict[str, Any]:
    """Return the description."""
    limit = _query("limit", {"type": "integer", "minimum": 1, "maximum": 50})
    tubes = {"type": "array", "items": _TUBE}
    state = _query("sealed", {"type": "boolean"})
    job = object_of("id", "label", id={"type": "integer"}, label={"type": "string"})  # fmt: skip
    new_job = {
        **job,
        "additionalProperties": False,
        "required": ["label"],
        "properties": {"label": {"type": "string", "minLength": 1}},
    }
    text = {**_ERROR, "required": ["text"], "properties": {"text": {"type": "string", "maxLength": 40}}}
    change = {**_optional(_NEW), "minProperties": 1}
    return described(
        {
            "/health": {"get": _op("200", _ANY)},
            "/info": {"get": _op("200", object_of("model", model={"type": "string"}))},
            "/status": {"get": _op("200", _LEVEL, parameters=[_query("unit", {"enum": ["C", "F"], "type": "string"})])},
            "/config": {
                "get": _op("200", _CONFIG, headers=["ETag"]),
                "put": _op("200", _CONFIG, body=_CONFIG, headers=["ETag"], parameters=[_IF_MATCH]),
                "patch": _op("200", _CONFIG, body=_optional(_CONFIG), headers=["ETag"],
                             parameters=[_IF_MATCH]),
            },
            "/tubes": {
                "get": _op("200", tubes, parameters=[limit, state]),
                "post": _op("201", _TUBE, body=_NEW, headers=["Location"]),
            },
            "/tubes/{tubeId}": {
                "parameters": [_id("tubeId")],
                "get": _op("200", _TUBE, headers=["ETag"]),
                "put": _op("200", _TUBE, body=_NEW, headers=["ETag"], parameters=[_IF_MATCH]),
                "patch": _op("200", _TUBE, body=change, headers=["ETag"], parameters=[_IF_MATCH]),
                "delete": _op("204", parameters=[_IF_MATCH]),
            },
            "/tubes/{tubeId}/seal": {"parameters": [_id("tubeId")], "post": _op("200", _TUBE)},
            "/tubes/{tubeId}/label": {
                "parameters": [_id("tubeId")],
                "get": _op("200", text),
                "put": _op("200", text, body=text),
            },
            "/log": {"get": _op("200", {"type": "array", "items": text}, parameters=[limit])},
            "/sensors": {"get": _op("200", {"type": "array", "items": job})},
            "/sensors/{sensorId}": {"parameters": [_id("sensorId")], "get": _op("200", job)},
            "/jobs": {
                "get": _op("200", {"type": "array", "items": job}),
                "post": _op("201", job, body=new_job, headers=["Location"]),
            },
            "/jobs/{jobId}": {"parameters": [_id("jobId")], "get": _op("200", job), "delete": _op("204")},
        }
    )  # fmt: skip


class Refused(Exception):  # noqa: N818 - it is a response
    """Raised to refuse a request."""

    def __init__(self, status: int, text: str, **headers: str) -> None:
        super().__init__(text)
        self.status, self.headers = status, headers


class Rack:
    """What the device keeps and does.

    Args:
        styles: names of right styles.
        faults: names of faults; none for a right device.
    """

    def __init__(self, styles: Collection[str], faults: Collection[str]) -> None:
        self.styles, self.faults = styles, faults
        self.tubes: dict[int, dict[str, Any]] = {
            number: {"id": number, "label": f"tube {number}", "level": number, "sealed": False} for number in (1, 2)
        }
        self.jobs: dict[int, dict[str, Any]] = {1: {"id": 1, "label": "first"}}
        self.config: dict[str, Any] = {"name": "rack", "speed": 20}
        self.count, self.refused, self.deleted, self.created, self.came = 100, False, 0, 0, 0
        self.reads: Counter[str] = Counter()
        self.lock = threading.RLock()

    def answer(self, method: str, target: str, fields: dict[str, str], body: bytes) -> Any:
        """Return status, headers and body."""
        with self.lock:
            try:
                status, headers, value = self._routed(method, target, fields, body)
            except Refused as no:
                status, headers, value = no.status, dict(no.headers), {"error": str(no)}
            return self._written(method, target, fields, status, headers, value)

    def _written(  # noqa: C901, PLR0912 - a table of faults
        self, method: str, target: str, fields: dict[str, str], status: int, headers: dict[str, str], value: Any
    ) -> tuple[int, dict[str, str], bytes]:
        path, faults = urlsplit(target).path, self.faults
        refused_before, self.refused = self.refused, 400 <= status < 500
        if method in {"GET", "HEAD"} and 200 <= status < 300:
            self.reads[path] += 1
            if "null after a refusal" in faults and refused_before and path == "/info":
                value = {"model": None}
            if "more after a refusal" in faults and refused_before and path == "/status":
                value = {**value, "debug": 1}
            if "16th wrong" in faults and path == "/log" and self.reads[path] % 16 == 0:
                value = {"wrong": True}
            if "20th 500" in faults and path == "/health" and self.reads[path] % 20 == 0:
                status, value = 500, {"error": "?"}
        octets = json.dumps(value, ensure_ascii=False).encode() if value is not None else b""
        if value is not None:
            headers["Content-Type"] = "application/json"
        if "409 schema" in faults and status == 409:
            octets = b'{"message": "twice"}'
        if "412 html" in faults and status == 412:
            headers["Content-Type"], octets = "text/html", b"<p>412</p>"
        if "405 schema" in faults and status == 405:
            octets = b'{"error": null}'
        if "415 schema" in faults and status == 415:
            octets = b'{"detail": "type"}'
        if "HEAD of items 404" in faults and method == "HEAD" and re.fullmatch(r"/tubes/\d+", path):
            status = 404
        if "HEAD with query 400" in faults and method == "HEAD" and "limit=" in target:
            status = 400
        if "HEAD with another ETag" in faults and method == "HEAD" and path.startswith("/tubes/"):
            headers["ETag"] = '"head"'
        if "HEAD length" in faults and method == "HEAD" and ("limit=" in target or "sealed=" in target):
            octets += b"    "
        if "weak ETags" in self.styles:
            headers.update({"ETag": f"W/{headers['ETag']}"} if "ETag" in headers else {})
        if "gzip" in self.styles and re.search(r"(gzip|\*)(?!;q=0)", fields.get("accept-encoding", "*")) and octets:
            octets = gzip.compress(octets, mtime=0)
            headers |= {"Content-Encoding": "gzip"}
            headers.update({"ETag": headers["ETag"][:-1] + '-gzip"'} if "ETag" in headers else {})
        headers["Vary"] = "Accept-Encoding"
        return status, headers, octets

    def _routed(self, method: str, target: str, fields: dict[str, str], body: bytes) -> Any:  # noqa: C901, PLR0911, PLR0912, PLR0915 - a table
        url = urlsplit(target)
        try:
            path, query = (
                unquote(url.path, errors="strict"),
                parse_qs(url.query, keep_blank_values=True, errors="strict"),
            )
        except UnicodeDecodeError as error:
            raise Refused(400, "no UTF-8") from error
        act, faults = "GET" if method == "HEAD" else method, self.faults
        self.fields, self.came = fields, self.came + 1
        if "429 often" in self.styles and self.came % 6 == 0 and target != "/openapi.json":
            raise Refused(429, "slow down", **{"Retry-After": "0"})

        def only(*methods: str) -> None:
            if act in methods and not (method == "HEAD" and "no HEAD" in self.styles):
                return
            allow = ["OPTIONS", *methods, *(["HEAD"] if "GET" in methods and "no HEAD" not in self.styles else [])]
            if "Allow of sub-resources" in faults and path.endswith("/label"):
                allow.remove("PUT")
            if "404 for actions" in faults and path.endswith("/seal") and act != "OPTIONS":
                raise Refused(404, "not found")
            if "404 for methods of items" in faults and re.fullmatch(r"/tubes/\d+", path) and act != "OPTIONS":
                raise Refused(404, "not found")
            if "404 for methods of sub-resources" in faults and path.endswith("/label") and act != "OPTIONS":
                raise Refused(404, "not found")
            if "OPTIONS of items 404" in faults and re.fullmatch(r"/tubes/\d+", path) and act == "OPTIONS":
                raise Refused(404, "not found")
            if act == "OPTIONS":
                raise Refused(204, "", Allow=", ".join(allow))
            raise Refused(404 if "404 for methods" in self.styles else 405, "no such method", Allow=", ".join(allow))

        if path == "/openapi.json":
            only("GET")
            text = json.dumps(document())
            if "no If-Match" in self.styles:
                text = text.replace('"412"', '"428"').replace("If-Match", "X-Note")
            return 200, {}, json.loads(text)
        if path == "/health":
            only("GET")
            return 200, {}, {"up": 1}
        if path == "/info":
            only("GET")
            return 200, {}, {"model": "R2"}
        if path == "/status":
            only("GET")
            if query.get("unit", ["C"])[0] not in {"C", "F"}:
                raise Refused(422, "unit")
            return 200, {}, {"level": 3.5}
        if path == "/config":
            only("GET", "PUT", "PATCH")
            return self._config(act, body)
        if path == "/tubes":
            only("GET", "POST")
            if act == "POST":
                return self._new_tube(body)
            wanted = query.get("sealed", [None])[0]
            if wanted not in {None, "true", "false"}:
                raise Refused(422, "sealed")
            shown = [one for one in self.tubes.values() if wanted is None or one["sealed"] == (wanted == "true")]
            return 200, {}, self._limited(shown, query)
        if path in {"/log", "/sensors", "/jobs"}:
            only("GET", *(["POST"] if path == "/jobs" else []))
            if act == "POST":
                return self._new_job(body)
            if path == "/jobs":
                return 200, {}, list(self.jobs.values())
            one = {"text": "begun"} if path == "/log" else {"id": 1, "label": "heat"}
            return 200, {}, self._limited([one], query if path == "/log" else {})
        if found := re.fullmatch(r"/(sensors|jobs)/([^/]+)", path):
            return self._small(found[1], found[2], act, only)
        if found := re.fullmatch(r"/tubes/([^/]+)(/seal|/label)?", path):
            return self._tube(found[1], found[2] or "", act, body, only)
        raise Refused(404, "not found")

    def _small(self, kind: str, text: str, act: str, only: Any) -> Any:
        known = self.jobs if kind == "jobs" else {1: {"id": 1, "label": "heat"}}
        number = int(text) if text.isascii() and text.isdigit() and len(text) < 18 else -1
        if number not in known and "404 first" in self.styles:
            raise Refused(404, "no such thing")
        only("GET", *(["DELETE"] if kind == "jobs" else []))
        if number not in known:
            raise Refused(404, "no such thing")
        if act == "DELETE":
            del self.jobs[number]
            self.deleted += 1
            return 204, {}, None
        return 200, {}, known[number]

    @staticmethod
    def _limited(items: list[Any], query: dict[str, list[str]]) -> list[Any]:
        text = query.get("limit", ["50"])[0]
        if not (text.isascii() and text.isdigit() and len(text) < 9 and 1 <= int(text) <= 50):
            raise Refused(422, "limit")
        return items[: int(text)]

    def _given(self, body: bytes, schema: Any, required: Collection[str]) -> dict[str, Any]:
        if self.fields.get("content-type", "").partition(";")[0].strip().lower() != "application/json":
            raise Refused(415, "JSON, please")
        try:
            value = json.loads(body.decode(), parse_constant=lambda _: 1 / 0)
        except (ValueError, RecursionError, ZeroDivisionError) as error:
            raise Refused(400, "no JSON") from error
        parts = schema["properties"]
        if not isinstance(value, dict) or not set(required) <= set(value) <= set(parts):
            raise Refused(422, "members")
        for name, one in value.items():
            kind, part = parts[name]["type"], parts[name]
            is_number = isinstance(one, int | float) and not isinstance(one, bool)
            fits = {"string": isinstance(one, str), "boolean": isinstance(one, bool)}.get(
                kind, is_number and one == one // 1
            )
            if fits and kind == "string":
                fits = part.get("minLength", 0) <= len(one) <= part.get("maxLength", 10**9)
                fits = fits and not any(0xD800 <= ord(sign) <= 0xDFFF for sign in one)
            if fits and kind == "integer":
                fits = part.get("minimum", -(10**9)) <= one <= part.get("maximum", 10**9)
                value[name] = int(one) if fits else one
            if not fits:
                raise Refused(422, name)
        return value

    def _tag(self, value: Any) -> str:
        if "ETag without the level" in self.faults and "level" in value:
            value = {**value, "level": 0}
        return '"' + hashlib.sha256(json.dumps(value).encode()).hexdigest()[:12] + '"'

    def _conditions(self, act: str, value: Any) -> dict[str, str]:
        tag, faults = self._tag(value), self.faults
        weak = f"W/{tag}"
        wanted = self.fields.get("if-match")
        heeds = f"{act} ignores If-Match" not in faults
        if act != "GET" and wanted is not None and heeds and "no If-Match" not in self.styles:
            named = [one.strip() for one in wanted.split(",")]
            right = "*" in named or tag in named or (weak in named and "weak If-Match" in self.styles)
            if "If-Match right refused" in faults or not right:
                raise Refused(412, "not the current one")
        none = self.fields.get("if-none-match")
        if act == "GET" and none is not None and "no conditions" not in self.styles:
            named = [one.strip().removeprefix("W/") for one in none.split(",")]
            if "If-None-Match list" in faults:
                named = named if len(named) == 1 else []
            if "304 for any" in faults and none != "*":
                named = [tag]
            if "304 for a weak only" in faults and none.startswith('"'):
                named = []
            if "*" in named or tag in named:
                raise Refused(304, "", ETag=tag)
            if "412 for GET" in faults and named:
                raise Refused(412, "not the current one")
        return {"ETag": tag}

    def _config(self, act: str, body: bytes) -> Any:
        headers = self._conditions(act, self.config)
        if act != "GET":
            change = self._given(body, _CONFIG, ["name", "speed"] if act == "PUT" else [])
            if "texts without combining marks" in self.faults and "name" in change:
                change["name"] = change["name"].replace("\u0301", "")
            self.config = {**self.config, **change}
            headers = {"ETag": self._tag(self.config)}
            if "old ETag after a write" in self.faults:
                headers = {"ETag": '"old"'}
        return 200, headers, self.config

    def _new_tube(self, body: bytes) -> Any:
        value = self._given(body, _NEW, ["label", "level"])
        self.count, self.created = self.count + 1, self.created + 1
        self.tubes[self.count] = {"id": self.count, "sealed": False, **value}
        headers = {"Location": f"/tubes/{self.count}"}
        if "no Location after a delete" in self.faults and self.deleted:
            headers = {}
        if "every 3rd Location is wrong" in self.faults and self.created % 3 == 0:
            headers = {"Location": f"/tubes/{self.count + 1000}"}
        return 201, headers, self.tubes[self.count]

    def _new_job(self, body: bytes) -> Any:
        schema = {"properties": {"label": {"type": "string", "minLength": 1}}}
        value = self._given(body, schema, ["label"])
        if "texts without emoji" in self.faults:
            value["label"] = "".join(one if ord(one) < 0x10000 else "?" for one in value["label"])
        self.count += 1
        self.jobs[self.count] = {"id": self.count, **value}
        return 201, {"Location": f"/jobs/{self.count}"}, self.jobs[self.count]

    def _tube(self, text: str, what: str, act: str, body: bytes, only: Any) -> Any:  # noqa: C901 - a table
        number = int(text) if text.isascii() and text.isdigit() and len(text) < 18 else -1
        if number not in self.tubes and "404 first" in self.styles:
            raise Refused(404, "no such tube")
        only(*{"": ("GET", "PUT", "PATCH", "DELETE"), "/seal": ("POST",), "/label": ("GET", "PUT")}[what])
        if number not in self.tubes:
            raise Refused(404, "no such tube")
        tube = self.tubes[number]
        if what == "/seal":
            if tube["sealed"]:
                raise Refused(409, "sealed already")
            tube["sealed"] = True
            return 200, {}, tube
        if what == "/label":
            if act == "PUT":
                self.tubes[number] = tube = {
                    **tube,
                    "label": self._given(body, {"properties": {"text": {**_NEW["properties"]["label"]}}}, ["text"])[
                        "text"
                    ],
                }
            return 200, {}, {"text": tube["label"]}
        headers = self._conditions(act, tube)
        if act == "DELETE":
            del self.tubes[number]
            self.deleted += 1
            return 204, {}, None
        if act in {"PUT", "PATCH"}:
            schema = {"properties": _NEW["properties"]}
            change = self._given(body, schema, ["label", "level"] if act == "PUT" else [])
            if act == "PATCH" and not change:
                raise Refused(422, "nothing")
            if "texts as Latin-1" in self.faults and "label" in change:
                change["label"] = change["label"].encode().decode("latin-1")
            self.tubes[number] = tube = {**tube, **({"sealed": False} if act == "PUT" else {}), **change}
            headers = {"ETag": self._tag(tube)}
            if "old ETag after a write" in self.faults:
                headers = {"ETag": '"old"'}
        return 200, headers, tube


class _Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    disable_nagle_algorithm = True
    rack: Rack

    def log_message(self, *_: object) -> None:
        pass

    def __getattr__(self, name: str) -> Any:
        if name.startswith("do_"):
            return self.serve
        raise AttributeError(name)

    def _body(self) -> bytes:
        if "chunked" in self.headers.get("Transfer-Encoding", "").lower():
            octets = b""
            while size := int(self.rfile.readline().split(b";")[0] or b"0", 16):
                octets += self.rfile.read(size)
                self.rfile.readline()
            while self.rfile.readline().strip():
                pass
            self.close_connection = self.close_connection or "Content-Length" in self.headers
            return octets
        return self.rfile.read(int(self.headers.get("Content-Length", 0)))

    def serve(self) -> None:
        """Answer one request."""
        rack, fields = self.rack, {name.lower(): value for name, value in self.headers.items()}
        lengths = self.headers.get_all("Content-Length") or []
        hosts = self.headers.get_all("Host") or []
        if len(set(lengths)) > 1 or (self.request_version == "HTTP/1.1" and len(hosts) != 1):
            self.close_connection = True
            self.send(400, {"Content-Type": "application/json"}, b'{"error": "head"}')
            return
        length = int(lengths[0]) if lengths and lengths[0].isdigit() else 0
        method, kept = self.command, b""
        unread = (
            ("unread after 415", fields.get("content-type", "").partition(";")[0] != "application/json"),
            ("unread after 404", bool(re.search(r"unknown|/9{2,}|/98765", self.path))),
            ("unread large", length > 30_000),
        )
        status_first = None
        if (
            length
            and method not in {"GET", "HEAD", "OPTIONS"}
            and any(on and name in rack.faults for name, on in unread)
        ):
            status_first = rack.answer(method, self.path, fields, b"")
        if status_first is None:
            kept = self._body()
            if length > 1 << 20 or len(kept) > 1 << 20:
                status_first = (413, {"Content-Type": "application/json"}, b'{"error": "too large"}')
                self.close_connection = True
        status, headers, octets = status_first or rack.answer(method, self.path, fields, kept)
        if "closes after errors" in rack.styles and status >= 400:
            headers["Connection"] = "close"
            self.close_connection = True
        self.send(status, headers, octets)

    def send(self, status: int, headers: dict[str, str], octets: bytes) -> None:
        """Write a response."""
        faults, text = self.rack.faults, octets.decode(errors="replace")
        self.send_response(status)
        for name, value in headers.items():
            self.send_header(name, value)
        is_head = self.command == "HEAD"
        size = len(octets)
        if "length in characters" in faults and not octets.isascii():
            size = len(text)
        if status not in {204, 304} and not (is_head and "HEAD without length" in self.rack.styles):
            self.send_header("Content-Length", str(size))
        self.end_headers()
        if not is_head and status not in {204, 304}:
            self.wfile.write(octets[:size])


class _Server(ThreadingHTTPServer):
    daemon_threads = True

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Print an error, unless the client has gone."""
        if not isinstance(sys.exception(), ConnectionError):
            super().handle_error(request, client_address)

    request_queue_size = 128


@contextmanager
def wired_device(faults: Collection[str] = (), styles: Collection[str] = ()) -> Iterator[str]:
    """Serve a rack in threads; yields its base URL."""
    handler = type("Handler", (_Handler,), {"rack": Rack(styles, faults)})
    server = _Server(("127.0.0.1", 0), handler)
    thread = threading.Thread(target=server.serve_forever, args=(0.01,), daemon=True)
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_port}"
    finally:
        server.shutdown()
        server.server_close()
        thread.join(10)
