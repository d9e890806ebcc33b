"""A wrong address is told as what it is, with what to do; a description that is found elsewhere is said."""

import json
import ssl
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import pytest
from click.testing import CliRunner
from small_device import described
from web_certificate import pair

import roaas

DESCRIPTION = described({"/state": {"get": {"responses": {"200": {"description": "ok"}}}}})
PAGE = b"<!doctype html><html><head><title>Robot &amp;\n Console</title></head></html>"
#: For each kind of server what it answers by path: status, media type and content; by default the path "".
SERVERS = {
    "page": {"": (200, "text/html", PAGE)},
    "guarded": {"": (401, "text/plain", b"no")},
    "empty": {"": (404, "text/plain", b"no")},
    "proxy": {"": (502, "text/html", b"<title>502 Bad Gateway</title>")},
    "good": {
        "": (404, "text/plain", b"no"),
        "/openapi.json": (200, "application/json", json.dumps(DESCRIPTION).encode()),
        "/state": (200, "text/plain", b"ok"),
    },
}


@contextmanager
def server(kind: str, context: ssl.SSLContext | None = None) -> Iterator[str]:
    """Serve one of SERVERS; yield host and port."""

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            status, media_type, content = SERVERS[kind].get(self.path, SERVERS[kind][""])
            self.send_response(status)
            self.send_header("Content-Type", media_type)
            self.send_header("Content-Length", str(len(content)))
            self.end_headers()
            self.wfile.write(content)

        def log_message(self, *_: object) -> None:
            pass

    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as running:
        running.handle_error = lambda *_: None
        if context is not None:
            running.socket = context.wrap_socket(running.socket, server_side=True)
        threading.Thread(target=running.serve_forever, args=(0.01,), daemon=True).start()
        yield f"127.0.0.1:{running.server_port}"
        running.shutdown()


def told(tmp_path, *words: str) -> tuple[int, str]:
    found = CliRunner().invoke(roaas.main, ["certify", *words, "-q", "--plan", "--out", str(tmp_path / "out")])
    return found.exit_code, " ".join(found.stderr.split())


@pytest.mark.parametrize(
    ("kind", "path", "code", "said"),
    [
        ("page", "/", 2, "an HTML page with the title 'Robot & Console'. /openapi.json, /openapi.yaml and "),
        ("page", "/a/b/c.json", 2, "title 'Robot & Console'. Name the URL or file of its OpenAPI description"),
        ("guarded", "/openapi.json", 2, "responded 401; are credentials missing, as by --token-file or --basic-file?"),
        ("empty", "/", 2, "responded 404. /openapi.json"),
        ("proxy", "/openapi.json", 2, "responded 502: a proxy answers, and the device behind it does not"),
    ],
)
def test_what_the_server_answers_is_told(tmp_path, kind, path, code, said):
    with server(kind) as place:
        exit_code, text = told(tmp_path, f"http://{place}{path}")
    assert (exit_code, said in text) == (code, True), text


@pytest.fixture(scope="module", name="authority")
def _authority(tmp_path_factory):
    certificate, key = pair(tmp_path_factory.mktemp("tls"), "device")
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(certificate, key)
    return context, certificate


def test_a_self_signed_certificate_leads_to_the_option(tmp_path, authority):
    context, certificate = authority
    with server("good", context) as place:
        code, text = told(tmp_path, f"https://{place}/openapi.json")
        assert code == 3
        assert "its certificate is self-signed: name it, or its authority, by --ca-file" in text
        assert told(tmp_path, f"https://{place}/openapi.json", "--ca-file", str(certificate))[0] == 0
        # The same without a description.
        code, text = told(tmp_path, "--rest", f"https://{place}")
        assert code == 0, "a plan sends nothing"


def test_tls_and_plain_ports_are_told_apart(tmp_path, authority):
    with server("good") as place:
        code, text = told(tmp_path, f"https://{place}/openapi.json")
        assert (code, "this port does not speak TLS; is the address http://?" in text) == (3, True), text
    with server("good", authority[0]) as place:
        code, text = told(tmp_path, f"http://{place}/openapi.json")
        assert (code, "is the address https://?" in text) == (3, True), text


def test_a_proxy_in_the_environment_is_named_where_there_is_no_connection(tmp_path, monkeypatch):
    monkeypatch.setenv("HTTP_PROXY", "http://127.0.0.1:9")
    with server("good") as place:
        assert told(tmp_path, f"http://{place}/openapi.json")[0] == 0
    code, text = told(tmp_path, f"http://{place}/openapi.json")
    assert (code, "http_proxy is set: no proxy is used" in text) == (3, True), text


@pytest.mark.parametrize(
    ("target", "said"),
    [
        ("robot:8000/openapi.json", "an address needs http:// or https:// before it: http://robot:8000/openapi.json"),
        ("127.0.0.1:8000", "http://127.0.0.1:8000"),
        ("ftp://robot/x", "ftp:// is not read; give the address as http:// or https://"),
        ("robt.toml", "there is no file robt.toml; did you mean robot.toml?"),
        ("other.yaml", "there is no file other.yaml"),
    ],
)
def test_what_is_neither_a_file_nor_an_address_is_told(tmp_path, monkeypatch, target, said):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "robot.toml").touch()
    code, text = told(tmp_path, target)
    assert (code, text.endswith(said)) == (2, True), text


def test_a_description_that_is_found_elsewhere_is_said(tmp_path):
    with server("good") as place:
        command = ["certify", f"http://{place}/docs", "--effort", "quick", "--out", str(tmp_path)]
        done, planned = (CliRunner().invoke(roaas.main, [*command, *more]) for more in ((), ("--plan",)))
    assert f"The description was found at http://{place}/openapi.json." in done.stderr
    assert "The description was found" in str(json.loads((tmp_path / "result.json").read_text())["notes"])
    assert f"The description was found at http://{place}/openapi.json." in planned.stderr


@pytest.mark.parametrize(
    ("given", "place"),
    [
        ("", "/schema/openapi.json"),  # Litestar
        ("", "/documentation/json"),  # Fastify
        ("", "/api-json"),  # NestJS
        ("", "/openapi"),  # MicroProfile OpenAPI
        ("", "/q/openapi"),  # Quarkus
        ("", "/v1/openapi.json"),  # Connexion
        ("", "/api/schema/"),  # drf-spectacular
        ("", "/apispec_1.json"),  # Flasgger
        ("", "/api/docs/swagger.json"),  # aiohttp-apispec
        ("", "/swagger/doc.json"),  # swaggo
        ("", "/doc"),  # Hono
        ("", "/api-docs/openapi.json"),  # utoipa
        ("", "/openapi/openapi.json"),  # flask-openapi3
        ("", "/api-docs.json"),  # swagger-jsdoc
        ("", "/openapi/json"),  # Elysia
        ("", "/swagger/json"),
        ("", "/api-docs/swagger-ui-init.js"),  # swagger-ui-express, which has no other document
        ("/anywhere/", "/anywhere/swagger-ui-init.js"),
        ("/robot7", "/robot7/openapi.json"),  # behind a prefix
        ("/site/robot7", "/site/robot7/openapi.json"),
    ],
)
def test_a_description_is_found_where_frameworks_serve_it(tmp_path, monkeypatch, given, place):
    *head, content = SERVERS["good"]["/openapi.json"]
    if place.endswith(".js"):
        options = {"swaggerDoc": {**DESCRIPTION, "default": DESCRIPTION}, "customOptions": {}}
        content = f"window.onload = function() {{\n  var options = {json.dumps(options, indent=2)};\n}}".encode()
    monkeypatch.setitem(SERVERS, "good", {"": SERVERS["empty"][""], place: (*head, content)})
    with server("good") as host:
        command = ["certify", f"http://{host}{given}", "--plan", "--out", str(tmp_path)]
        done = CliRunner().invoke(roaas.main, command)
    assert f"The description was found at http://{host}{place}." in done.stderr, done.output
    read = json.loads((tmp_path / "description" / "original.json").read_text(encoding="utf-8"))
    assert read.keys() == DESCRIPTION.keys(), "tsoa's copy"


def test_options_of_the_papers_robot_are_no_options_of_a_described_one(tmp_path):
    with server("good") as place:
        code, text = told(tmp_path, f"http://{place}/openapi.json", "--publishers-wsdl", "http://robot/x?wsdl")
    assert code == 2
    assert "--publishers-wsdl is for a robot with the paper's contract" in text


def test_the_nearest_class_and_operation_are_named(tmp_path):
    with server("good") as place:
        code, text = told(tmp_path, f"http://{place}/openapi.json", "--class", "htpp")
        assert (code, "--class 'htpp': did you mean http?" in text) == (2, True), text
        done = CliRunner().invoke(
            roaas.main,
            [
                "certify",
                f"http://{place}/openapi.json",
                "--call",
                "GET /stat",
                "--effort=quick",
                "--out",
                str(tmp_path),
            ],
        )
    assert "The pattern 'GET /stat' matches no operation of the description; did you mean 'GET /state'?" in done.stderr
