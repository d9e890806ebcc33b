"""A description decides neither where credentials go nor what is read.

The device is the server that the user named. Elsewhere is another server, which records what reaches it.
"""

import gzip
import json
import re
import sys
import time

import pytest
from hypothesis import find, settings
from origin_servers import SECRET, XSD, document, packed, redirect, serving
from processes import ended
from schemathesis.specs.openapi.examples import get_strategies_from_examples
from soap_devices import CAMERA, CAMERA_XSD

from conformance.api.rest.generated import _load_schema
from conformance.commandline.secret_file import read_secret
from conformance.documents.description import DescriptionError
from conformance.documents.json_shape import shape_of
from conformance.statement.endpoints import Endpoints
from conformance.target.describing import described_contract, fetch_description, soap_contract
from conformance.transport.client import Connection
from conformance.transport.fetching import Fetcher
from conformance.transport.reach import ElsewhereError, Trust, UnreachableError

READ = {"get": {"responses": {"200": {"description": "", "content": {"application/json": {"schema": {}}}}}}}


def openapi(pointer: str = "", **members):
    schema = {"$ref": pointer} if pointer else {"type": "object"}
    read = {"get": {"responses": {"200": {"description": "", "content": {"application/json": {"schema": schema}}}}}}
    version = {} if "swagger" in members else {"openapi": "3.1.0"}
    return {**version, "info": {"title": "t", "version": "1"}, "paths": {"/state": read}, **members}


def camera(types: str, address: str, imports: str = "") -> str:
    """Return the camera's WSDL with other schemas and another address."""
    schema = f'<xs:schema xmlns:xs="http://www.w3.org/2001/XMLSchema">{types}</xs:schema>'
    return CAMERA.replace("ADDRESS/camera", address).replace("<types>", f"{imports}<types>{schema}")


# What an OpenAPI description may name: its members, or the reference of a schema. ELSE is scheme, host and port of the
# other server, HOST its host and port, OWN the device's.
OPENAPI = {
    "$ref": "ELSE/part.json",
    "$ref with a fragment": "ELSE/part.json#/a",
    "$ref of a network path": "//HOST/part.json",
    "$ref with a user": "http://OWNHOST@HOST/part.json",
    "$ref with a user and a port": "http://user:OWNHOST@HOST/part.json",
    "$ref in capitals": "HTTP://HOST/part.json",
    "$ref that redirects": "OWN/redirect",
    "$ref that redirects to a network path": "OWN/slashes",
    "$ref that redirects in two steps": "OWN/again",
    "$ref to localhost": "http://localhost:PORT/part.json",
    "servers": {"servers": [{"url": "ELSE/api"}]},
    "a server of variables": {"servers": [{"url": "{h}/api", "variables": {"h": {"default": "ELSE"}}}]},
    "a server of a network path": {"servers": [{"url": "//HOST/api"}]},
    "a server with a user": {"servers": [{"url": "http://OWNHOST@HOST/api"}]},
    "a server with a backslash": {"servers": [{"url": "http://HOST\\@OWNHOST/api"}]},
    "Swagger's host": {"swagger": "2.0", "host": "HOST", "basePath": "/api"},
    "Swagger's schemes": {"swagger": "2.0", "schemes": ["https"], "host": "OWNHOST"},
    "Swagger's $ref": {"swagger": "2.0", "definitions": {"a": {"$ref": "ELSE/part.json"}}},
    "$self": {"$self": "ELSE/openapi.json", "components": {"schemas": {"a": {"$ref": "part.json"}}}},
    "$schema and $id": {
        "jsonSchemaDialect": "ELSE/dialect",
        "components": {"schemas": {"a": {"$schema": "ELSE/schema", "$id": "ELSE/id", "$ref": "part.json"}}},
    },
    "a property called value": {"components": {"schemas": {"a": {"properties": {"value": {"$ref": "ELSE/a.json"}}}}}},
    "a property called default": {"components": {"schemas": {"a": {"properties": {"default": {"$ref": "ELSE/a"}}}}}},
    "a default response": {"components": {"responses": {"default": {"$ref": "ELSE/a.json"}}}},
    "externalValue": {"components": {"examples": {"a": {"externalValue": "ELSE/a.json"}}}},
    "logins": {
        "components": {
            "securitySchemes": {
                "a": {"type": "openIdConnect", "openIdConnectUrl": "ELSE/openid"},
                "b": {"type": "oauth2", "flows": {"clientCredentials": {"tokenUrl": "ELSE/token", "scopes": {}}}},
            }
        }
    },
}
# What a WSDL may name: further schemas, an import, and its address.
WSDL = {
    "xs:import": ('<xs:import namespace="urn:else" schemaLocation="ELSE/a.xsd"/>', "", "OWN/camera"),
    "xs:include": ('<xs:include schemaLocation="ELSE/a.xsd"/>', "", "OWN/camera"),
    "xs:redefine": ('<xs:redefine schemaLocation="ELSE/a.xsd"/>', "", "OWN/camera"),
    "xs:override": ('<xs:override schemaLocation="ELSE/a.xsd"/>', "", "OWN/camera"),
    "a network path": ('<xs:import namespace="urn:else" schemaLocation="//HOST/a.xsd"/>', "", "OWN/camera"),
    "a redirect": ('<xs:import namespace="urn:else" schemaLocation="redirect"/>', "", "OWN/camera"),
    "a schema that imports": ('<xs:import namespace="urn:b" schemaLocation="b.xsd"/>', "", "OWN/camera"),
    "wsdl:import": ("", '<import namespace="urn:else" location="ELSE/a.wsdl"/>', "OWN/camera"),
    "soap:address": ("", "", "ELSE/camera"),
    "soap:address with a user": ("", "", "http://OWNHOST@HOST/camera"),
    "soap:address at localhost": ("", "", "http://localhost:PORT/camera"),
    "soap:address over https": ("", "", "https://HOST/camera"),
}


@pytest.fixture(scope="module")
def elsewhere():
    answers = {"/part.json": document({"a": {"type": "string"}}), "/a.xsd": document(XSD, "text/xml")}
    with serving(answers) as server:
        yield server


@pytest.fixture
def device(elsewhere):
    elsewhere.seen.clear()
    answers = {
        "/redirect": redirect(f"{elsewhere.url}/part.json"),
        "/slashes": redirect(elsewhere.url.removeprefix("http:") + "/part.json"),
        "/again": redirect("/redirect", 307),
        "/camera.xsd": document(CAMERA_XSD, "text/xml"),
        "/b.xsd": document(
            XSD.replace("urn:else", "urn:b").replace(
                "/>", f'><xs:import namespace="urn:else" schemaLocation="{elsewhere.url}/a.xsd"/></xs:schema>'
            ),
            "text/xml",
        ),
        "/state": document({}),
    }
    with serving(answers) as server:
        yield server


def written(value, device, elsewhere):
    """Return a value with the servers' names in it."""
    names = {"OWNHOST": device.url[7:], "OWN": device.url, "ELSE": elsewhere.url, "HOST": elsewhere.url[7:]}
    text = json.dumps(value).replace("OWNHOST", "\0").replace("PORT", elsewhere.url.rpartition(":")[2])
    text = text.replace("\0", names.pop("OWNHOST"))
    for name, server in names.items():
        text = text.replace(name, server)
    return json.loads(text)


def connection(*hosts):
    return Connection(timeout_s=10.0, token=SECRET, trust=Trust.of(hosts=hosts))


@pytest.mark.parametrize("pointer", OPENAPI)
def test_an_openapi_description_leads_nowhere_else(pointer, device, elsewhere, tmp_path):
    named = written(OPENAPI[pointer], device, elsewhere)
    whole = openapi(named) if isinstance(named, str) else openapi(**named)
    device.answers["/openapi.json"] = document(whole)
    source = f"{device.url}/openapi.json"
    _, where, remarks = described_contract(source, (), None, Endpoints(), connection(), tmp_path)
    assert where.rest.startswith(device.url)
    assert elsewhere.seen == []
    if isinstance(named, str):
        assert any("is not followed" in one for one in remarks), remarks
    elif pointer.startswith(("servers", "a server", "Swagger's h", "Swagger's s")):
        assert any("names the server" in one for one in remarks), remarks


BROKEN = [
    "http://[",
    "//[",
    "http://[::1",
    "https://a:b/",
    "\\\\x",
    "?",
    "http://",
    "\0",
    "é.json",
    "mailto:x",
    "x" * 5000,
]


@pytest.mark.parametrize("pointer", BROKEN)
def test_a_pointer_that_is_no_url_is_survived(pointer, device, tmp_path):
    named = {"a": {"$id": pointer, "$ref": "x"}, "b": {"$ref": pointer}, "c": {"$ref": f"x#{pointer}"}}
    whole = openapi(servers=[{"url": pointer}], components={"schemas": named}, **{"$self": pointer})
    device.answers["/openapi.json"] = document(whole)
    (tmp_path / "openapi.json").write_text(json.dumps(whole))
    for source in (f"{device.url}/openapi.json", str(tmp_path / "openapi.json")):
        _, where, _ = described_contract(source, (), device.url, Endpoints(), connection(), tmp_path / "out")
        assert where.rest == device.url
    types = f'<xs:import namespace="urn:else" schemaLocation="{pointer.strip(chr(0))}"/>'
    device.answers["/camera.wsdl"] = document(camera(types, f"{device.url}/camera"), "text/xml")
    assert soap_contract(f"{device.url}/camera.wsdl", None, Endpoints(), connection(), tmp_path)[1].rest == device.url


@pytest.mark.parametrize("pointer", WSDL)
def test_a_wsdl_leads_nowhere_else(pointer, device, elsewhere, tmp_path):
    types, imports, address = written(WSDL[pointer], device, elsewhere)
    device.answers["/camera.wsdl"] = document(camera(types, address, imports), "text/xml")
    source = f"{device.url}/camera.wsdl"
    _, where, remarks = soap_contract(source, None, Endpoints(), connection(), tmp_path)
    assert where.rest == device.url
    assert elsewhere.seen == []
    # What is not where the WSDL says on the device's own server is a finding, and no remark.
    assert pointer == "a redirect" or "another server" in " ".join(remarks), remarks


def test_a_soap_action_that_no_field_can_have_is_a_remark(device, tmp_path):
    wsdl = camera("", f"{device.url}/camera").replace('soapAction="', 'soapAction="a&#13;&#10;X-Injected: 1')
    device.answers["/camera.wsdl"] = document(wsdl, "text/xml")
    _, _, remarks = soap_contract(f"{device.url}/camera.wsdl", None, Endpoints(), connection(), tmp_path)
    assert "its soapAction has a control character" in " ".join(remarks)


@pytest.mark.parametrize("pointer", ["$ref", "$ref that redirects", "servers"])
def test_a_trusted_host_gets_the_credentials(pointer, device, elsewhere, tmp_path):
    named = written(OPENAPI[pointer], device, elsewhere)
    device.answers["/openapi.json"] = document(openapi(named) if isinstance(named, str) else openapi(**named))
    known = connection(elsewhere.url.removeprefix("http://"))
    _, where, _ = described_contract(f"{device.url}/openapi.json", (), None, Endpoints(), known, tmp_path)
    if pointer == "servers":
        assert where.rest == f"{elsewhere.url}/api"
    else:
        assert elsewhere.with_secret == ["GET /part.json"]


def test_an_overlay_that_the_user_named_is_fetched_without_credentials(device, elsewhere):
    device.answers["/openapi.json"] = document(openapi())
    elsewhere.answers["/overlay.json"] = document({"overlay": "1.0.0", "extends": "http://x/", "actions": []})
    fetch_description(f"{device.url}/openapi.json", (f"{elsewhere.url}/overlay.json",), connection())
    assert [line for line, _ in elsewhere.seen] == ["GET /overlay.json"]
    assert elsewhere.with_secret == []
    assert device.with_secret == ["GET /openapi.json"]


# What follows the device's address in its description's servers, and the path below which its operations are then.
SERVER_PATHS = {
    "/api v1": "/api%20v1",
    "/a\r\nX-Injected: 1": "/a%0D%0AX-Injected:%201",
    '/"<x>\0': "/%22%3Cx%3E%00",
    "/\u00e9/%7Eme": "/%C3%A9/%7Eme",
    "/v1;a=b/(c)": "/v1;a=b/(c)",
}


@pytest.mark.parametrize("whole", [False, True])
@pytest.mark.parametrize("path", SERVER_PATHS)
def test_the_path_of_a_server_can_always_be_sent(path, whole, device, tmp_path):
    server = f"{device.url}{path}" if whole else path
    device.answers["/openapi.json"] = document(openapi(servers=[{"url": server}]))
    source = f"{device.url}/openapi.json"
    _, where, _ = described_contract(source, (), None, Endpoints(), connection(), tmp_path)
    assert where.rest == f"{device.url}{SERVER_PATHS[path]}"


DESCRIBED_ELSEWHERE = {
    "an OpenAPI description": (described_contract, "/openapi.json", document(openapi())),
    "a WSDL": (soap_contract, "/camera.wsdl", document(camera("", "http://factory.example/camera"), "text/xml")),
}


@pytest.mark.parametrize("trusted", [False, True])
@pytest.mark.parametrize("kind", DESCRIBED_ELSEWHERE)
def test_a_description_on_another_server_than_the_api_is_fetched_without_credentials(
    kind, trusted, device, elsewhere, tmp_path
):
    contract_of, path, answer = DESCRIBED_ELSEWHERE[kind]
    elsewhere.answers[path] = answer
    more = () if contract_of is soap_contract else ((),)
    known = connection(*[elsewhere.url.removeprefix("http://")] * trusted)
    _, where, _ = contract_of(f"{elsewhere.url}{path}", *more, device.url, Endpoints(), known, tmp_path)
    assert where.rest == device.url
    lines = [line for line, _ in elsewhere.seen]
    assert lines[0] == f"GET {path}"
    assert elsewhere.with_secret == lines * trusted


def test_a_server_that_wants_credentials_it_does_not_get_is_told(device, elsewhere, tmp_path):
    elsewhere.answers["/openapi.json"] = document({}, status=401)
    option = f"it got no credentials: .*--trust-host {elsewhere.url.removeprefix('http://')}"
    with pytest.raises(DescriptionError, match=option):
        described_contract(f"{elsewhere.url}/openapi.json", (), device.url, Endpoints(), connection(), tmp_path)


# Parameters by which a server may take a request for another one, and others like them.
STEERING = {
    "header": [
        *("Host", "Forwarded", "X-Forwarded-Host", "X-Forwarded-Server", "X-Forwarded-Prefix", "X-Host"),
        *(
            "X-Original-URL",
            "X-Rewrite-Url",
            "X-HTTP-Method-Override",
            "X-HTTP-Method",
            "x-method-override",
            "X_HTTP_Verb",
        ),
        *("Content-Length", "Transfer-Encoding", "TE", "Connection", "Upgrade", "Expect", "Proxy-Authorization"),
    ],
    "query": ["_method", "x-http-method-override", "_HttpMethod", "httpMethod"],
}
HARMLESS = {
    "header": ["X-Request-Id", "If-Match", "X-Tenant", "Host-Name", "X-Calibration-Method", "Prefer"],
    "query": ["method", "host", "path", "url", "connection", "method_id"],
}


@pytest.mark.parametrize("version", ["swagger", "openapi"])
def test_no_parameter_makes_a_request_another_one(version, device):
    parameters = [
        {"name": name, "in": where, **({"type": "string"} if version == "swagger" else {"schema": {"enum": ["x"]}})}
        for table in (STEERING, HARMLESS)
        for where, names in table.items()
        for name in names
    ]
    shared = parameters[::2]
    whole = openapi(**({"swagger": "2.0"} if version == "swagger" else {}))
    whole["paths"]["/state"]["parameters"] = shared
    whole["paths"]["/state"]["get"]["parameters"] = [one for one in parameters if one not in shared]
    device.answers["/openapi.json"] = document(whole)
    found = fetch_description(f"{device.url}/openapi.json", (), connection()).document["paths"]["/state"]
    left = {(one["in"], one["name"]) for one in (*found.get("parameters", ()), *found["get"]["parameters"])}
    assert left == {(where, name) for where, names in HARMLESS.items() for name in names}


def test_credentials_in_a_url_s_query_and_headers_stay_too(device, elsewhere, tmp_path):
    files = {"api_key_file": "key", "headers_file": "headers", "basic_file": "basic"}
    (tmp_path / "key").write_text(SECRET)
    (tmp_path / "headers").write_text(f"X-Key: {SECRET}\nCookie: sid={SECRET}\n")
    (tmp_path / "basic").write_text(f"user:{SECRET}")
    device.answers["/openapi.json"] = document(openapi(f"{device.url}/redirect"))
    options = [word for name, file in files.items() for word in (f"--{name.replace('_', '-')}", tmp_path / file)]
    done = roaas("certify", f"{device.url}/openapi.json", *options, "--api-key", "query k", "--plan", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert any(f"k={SECRET}" in line for line, _ in device.seen)
    assert elsewhere.seen == []


# The commands, each on a description with every pointer at once.


@pytest.fixture
def everything(device, elsewhere, tmp_path):
    """Serve descriptions with all pointers; return the options of a run with a token."""
    members = {}
    schemas = {"state": {"type": "object"}}
    for number, value in enumerate(written(list(OPENAPI.values()), device, elsewhere)):
        if isinstance(value, str):
            schemas[f"s{number}"] = {"$ref": value}
        else:
            schemas |= value.get("components", {}).get("schemas", {})
            members |= {name: one for name, one in value.items() if name == "servers"}
    device.answers["/openapi.json"] = document(openapi(**members, components={"schemas": schemas}))
    types = "".join(written([one[0] for one in WSDL.values()], device, elsewhere))
    device.answers["/camera.wsdl"] = document(camera(types, f"{elsewhere.url}/camera"), "text/xml")
    (tmp_path / "token").write_text(SECRET)
    (tmp_path / "token").chmod(0o600)
    (tmp_path / "robot.toml").write_text(
        f'[api]\nwsdl = "{device.url}/camera.wsdl"\n[endpoints]\ntoken_file = "token"\n'
    )
    return "--token-file", tmp_path / "token"


def roaas(*words, **options):
    return ended(sys.executable, "-m", "roaas", *words, **options)


COMMANDS = {
    "certify": ("certify", "OWN/openapi.json", "--effort", "quick", "--class", "description"),
    "certify --init": ("certify", "--init", "first.toml", "OWN/openapi.json"),
    "certify a statement": ("certify", "robot.toml", "--effort", "quick", "--class", "soap"),
    "load": ("load", "OWN/openapi.json", "--duration", "1", "--warmup", "0.1", "--operation", "GET /state"),
    "load of a WSDL": ("load", "OWN/camera.wsdl", "--duration", "1", "--warmup", "0.1", "--operation", "GetStatus"),
    "load of the paper's robot": ("load", "--subscribers-wsdl", "OWN/camera.wsdl", "--duration", "1"),
    "diff": ("diff", "OWN/openapi.json", "OWN/openapi.json"),
}


@pytest.mark.parametrize("command", COMMANDS)
def test_no_command_lets_a_description_lead_elsewhere(command, everything, device, elsewhere, tmp_path):
    words = [word.replace("OWN", device.url) for word in COMMANDS[command]]
    token = () if command == "diff" or "robot.toml" in words else everything
    done = roaas(*words, *token, cwd=tmp_path)
    assert "Traceback" not in done.stdout + done.stderr, done.stderr
    assert device.seen, done.stderr
    assert elsewhere.seen == []
    assert bool(device.with_secret) is (command != "diff"), done.stderr
    if command != "load of the paper's robot":
        result = tmp_path / "out" / "latency.json"
        kept = result.read_text() if result.exists() else ""
        assert "on another server" in done.stdout + done.stderr + kept


def test_load_with_a_trusted_host_sends_the_token_there(everything, device, elsewhere, tmp_path):
    words = [word.replace("OWN", device.url) for word in COMMANDS["load of a WSDL"]]
    roaas(*words, *everything, "--trust-host", elsewhere.url.removeprefix("http://"), cwd=tmp_path)
    lines = " ".join(elsewhere.with_secret)
    assert "GET /a.xsd" in lines
    assert "POST /camera" in lines


def test_a_file_alone_does_not_decide_where_a_token_goes(everything, elsewhere, tmp_path):
    (tmp_path / "openapi.json").write_text(json.dumps(openapi(servers=[{"url": elsewhere.url}])))
    done = roaas("certify", "openapi.json", "--effort", "quick", *everything, cwd=tmp_path)
    assert (done.returncode, elsewhere.seen) == (2, [])
    assert f"--base-url {elsewhere.url}" in done.stderr
    given = ("certify", "openapi.json", *everything, "--base-url", elsewhere.url, "--plan")
    assert roaas(*given, cwd=tmp_path).returncode == 0


# What a description in a file may read.
FILES = {
    "above": "../secret.json",
    "absolute": "FOLDER/secret.json",
    "a link": "link.json",
    "below a link": "up/secret.json",
    "a file URL": "file://FOLDER/secret.json",
    "a short file URL": "file:FOLDER/secret.json",
    "a file URL with a host": "file://localhost/FOLDER/secret.json",
    "two slashes": "//FOLDER/secret.json",
    "through the folder": "parts/../../secret.json",
}
PLACES = {
    "a schema": lambda ref: {"schema": {"$ref": ref}},
    "a property called default": lambda ref: {"schema": {"properties": {"default": {"$ref": ref}}}},
    "an example called default": lambda ref: {"schema": {}, "examples": {"default": {"$ref": ref}}},
    "an example": lambda ref: {"schema": {}, "examples": {"one": {"$ref": ref}}},
}


@pytest.fixture
def api(tmp_path):
    folder = tmp_path / "api"
    (folder / "parts").mkdir(parents=True)
    (tmp_path / "secret.json").write_text(json.dumps({"enum": [SECRET], "default": SECRET, "value": SECRET}))
    (folder / "link.json").symlink_to(tmp_path / "secret.json")
    (folder / "up").symlink_to(tmp_path)
    return folder


def pack_of(folder, media, **more):
    path = folder / "openapi.json"
    taken = {"content": {"application/json": media}}
    paths = {"/a": {"post": {"requestBody": taken, "responses": {"200": {"description": ""}}}}}
    path.write_text(json.dumps({**openapi(), "paths": paths}))
    out = folder / "out"
    described_contract(str(path), (), "http://127.0.0.1:9", Endpoints(), Connection(), out, **more)
    return "".join(one.read_text() for one in out.rglob("*.json"))


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("form", FILES)
def test_a_description_reads_nothing_outside_its_folder(form, place, api):
    reference = FILES[form].replace("FOLDER", str(api.parent))
    assert SECRET not in pack_of(api, PLACES[place](reference))


def test_files_outside_the_folder_are_read_where_that_is_allowed(api):
    assert SECRET in pack_of(api, PLACES["a schema"]("../secret.json"), allow_files=True)


def test_what_generates_requests_and_what_judges_responses_fetch_nothing(elsewhere):
    elsewhere.seen.clear()
    schema = {"type": "object", "properties": {"a": {"default": {"$ref": "file:///etc/passwd"}}}}
    examples = {"one": {"externalValue": f"{elsewhere.url}/one"}, "two": {"$ref": f"{elsewhere.url}/two"}}
    taken = {"content": {"application/json": {"schema": schema, "examples": examples}}}
    answers = {"default": {"description": "", "content": {"application/json": {"schema": {"$ref": elsewhere.url}}}}}
    paths = {"/a": {"post": {"requestBody": taken, "responses": answers}}}
    for one in _load_schema({**openapi(), "paths": paths}).get_all_operations():
        get_strategies_from_examples(one.ok())
    number = {"name": "n", "in": "query", "schema": {"$schema": f"{elsewhere.url}/four", "type": "integer"}}
    paths = {"/a": {"get": {"parameters": [number], "responses": answers}}}
    for one in _load_schema({"$schema": f"{elsewhere.url}/five", **openapi(), "paths": paths}).get_all_operations():
        find(one.ok().as_strategy(), lambda _: True, settings=settings(database=None))
    with pytest.raises(Exception, match="Retrieval is disabled"):
        shape_of({"anyOf": [{"$ref": f"{elsewhere.url}/three"}]}).problem(1)
    assert elsewhere.seen == []


def test_the_description_of_a_server_reads_no_file(device, api):
    schemas = {name: {"$ref": form.replace("FOLDER", str(api.parent))} for name, form in FILES.items()}
    device.answers["/openapi.json"] = document(openapi(components={"schemas": schemas}))
    found = fetch_description(f"{device.url}/openapi.json", (), connection(), allow_files=True)
    assert SECRET not in json.dumps(found.document)


def test_a_wsdl_reads_no_schema_outside_its_folder(api):
    (api.parent / "camera.xsd").write_text(CAMERA_XSD)
    wsdl = CAMERA.replace("ADDRESS", "http://127.0.0.1:9").replace('"camera.xsd"', '"../camera.xsd"')
    (api / "camera.wsdl").write_text(wsdl)
    settings = str(api / "camera.wsdl"), None, Endpoints(), Connection()
    _, _, remarks = soap_contract(*settings, api / "out")
    assert any("--allow-files" in one for one in remarks), remarks
    assert not any("--allow-files" in one for one in soap_contract(*settings, api / "out", allow_files=True)[2])


# What a server may answer instead of a description, and what is said of it.
HTML = "<!DOCTYPE html><html><title>Login</title><body><br></body></html>"
ANSWERS = {
    "HTML": (document(HTML, "text/html"), "HTML"),
    "HTML as JSON": (document(HTML), "HTML"),
    "nothing": (document(b""), "no object"),
    "204": (document(b"", status=204), "responded 204"),
    "401": (document(b"", status=401), "401; are credentials missing"),
    "500": (document(HTML, status=500), "responded 500"),
    "a redirect to HTML": (redirect("/html"), "HTML"),
    "a loop": (redirect("/openapi.json"), "more than 4 redirects"),
    "a redirect to no URL": (redirect("http://[/"), "cannot be read|not HTTP"),
    "a redirect to a file": (redirect("file:///etc/passwd"), "cannot be read"),
    "a redirect without a place": (document(b"", status=302), "responded 302"),
    "Latin-1": (document('{"openapi": "3.1.0", "x": "é"}'.encode("latin-1")), "cannot be read: 'utf-8'"),
    "gzip that is none": (document(b"{}", Content_Encoding="gzip"), "Content-Encoding 'gzip'"),
    "half of a gzip": (document(gzip.compress(b"{}" * 99)[:-9], Content_Encoding="gzip"), "end before their checksum"),
    "another coding": (document(b"{}", Content_Encoding="br"), "'br'"),
    "a bomb": (packed(b" " * (33 << 20)), "more than 33,554,432 bytes"),
}


@pytest.mark.parametrize("name", ANSWERS)
def test_what_is_no_description_is_told(name, device):
    answer, told = ANSWERS[name]
    device.answers |= {"/v1/api/openapi.json": answer, "/openapi.json": answer, "/html": document(HTML, "text/html")}
    with pytest.raises((DescriptionError, UnreachableError), match=told):
        fetch_description(f"{device.url}/v1/api/openapi.json", (), connection())


def test_gzip_that_nobody_asked_for_is_read(device):
    device.answers["/openapi.json"] = packed(json.dumps(openapi()).encode())
    assert fetch_description(f"{device.url}/openapi.json", (), connection()).document["paths"]


def test_a_server_that_sends_single_bytes_costs_one_deadline(device):
    def drip(handler):
        while True:
            handler.wfile.write(b"H")
            handler.wfile.flush()
            time.sleep(0.05)

    device.answers["/openapi.json"] = drip
    began = time.monotonic()
    load = Fetcher(Connection(timeout_s=0.5), Trust.of(device.url))
    for _ in range(2):
        with pytest.raises(UnreachableError, match=re.escape("no response within 0.5 s")):
            load(f"{device.url}/openapi.json")
    assert time.monotonic() - began < 20


def test_https_never_falls_to_http(device):
    load = Fetcher(connection("127.0.0.1"), Trust.of("https://127.0.0.1:9/openapi.json", hosts=["127.0.0.1"]))
    with pytest.raises(ElsewhereError, match="what was named is https"):
        load(f"{device.url}/part.json")
    assert device.seen == []


@pytest.mark.parametrize("mode", [0o600, 0o640, 0o604])
def test_whoever_may_read_a_secret_is_told(mode, tmp_path, capfd):
    (tmp_path / "a token").write_text(f"{SECRET}\n")
    (tmp_path / "a token").chmod(mode)
    assert read_secret(tmp_path / "a token") == SECRET
    told = capfd.readouterr().err
    assert ("chmod 600" in told) is (mode != 0o600), told
    assert SECRET not in told


def test_each_option_with_a_secret_tells_of_it_once(device, tmp_path):
    device.answers["/openapi.json"] = document(openapi())
    options = ["--token-file", "--basic-file", "--digest-file", "--api-key-file", "--headers-file"]
    options += ["--username-token-file", "--sign"]
    for option in options:
        (tmp_path / option).write_text(f"X-Key: {SECRET}")
        (tmp_path / option).chmod(0o644)
    words = [word for option in options for word in (option, tmp_path / option)]
    done = roaas("certify", f"{device.url}/openapi.json", *words, "--api-key", "query k", cwd=tmp_path)
    shared = re.findall(r"other users can read the (?:secret|private key) in ?\S*/(--[a-z-]+)", done.stderr)
    assert sorted(shared) == sorted(set(options) - {"--username-token-file"}), done.stderr


def test_a_secret_that_cannot_be_read_is_told_by_its_file(tmp_path):
    with pytest.raises(OSError, match=r"^the file '\S*none' with a secret cannot be read: No such file or directory$"):
        read_secret(tmp_path / "none")
