"""Credentials go into every request, and into no finding."""

import json
import shlex
from dataclasses import replace

import pytest

from conformance.commandline.secrecy import SECRETS
from conformance.engine.resending import send_again
from conformance.statement.endpoints import Endpoints
from conformance.statement.statement import StatementError
from conformance.target.connecting import connection_of
from conformance.transport import raw
from conformance.transport.client import Connection, HttpClient
from conformance.transport.credentials import Credential, Credentials, Kind
from conformance.transport.exchange import Request
from conformance.transport.raw import PartialRequest

_ALL = Credentials(
    (
        Credential(Kind.BASIC, "user:s3cret word"),
        Credential(Kind.HEADER, "k3y-in-header", "X-API-Key"),
        Credential(Kind.QUERY, "k3y&in query", "key"),
        Credential(Kind.COOKIE, "k3y-in-cookie", "session"),
        Credential(Kind.COOKIE, "second-cookie", "more"),
    )
)
_SECRETS = ("s3cret", "dXNlcjpzM2NyZXQgd29yZA==", "k3y-in-header", "k3y%26in", "k3y&in", "k3y-in-cookie", "second-coo")


@pytest.fixture
def heard(listening):
    got = []

    def answer(connection):
        octets = b""
        while b"\r\n\r\n" not in octets and (piece := connection.recv(65536)):
            octets += piece
        got.append(octets.decode("latin-1"))
        line = octets.split(b" ")[1]
        body = json.dumps({"detail": f"for {line.decode()}"}).encode()
        connection.sendall(b"HTTP/1.1 200 OK\r\nConnection: close\r\nContent-Length: %d\r\n\r\n%b" % (len(body), body))
        connection.close()

    return listening(answer), got


def test_each_goes_where_it_belongs_and_findings_show_variables(heard):
    url, got = heard
    for item in _ALL.items:
        replace(item)  # made anew: a test forgets the secrets of others
    client = HttpClient(url, Connection(credentials=_ALL))
    exchange = client.send("GET", "/pose/?x=1")
    assert got[0].startswith("GET /pose/?x=1&key=k3y%26in%20query HTTP/1.1\r\n")
    for line in (
        "Authorization: Basic dXNlcjpzM2NyZXQgd29yZA==",
        "X-API-Key: k3y-in-header",
        "Cookie: session=k3y-in-cookie; more=second-cookie",
    ):
        assert f"\r\n{line}\r\n" in got[0]
    request = exchange.request
    assert request.url == f"{url}/pose/?x=1", "checkers know it by the URL that was asked for"
    shown = request.curl()
    assert "?x=1&key=$ROAAS_QUERY_KEY" in shown
    assert '"Authorization: Basic $ROAAS_BASIC"' in shown
    assert '"Cookie: session=$ROAAS_COOKIE_SESSION; more=$ROAAS_COOKIE_MORE"' in shown
    assert not any(secret in shown + repr(request) + repr(client.connection) for secret in _SECRETS)
    assert "k3y" not in json.dumps(SECRETS.masked_json({"body": exchange.response.body.decode()}))


def test_a_request_can_be_sent_without_and_with_wrong_ones(heard):
    url, got = heard
    client = HttpClient(url, Connection(credentials=_ALL))
    client.send("GET", "/", authorized=False)
    assert not any(secret in got[0] for secret in _SECRETS)
    HttpClient(url, Connection(credentials=_ALL.wrong)).send("GET", "/")
    assert "X-API-Key: roaas-not-this-one" in got[1]
    assert not any(secret in got[1] for secret in _SECRETS)


@pytest.mark.parametrize(
    ("name", "secret", "wrong", "places"),
    [
        ("Authorization", "ApiKey s3same-1", "ApiKey roaas-not-this-one", (("header", "authorization"),)),
        ("Authorization", "s3same-1", "roaas-not-this-one", (("header", "authorization"),)),
        ("X-Key", "s3same-1", "roaas-not-this-one", (("header", "x-key"),)),
        (
            "Cookie",
            "id=s3same-1; theme=dark",
            "id=roaas-not-this-one; theme=roaas-not-this-one",
            (("cookie", "id"), ("cookie", "theme")),
        ),
    ],
)
def test_a_wrong_credential_keeps_its_scheme_and_its_names(name, secret, wrong, places):
    credential = Credential(Kind.HEADER, secret, name)
    assert (credential.wrong.secret, credential.wrong.variable, credential.places) == (wrong, wrong, places)
    assert "s3same-1" not in Credentials((credential,)).hide('{"you sent": "s3same-1"}')


def test_cookies_of_credentials_join_those_of_the_request(heard):
    url, got = heard
    client = HttpClient(url, Connection(credentials=_ALL))
    exchange = client.send("GET", "/", headers=[("Cookie", "own=1")])
    assert "\r\nCookie: own=1; session=k3y-in-cookie; more=second-cookie\r\n" in got[0]
    assert got[0].count("Cookie:") == 1
    assert dict(exchange.request.headers)["Cookie"] == "own=1; session=$ROAAS_COOKIE_SESSION; more=$ROAAS_COOKIE_MORE"


def test_raw_and_partial_requests_carry_them_and_do_not_show_them(heard):
    url, got = heard
    client = HttpClient(url, Connection(credentials=_ALL))
    octets = raw.head(client, "GET", "/a")
    raw.talk(client, octets)
    with PartialRequest(client, "GET", "/b") as partial:
        pass
    assert "k3y%26in%20query" in got[0]
    assert "X-API-Key: k3y-in-header" in got[0]
    shown = raw.shown_request(client, octets)
    assert not any(secret in repr(one) for secret in _SECRETS for one in (shown, partial.request))
    send_again(shown, client.connection)
    # The partial request, which nobody waits for, may be heard before or after it.
    assert got.count(got[0]) == 2


def test_the_shell_expands_nothing_but_variables():
    credentials = Credentials((Credential(Kind.HEADER, "hidden-one", 'X`id`$(id)"'),))
    (pair,) = credentials.fields(shown=True)
    assert pair == ('X`id`$(id)"', "$ROAAS_HEADER_X_ID___ID__")
    client_request = HttpClient("http://h", Connection()).url("/")
    assert r'"X\`id\`\$(id)\": $ROAAS_HEADER_X_ID___ID__"' in Request("GET", client_request, (pair,)).curl()
    assert shlex.split(Request("GET", client_request).curl())


def test_they_are_read_from_files(tmp_path):
    for name, text in (("basic", "u:p4ssword\n"), ("key", "abcdef"), ("fixed", "X-Tenant: four\nX-Site: five5\n")):
        (tmp_path / name).write_text(text)
    where = Endpoints(
        basic_file=str(tmp_path / "basic"),
        api_key="cookie session",
        api_key_file=str(tmp_path / "key"),
        headers_file=str(tmp_path / "fixed"),
    )
    assert [(item.kind, item.name, item.secret) for item in connection_of(where).credentials.items] == [
        ("basic", "", "u:p4ssword"),
        ("cookie", "session", "abcdef"),
        ("header", "X-Tenant", "four"),
        ("header", "X-Site", "five5"),
    ]
    with pytest.raises(StatementError, match="api_key_file"):
        connection_of(Endpoints(api_key="nowhere key", api_key_file=str(tmp_path / "key")))


def test_a_bearer_token_is_one_of_them():
    opener = "one-two"
    assert Connection(token=opener).credentials.fields(shown=True) == [("Authorization", "Bearer $ROAAS_TOKEN")]
