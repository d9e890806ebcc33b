"""Credentials of a connection: a login before the run, and API keys where the description wants them."""

import json
import sys

import pytest
from processes import ended
from toy_server import serving

from conformance.statement.endpoints import Auth, Endpoints
from conformance.statement.statement import StatementError
from conformance.target.connecting import connection_of, place_api_key

_SECRET, _TOKEN = "correct horse", "a-token-of-the-device"
_AUTH = Auth("POST /login", "/session/token")


def _device(method, path, content):
    if (method, path) == ("GET", "/state"):
        return 200, {}
    if (method, path) != ("POST", "/login"):
        return 404, {}
    known = json.loads(content or b"{}").get("password") == _SECRET
    return (200, {"session": {"token": _TOKEN}}) if known else (403, {"detail": "who?"})


def _endpoints(tmp_path, url, auth, password=_SECRET):
    body = tmp_path / "login.json"
    body.write_text(json.dumps({"user": "operator", "password": password}))
    return Endpoints(rest=url, auth=Auth(auth.login, auth.token, str(body), auth.content_type, auth.send_as))


@pytest.mark.parametrize(
    ("send_as", "header"),
    [
        ("bearer", ("Authorization", f"Bearer {_TOKEN}")),
        ("header X-Session", ("X-Session", _TOKEN)),
        ("cookie session", ("Cookie", f"session={_TOKEN}")),
    ],
)
def test_the_token_of_a_login_goes_into_every_request(send_as, header, tmp_path):
    auth = Auth(_AUTH.login, _AUTH.token, send_as=send_as)
    with serving(_device) as url:
        connection = connection_of(_endpoints(tmp_path, url, auth))
    assert connection.credentials.fields() == [header]
    assert _TOKEN not in repr(connection)


@pytest.mark.parametrize(
    ("auth", "password", "problem"),
    [
        (_AUTH, "wrong", "responded 403"),
        (Auth("POST /login", "/token"), _SECRET, "no text there"),
        (Auth("POST /login", "/session"), _SECRET, "no text there"),
    ],
)
def test_a_login_that_fails_says_why_and_shows_no_secret(auth, password, problem, tmp_path):
    with serving(_device) as url, pytest.raises(StatementError, match=problem) as caught:
        connection_of(_endpoints(tmp_path, url, auth, password))
    assert password not in str(caught.value)


def _wanting(*schemes):
    return {"components": {"securitySchemes": {str(number): one for number, one in enumerate(schemes)}}}


_KEY = {"type": "apiKey", "in": "query", "name": "key"}


def test_an_api_key_goes_where_the_description_wants_it():
    found = place_api_key(Endpoints(api_key_file="key"), _wanting(_KEY, {"type": "http", "scheme": "bearer"}))
    assert found.api_key == "query key"
    assert place_api_key(Endpoints(), _wanting(_KEY)).api_key is None


@pytest.mark.parametrize("schemes", [(), (_KEY, {**_KEY, "in": "header"})])
def test_without_one_place_for_a_key_the_user_is_asked(schemes):
    with pytest.raises(StatementError, match="say where the API key goes"):
        place_api_key(Endpoints(api_key_file="key"), _wanting(*schemes))


def test_a_device_behind_a_login_is_certified_by_its_statement(tmp_path):
    state = {"description": "the state", "content": {"application/json": {"schema": {"type": "object"}}}}
    responses = {"200": state, "401": {"description": "who?"}}
    document = {
        "openapi": "3.1.0",
        "info": {"title": "A device", "version": "1"},
        "paths": {"/state": {"get": {"responses": responses}}},
        "security": [{"login": []}],
        "components": {"securitySchemes": {"login": {"type": "http", "scheme": "bearer"}}},
    }
    statement, out = tmp_path / "device.toml", tmp_path / "out"
    (tmp_path / "openapi.json").write_text(json.dumps(document))
    (tmp_path / "login.json").write_text(json.dumps({"password": _SECRET}))
    with serving(_device) as url:
        statement.write_text(
            f'[api]\nopenapi = "openapi.json"\n[endpoints]\nrest = "{url}"\n'
            '[auth]\nlogin = "POST /login"\nbody_file = "login.json"\ntoken = "/session/token"\n'
        )
        options = ("--effort", "quick", "--class", "description", "--out", str(out))
        done = ended(sys.executable, "-m", "roaas", "certify", str(statement), *options)
    assert "1 of 1 operations called" in done.stdout, done.stdout + done.stderr
    result = (out / "result.json").read_text(encoding="utf-8")
    assert "$ROAAS_TOKEN" in result
    assert str(tmp_path) not in result, "the folders of this machine are nobody's business"
    assert all(secret not in result + done.stdout + done.stderr for secret in (_TOKEN, _SECRET))
