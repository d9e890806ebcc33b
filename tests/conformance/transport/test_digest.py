"""Digest authentication (RFC 7616): the device's challenge is answered, and no password is sent or shown."""

import hashlib
import threading
import time
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import pytest
from msgspec.structs import replace
from requests.utils import parse_dict_header

from conformance.api.rest.guard import Guard
from conformance.api.rest.interface import RestInterface
from conformance.commandline.secrecy import SECRETS
from conformance.contract.pack import Contract
from conformance.engine.resending import send_again
from conformance.statement.endpoints import Endpoints
from conformance.statement.statement import empty_statement
from conformance.target.connecting import connection_of
from conformance.transport import raw
from conformance.transport.client import HttpClient
from conformance.transport.raw import PartialRequest
from conformance.verdict.run import Run

_SHARED = "known-to-both"


def _digest(text, algorithm):
    hashes = {"MD5": "md5", "MD5-sess": "md5", "SHA-256": "sha256"}
    return hashlib.new(hashes[algorithm], text.encode()).hexdigest()


def _response(algorithm, request, given):
    """Return what answers a challenge (RFC 7616 3.4.1)."""
    secret = _digest(f"user:the device:{_SHARED}", algorithm)
    if algorithm.endswith("-sess"):
        secret = _digest(f"{secret}:{given['nonce']}:{given['cnonce']}", algorithm)
    uses = f"{given['nonce']}:{given['nc']}:{given['cnonce']}:auth"
    return _digest(f"{secret}:{uses}:{_digest(request, algorithm)}", algorithm)


@contextmanager
def _protected(algorithm="SHA-256", lasts=1_000_000):
    """Serve a device that wants user and password, gives a nonce for some requests, and takes each count once."""
    state, counts = {"served": 0, "challenged": 0}, {}
    lock = threading.Lock()

    class Handler(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"

        def _is_right(self):
            scheme, _, rest = self.headers.get("Authorization", "").partition(" ")
            given = parse_dict_header(rest) if scheme == "Digest" else {}
            nonce = given.get("nonce")
            if nonce not in counts or given["uri"] != self.path or given["nc"] in counts[nonce]:
                return False
            wanted = _response(algorithm, f"{self.command}:{self.path}", given)
            counts[nonce].add(given["nc"])
            if len(counts[nonce]) >= lasts:
                del counts[nonce]
            return given["response"] == wanted

        def do_GET(self):
            self.rfile.read(int(self.headers.get("Content-Length", 0)))
            with lock:
                if self._is_right():
                    state["served"] += 1
                    body, status, fields = b'{"served": true}', 200, []
                else:
                    state["challenged"] += 1
                    nonce = f"n{state['challenged']}"
                    counts[nonce] = set()
                    challenge = f'Digest realm="the device", nonce="{nonce}", qop="auth", algorithm={algorithm}'
                    body, status, fields = b"{}", 401, [("WWW-Authenticate", challenge)]
            self.send_response(status)
            for name, value in [*fields, ("Content-Length", str(len(body)))]:
                self.send_header(name, value)
            self.end_headers()
            self.wfile.write(body)

        def do_PUT(self):
            self.do_GET()

        def do_DELETE(self):
            self.do_GET()

        def log_message(self, *_):
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    threading.Thread(target=server.serve_forever, args=(0.01,), daemon=True).start()
    yield f"http://127.0.0.1:{server.server_port}/api", state
    server.shutdown()
    server.server_close()


@pytest.fixture
def pair(tmp_path):
    (tmp_path / "user").write_text(f"user:{_SHARED}\n")
    return Endpoints(digest_file=str(tmp_path / "user"))


@pytest.mark.parametrize("algorithm", ["MD5", "SHA-256"])
def test_a_challenge_is_answered_once_and_its_nonce_used_again(pair, algorithm):
    with _protected(algorithm) as (url, state):
        client = HttpClient(url, connection_of(replace(pair, rest=url)))
        exchanges = [client.send("GET", "/state?x=1"), client.send("PUT", "/move", body=b"{}"), client.send("GET", "/")]
    assert [one.response.status for one in exchanges] == [200, 200, 200]
    assert state["challenged"] == 1
    assert "--digest -u $ROAAS_DIGEST" in exchanges[1].request.curl().replace('"', "")
    assert _SHARED not in repr(exchanges) + repr(client.connection)


def test_a_nonce_that_has_expired_is_replaced(pair):
    with _protected(lasts=2) as (url, state):
        client = HttpClient(url, connection_of(replace(pair, rest=url)))
        assert [client.send("GET", "/").response.status for _ in range(7)] == [200] * 7
    assert state["challenged"] == 4


def test_clients_at_once_share_a_nonce(pair):
    found = []
    with _protected() as (url, state):
        connection = connection_of(replace(pair, rest=url))
        HttpClient(url, connection).send("GET", "/")

        def ask():
            client = HttpClient(url, connection)
            found.extend(client.send("GET", "/").response.status for _ in range(5))

        threads = [threading.Thread(target=ask) for _ in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    assert found == [200] * 20
    assert state["challenged"] == 1


def test_a_wrong_password_is_refused_and_nothing_is_sent_for_ever(pair):
    with _protected() as (url, state):
        connection = connection_of(replace(pair, rest=url))
        connection.credentials = connection.credentials.wrong
        assert HttpClient(url, connection).send("GET", "/").response.status == 401
    assert (state["served"], state["challenged"]) == (0, 2)


def test_without_credentials_nothing_answers_the_challenge(pair):
    with _protected() as (url, state):
        assert (
            HttpClient(url, connection_of(replace(pair, rest=url))).send("GET", "/", authorized=False).response.status
            == 401
        )
    assert state["challenged"] == 1


def test_raw_requests_answer_it_and_can_be_sent_again(pair):
    with _protected() as (url, state):
        client = HttpClient(url, connection_of(replace(pair, rest=url)))
        client.send("GET", "/")
        octets = raw.head(client, "GET", "/state")
        shown = raw.shown_request(client, octets)
        assert raw.read_one(client, octets, raw.talk(client, octets, answers=1), "GET")[0].response.status == 200
        with PartialRequest(client, "GET", "/state") as partial:
            pass
        for request in (shown, partial.request):
            assert "response=" not in repr(request)
        assert "Digest $ROAAS_DIGEST" in repr(shown)
        assert send_again(shown, connection_of(replace(pair, rest=url))).response.status == 200
        assert SECRETS.masked_json({"a": f"x {_SHARED}"}) == {"a": "x $ROAAS_DIGEST"}
    assert state["challenged"] == 2


@pytest.mark.parametrize(
    ("algorithm", "is_known"), [("MD5", True), ("SHA-256", True), ("MD5-sess", True), ("SHA-256", False)]
)
def test_the_guard_of_a_killed_run_answers_each_new_challenge(pair, algorithm, is_known):
    contract = Contract.load()
    with _protected(algorithm, lasts=1) as (url, state):
        where = replace(pair, rest=url)
        client = HttpClient(url, connection_of(where))
        if is_known:
            client.send("GET", "/")
        run = Run(replace(empty_statement(contract), endpoints=where), contract, allow_motion=True, stop_s=60.0)
        guard, before = Guard(RestInterface(run, client)), state["served"]
        guard.start()
        guard.release(stopped=False)  # as the end of this process does
        until = time.monotonic() + 60
        while state["served"] < before + 2 and time.monotonic() < until:  # the goal is cancelled, and the velocity 0
            time.sleep(0.02)
    assert state["served"] >= before + 2
