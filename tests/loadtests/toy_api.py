"""A device with an OpenAPI description of its own: `python toy_api.py [--auth KIND] [--fail-every N] [--slow S] …`.

Prints `ready PORT`. GET /calls says what was called, and is not in the description. POST /drive makes it move, and it
coasts after POST /halt.
"""

import argparse
import base64
import hashlib
import json
import re
import ssl
import sys
import time
from collections import Counter
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from types import SimpleNamespace
from typing import ClassVar

#: How it is driven, for a statement.
MAP = """
[values]
speed = [0.5]
[motion.state]
read = "GET /where"
[motion.state.axes]
x = { at = "/x", limits = [-1000, 1000], tolerance = 0.001 }
[motion.velocity]
send = "POST /drive"
body = { speed = "{speed}" }
tolerance = 0.1
settle_s = 0.2
axes = { speed = { limits = [-1, 1], at = "/speed" } }
[motion.stop]
send = "POST /halt"
"""
OK = {"description": "good", "content": {"application/json": {"schema": {"type": "object"}}}}
ITEM = {"name": "item_id", "in": "path", "required": True, "schema": {"type": "string"}}
SPEED = {"type": "object", "properties": {"speed": {"type": "number"}}, "required": ["speed"]}
BODY = {"required": True, "content": {"application/json": {"schema": SPEED}}}
DESCRIPTION = {
    "openapi": "3.1.0",
    "info": {"title": "toy", "version": "1"},
    "paths": {
        "/state": {"get": {"operationId": "readState", "responses": {"200": OK, "503": OK}}},
        "/items": {"get": {"responses": {"200": OK}}},
        "/items/{item_id}": {"get": {"parameters": [ITEM], "responses": {"200": OK, "404": OK}}},
        "/text": {"get": {"responses": {"200": OK}}},
        "/made": {"get": {"responses": {"200": OK}}},
        "/drive": {"post": {"requestBody": BODY, "responses": {"200": OK}}},
        "/where": {"get": {"responses": {"200": OK}}},
        "/halt": {"post": {"x-roaas-stop": True, "responses": {"200": OK}}},
        "/reset": {"get": {"responses": {"200": OK}}},
        "/events": {"get": {"responses": {"200": {"description": "events", "content": {"text/event-stream": {}}}}}},
    },
}
USER, PASSWORD, TOKEN = "robot", "s3same-robot", "t0ken-of-robot"
LOGIN = json.dumps({"user": USER, "password": PASSWORD})


def md5(text):
    return hashlib.md5(text.encode()).hexdigest()  # noqa: S324 -- RFC 7616 names it


class Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    disable_nagle_algorithm = True
    calls: ClassVar = Counter()
    nonces = 0
    body = SimpleNamespace(x=0.0, speed=0.0, since=0.0, until=0.0)

    def setup(self):
        super().setup()
        self.wfile = self.connection.makefile("wb", 65536)  # one segment for head and body

    def log_message(self, *_):
        pass

    def send(self, status, value, media_type="application/json", **headers):
        body = value if isinstance(value, bytes) else json.dumps(value).encode()
        self.send_response(status)
        for name, text in {"Content-Type": media_type, "Content-Length": str(len(body)), **headers}.items():
            self.send_header(name.replace("_", "-"), text)
        self.end_headers()
        self.wfile.write(body)
        self.wfile.flush()

    def date_time_string(self, timestamp=None):
        return super().date_time_string(timestamp or time.time() + self.server.options.ahead)

    def refused(self):
        """Answer a request without the right credential; say whether it was one."""
        kind, given = self.server.options.auth, self.headers.get("Authorization", "")
        pair = base64.b64encode(f"{USER}:{PASSWORD}".encode()).decode()
        good = {
            None: True,
            "bearer": given == f"Bearer {TOKEN}",
            "basic": given == f"Basic {pair}",
            "query": f"key={TOKEN}" in self.path,
            "header": self.headers.get("X-Robot-Key") == TOKEN,
            "digest": kind == "digest" and self.knows_digest(given),
        }[kind]
        if not good:
            Handler.nonces += 1
            challenge = f'Digest realm="toy", nonce="n{Handler.nonces}", qop="auth"' if kind == "digest" else "Bearer"
            self.calls["refused"] += 1
            self.send(401, {}, WWW_Authenticate=challenge)
        return not good

    def knows_digest(self, given):
        parts = dict(re.findall(r'(\w+)="?([^",]*)"?', given))
        if parts.get("nonce") is None:
            return False
        first, second = md5(f"{USER}:toy:{PASSWORD}"), md5(f"{self.command}:{parts['uri']}")
        wanted = md5(f"{first}:{parts['nonce']}:{parts['nc']}:{parts['cnonce']}:auth:{second}")
        return parts["response"] == wanted and parts["uri"] == self.path

    def do_GET(self):
        path = self.path.partition("?")[0]
        if path == "/openapi.json":
            return self.send(200, DESCRIPTION)
        if path == "/calls":
            return self.send(200, self.calls)
        length = int(self.headers.get("Content-Length") or 0)
        content = self.rfile.read(length)
        if path == "/login":
            good = content == LOGIN.encode()
            return self.send(200 if good else 403, {"session": {"token": TOKEN}} if good else {})
        if self.refused():
            return None
        self.calls[f"{self.command} {path}"] += 1
        return self.resource(path, content)

    do_POST = do_GET  # noqa: N815 -- http.server's name

    def resource(self, path, content):  # noqa: PLR0911 -- one for each resource
        """Answer a request for a resource of the description."""
        options = self.server.options
        if path in {"/drive", "/halt", "/where"}:
            return self.send(200, self.moved(path, content))
        if path == "/state":
            time.sleep(options.slow)
            failing = options.fail_every and not self.calls["GET /state"] % options.fail_every
            now = time.time() + options.ahead
            return self.send(503 if failing else 200, {"stamp": now - options.age, "now": now})
        if path == "/text":
            return self.send(200, b"not JSON", "text/plain")
        if path == "/made":
            return self.send(201, {})
        if path == "/events":
            return self.events(options)
        if path.startswith("/items/"):
            return self.send(200 if path in {"/items/left", "/items/right"} else 404, {})
        return self.send(200, [{"id": "left"}, {"id": "right"}] if path == "/items" else {})

    def moved(self, path, content):
        """Drive, or halt after coasting; say where it is."""
        now, body = time.monotonic(), self.body
        body.x += body.speed * max(0.0, min(now, body.until) - body.since)
        body.speed, body.since = body.speed if now < body.until else 0.0, now
        speed = json.loads(content)["speed"] if path == "/drive" else 0.0
        if path == "/halt" or (path == "/drive" and speed == 0):
            body.until = min(body.until, now + self.server.options.coast)
        elif path == "/drive":
            body.speed, body.until = speed, now + 3600
        return {"x": body.x, "speed": body.speed}

    def events(self, options):
        self.send_response(200)
        self.send_header("Content-Type", "text/event-stream")
        self.send_header("Connection", "close")
        self.end_headers()
        number = 0
        try:
            while True:
                number += 1
                event = json.dumps({"stamp": time.time() + options.ahead, "n": number})
                self.wfile.write(f"id: {number}\ndata: {event}\n\n".encode())
                self.wfile.flush()
                time.sleep(1 / options.events)
        except OSError:
            self.close_connection = True


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--auth")
    parser.add_argument("--fail-every", type=int, default=0)
    parser.add_argument("--slow", type=float, default=0.0)
    parser.add_argument("--events", type=float, default=50.0)
    parser.add_argument("--host", default="127.0.0.1")
    parser.add_argument("--ahead", type=float, default=0.0, help="how far its clock is ahead, s")
    parser.add_argument("--age", type=float, default=0.0, help="how old its state is, s")
    parser.add_argument("--coast", type=float, default=0.0, help="move on for so long after a halt, s")
    parser.add_argument("--tls", nargs=2, metavar=("CERT", "KEY"))
    server = ThreadingHTTPServer((parser.parse_known_args()[0].host, 0), Handler)
    server.daemon_threads = True
    server.options = parser.parse_args()
    if server.options.tls:
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        context.load_cert_chain(*server.options.tls)
        server.socket = context.wrap_socket(server.socket, server_side=True)
    sys.stdout.write(f"ready {server.server_port}\n")
    sys.stdout.flush()
    server.serve_forever()
