"""A device that wants credentials is not blamed for that, and is not praised where it refused them all."""

import re

import pytest
from aiohttp import web
from guarded_device import SECRET, guarded
from small_device import certified, constant, described, error, reading, small_device
from soap_devices import SOAP_11, camera, serving

WSSE = "http://docs.oasis-open.org/wss/2004/01/oasis-200401-wss-wssecurity-secext-1.0.xsd"


@pytest.fixture(name="secret")
def _secret(tmp_path):
    """Return a function that writes a file with a credential, and returns its path."""

    def written(text):
        path = tmp_path / f"secret-{len(list(tmp_path.iterdir()))}"
        path.write_text(text, encoding="utf-8")
        return path

    return written


# A parameter that a scheme names is the credential; X-Token is none, as no scheme names it.
_DECLARED = [
    {"name": "X-Api-Key", "in": "header", "required": True, "schema": {"type": "string"}},
    {"name": "key", "in": "query", "schema": {"type": "string"}},
    {"name": "X-Lease", "in": "header", "required": True, "schema": {"type": "string"}},
    {"name": "X-Token", "in": "header", "schema": {"type": "string"}},
]


def test_credentials_of_each_kind_together_and_as_alternatives(secret, tmp_path):
    description, routes = guarded(
        [{"bearer": []}],
        [{"key": []}],
        [{"query": []}],
        [{"cookie": []}],
        [{"bearer": [], "key": [], "cookie": []}],
        [{"own": []}, {"bearer": []}],
        [{"oauth": ["read"]}],
        [{"openid": []}],
        [{"certificate": []}],
        [{"key": []}, {}],
        [],
        shared=[{"bearer": []}],
        parameters=_DECLARED,
    )
    headers = secret(f"X-Api-Key: {SECRET}\nCookie: session={SECRET}; theme=dark\nX-Lease: lease-4711")
    with small_device(description, routes) as url:
        done = certified(
            url, tmp_path / "out", "--token-file", secret(SECRET), "--headers-file", headers,
            "--api-key", "query key", "--api-key-file", secret(SECRET),
        )  # fmt: skip
    assert (done.blamed, done.exit_code) == ({}, 0), done.text
    assert done.requirement("description/security")["verdict"] == "pass"
    assert SECRET not in str(done.result)


@pytest.mark.parametrize(
    ("kind", "refusal", "option", "text"),
    [
        ("digest", 401, "--digest-file", f"user:{SECRET}"),
        ("own", 403, "--headers-file", f"Authorization: ApiKey {SECRET}"),
    ],
)
def test_credentials_of_each_kind_alone(kind, refusal, option, text, secret, tmp_path):
    description, routes = guarded([{kind: []}], refusal=refusal)
    description["components"]["securitySchemes"] = {kind: description["components"]["securitySchemes"][kind]}
    with small_device(description, routes) as url:
        done = certified(url, tmp_path / "out", option, secret(text))
    assert (done.blamed, done.exit_code) == ({}, 0), done.text
    assert SECRET not in str(done.result)


def test_an_operation_that_takes_no_credentials_of_swagger_2_is_found_and_others_are_not(secret, tmp_path):
    _, routes = guarded([{"basic": []}], [{"key": []}])
    routes["/open"] = guarded([])[1]["/open"]
    routes["/open"]["GET"] = constant({"on": True})["GET"]
    answered = {"200": {"description": "ok", "schema": {"type": "object"}}, "401": {"description": "no"}}
    description = {
        "swagger": "2.0",
        "info": {"title": "device", "version": "1"},
        "produces": ["application/json"],
        "securityDefinitions": {
            "basic": {"type": "basic"},
            "key": {"type": "apiKey", "in": "header", "name": "X-Api-Key"},
        },
        "paths": {
            path: {"get": {"responses": answered, "security": [{path.strip("/").replace("open", "key"): []}]}}
            for path in routes
        },
    }
    with small_device(description, routes) as url:
        done = certified(
            url, tmp_path / "out", "--basic-file", secret(f"user:{SECRET}"), "--api-key-file", secret(SECRET)
        )
    assert (done.blamed, done.exit_code) == ({"description/security": "fail"}, 1), done.text
    told = done.requirement("description/security")["failures"]
    assert {failure["request"]["url"].rpartition("/")[2] for failure in told} == {"open"}


def test_credentials_that_count_for_a_whole_connection_are_found(secret, tmp_path):
    """Connections that have carried the token need none any more; a new one does."""
    description, routes = guarded([{"bearer": []}])
    known = set()

    def kept(handle):
        async def answered(request):
            if request.headers.get("Authorization") == f"Bearer {SECRET}":
                known.add(id(request.transport))
            elif id(request.transport) in known:
                request = request.clone(headers={**request.headers, "Authorization": f"Bearer {SECRET}"})
            return await handle(request)

        return answered

    routes = {path: {method: kept(one) for method, one in methods.items()} for path, methods in routes.items()}
    with small_device(description, routes) as url:
        done = certified(url, tmp_path / "out", "--token-file", secret(SECRET))
    assert (done.blamed, done.exit_code) == ({"description/security": "fail"}, 1), done.text


@pytest.mark.parametrize(
    ("given", "refusal", "lasts", "said"),
    [
        (
            "wrong-one",
            401,
            None,
            r"The device answered 401 \(WWW-Authenticate: Bearer\) to each of \d+ requests .* needs none was judged",
        ),
        (
            "wrong-one",
            403,
            None,
            r"The device answered 403 to each of \d+ requests .*: only what needs none was judged",
        ),
        (SECRET, 401, 30, r"The device accepted the credentials of \d+ requests and then answered 401 .* not judged"),
        (
            "",
            401,
            None,
            r"The device answered 401 .* to each of \d+ requests .* Give the device's credentials: --token-file",
        ),
    ],
)
def test_what_a_device_refused_altogether_is_said_first_and_is_not_green(given, refusal, lasts, said, secret, tmp_path):
    description, routes = guarded(
        [{"bearer": []}], [{"bearer": [], "key": []}, {"bearer": []}], refusal=refusal, lasts=lasts
    )
    with small_device(description, routes) as url:
        done = certified(url, tmp_path / "out", *(("--token-file", secret(given)) if given else ()), "--class", "http")
    assert re.match(said, done.text), done.text
    assert (done.exit_code, done.result["verdict"]) == (4, "inconclusive"), done.text
    assert not {"fail", "warn"} & set(done.blamed.values())
    assert not {"pass", "fail"} & set(done.result["classes"].values())
    assert "<error" in (tmp_path / "out" / "junit.xml").read_text()
    for page in ("certificate.html", "certificate.md"):
        assert done.result["refused"][:30] in (tmp_path / "out" / page).read_text()


@pytest.mark.parametrize("forgives", [True, False])
def test_a_gateway_with_leases_that_shuts_out_who_sends_wrong_keys(forgives, secret, tmp_path):
    """A lease comes by POST; without it 428, with another one 423; after three wrong keys 429, or until a right one."""
    wrong = []

    def path(handle):
        async def answered(request):
            key, lease = request.headers.get("X-Api-Key"), request.headers.get("X-Lease")
            if len(wrong) >= 3:
                return error(429, "too many wrong keys")
            if key != SECRET:
                wrong.extend([key] if key else [])
                return error(401, "no such key", **{"WWW-Authenticate": "Key"})
            if forgives:
                wrong.clear()
            if request.path == "/lease":
                return web.json_response({"id": "lease-0815"})
            if lease != "lease-0815":
                return error(423 if lease else 428, "another client has the lease" if lease else "acquire a lease")
            return web.json_response({"on": True})

        return {handle: answered}

    state = {"type": "object", "required": ["on"], "properties": {"on": {"type": "boolean"}}}
    paths = {f"/{name}": reading(state) for name in ("arm", "base", "camera", "gripper")}
    lease = {"type": "object", "properties": {"id": {"type": "string"}}}
    paths["/lease"] = {"post": {**reading(lease)["get"], "security": [{"key": []}]}}
    schemes = {
        "key": {"type": "apiKey", "in": "header", "name": "X-Api-Key"},
        "lease": {"type": "apiKey", "in": "header", "name": "X-Lease"},
    }
    components = {"securitySchemes": schemes}
    description = described(paths, components=components, security=[{"key": [], "lease": []}])
    routes = {name: path("POST" if name == "/lease" else "GET") for name in paths}
    with small_device(description, routes) as url:
        statement = tmp_path / "robot.toml"
        statement.write_text(
            f'[endpoints]\nrest = "{url}"\napi_key = "header X-Api-Key"\napi_key_file = "{secret(SECRET)}"\n'
            f'[api]\nopenapi = "{url}/openapi.json"\n'
            '[auth]\nlogin = "POST /lease"\ntoken = "/id"\nsend_as = "header X-Lease"\n'
        )
        done = certified(statement, tmp_path / "out")
    assert (done.blamed, done.exit_code) == ({}, 0), done.text
    assert done.requirement("description/security")["verdict"] == "pass"


@pytest.mark.parametrize("status", [401, 500])
def test_a_soap_service_that_refuses_every_message_is_said_first_and_is_not_green(status, tmp_path):
    """A refusal is a 401 with a fault, or a fault that says so (WS-Security 12)."""
    fault = (
        f'<e:Envelope xmlns:e="{SOAP_11}"><e:Body><e:Fault><faultcode xmlns:w="{WSSE}">w:FailedAuthentication'
        "</faultcode><faultstring>who are you?</faultstring></e:Fault></e:Body></e:Envelope>"
    )
    device = camera()
    device.alter = lambda _request, *_answer: (status, "text/xml; charset=utf-8", fault.encode())
    with serving(device) as url:
        done = certified(f"{url}/camera.wsdl", tmp_path / "out")
    assert re.match(
        rf"The device answered {status}\b to each of \d+ requests .*only what needs none was judged", done.text
    ), done.text
    assert (done.exit_code, done.result["verdict"]) == (4, "inconclusive"), done.text
    assert not {"fail", "warn"} & set(done.blamed.values())


def test_a_key_beyond_ascii_that_the_device_fails_on_is_found(tmp_path):
    async def state(request):
        key = request.query.get("key", "")
        if not key.isascii():
            return error(500, "comparing strings with non-ASCII characters is not supported")
        return web.json_response({"x": 1}) if key == "sesame" else error(401, "no", **{"WWW-Authenticate": "Key"})

    schemes = {"securitySchemes": {"key": {"type": "apiKey", "in": "query", "name": "key"}}}
    api = described({"/state": reading({"type": "object"}, security=[{"key": []}])}, components=schemes)
    (tmp_path / "key").write_text("sesame", encoding="utf-8")
    with small_device(api, {"/state": {"GET": state}}) as url:
        given = ("--api-key", "query key", "--api-key-file", tmp_path / "key")
        outcome = certified(f"{url}/openapi.json", tmp_path / "out", *given)
    assert (outcome.exit_code, outcome.blamed) == (1, {"robustness/no-server-error": "fail"}), outcome.text
