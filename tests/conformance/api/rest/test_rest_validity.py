"""Requests are valid by what they are on the wire; what is written by hand as valid is read back by another parser."""

import json
from contextlib import closing

import pytest

from conformance.api.device import Device
from conformance.api.rest import by_hand
from conformance.api.rest.calls import example_call
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.parameters import wrong_texts
from conformance.api.rest.validity import validity
from conformance.contract.pack import Contract
from conformance.documents.openapi import operations_of
from conformance.transport import raw
from conformance.transport.client import Connection, HttpClient
from conformance.verdict.evidence import HarnessError
from conformance.verdict.run import Run

CONTRACT = Contract.load()
TWIST = b'{"linear": {"x": 0.1, "y": 0, "z": 0}, "angular": {"x": 0, "y": 0, "z": 0}}'
PLAN = "/robot/navigation/service/plan"
GOAL = "/robot/navigation/action/goal/"
DELIVERY = "/robot/app/delivery/{}/depot_x/{}/depot_y/1/dest_x/1/dest_y/1/source_x/1/source_y/1"


def _goal(**members):
    pose = {"position": {"x": 1, "y": 2, "z": 0}, "orientation": {"x": 0, "y": 0, "z": 0, "w": 1}}
    return json.dumps({"goal": {"target_pose": {"header": {"frame_id": "map"}, "pose": pose}}, **members}).encode()


@pytest.mark.parametrize(
    ("method", "target", "media_type", "body", "verdict", "requirement"),
    [
        ("GET", "/robot/pose/", "", b"", "valid", ""),
        ("GET", "/robot/pose/", "", b"x", "unclear", ""),
        ("GET", "/robot/pose/?a=1", "", b"", "unclear", ""),
        ("GET", "/no/such", "", b"", "unclear", ""),
        ("PUT", "/robot/velocity/", "application/json", TWIST, "valid", ""),
        ("PUT", "/robot/velocity/", "text/plain", TWIST, "unclear", ""),
        ("PUT", "/robot/velocity/", "application/json", b"", "invalid", "json-empty"),
        ("PUT", "/robot/velocity/", "application/json", b"[]", "invalid", "json-root"),
        ("PUT", "/robot/velocity/", "application/json", b"{}", "invalid", "json-missing"),
        ("PUT", "/robot/velocity/", "application/json", TWIST[:-1] + b', "w": 1}', "invalid", "json-unknown"),
        ("PUT", "/robot/velocity/", "application/json", TWIST.replace(b"0.1", b'"0.1"'), "invalid", "json-type"),
        ("PUT", "/robot/velocity/", "application/json", TWIST.replace(b"0.1", b"NaN"), "invalid", "json-non-finite"),
        ("PUT", "/robot/velocity/", "application/json", TWIST[:-1], "invalid", "json-malformed"),
        ("PUT", GOAL, "application/json", _goal(), "valid", ""),
        ("PUT", GOAL, "application/json", _goal(status={"code": 2, "text": ""}), "unclear", ""),
        ("PUT", GOAL, "application/json", _goal(status={"code": 2, "text": ""}, w=1), "invalid", "json-unknown"),
        ("PUT", "/robot/velocity/", "application/xml", b"<Vector3/>", "invalid", "xml-body"),
        ("PUT", "/robot/velocity/", "application/xml", b"<Twist><linear/></Twist>", "invalid", "xml-body"),
        ("GET", f"{PLAN}?x=1&y=-2.5e1", "", b"", "valid", ""),
        ("GET", f"{PLAN}?x=1", "", b"", "invalid", "query-missing"),
        ("GET", f"{PLAN}?x=&y=1", "", b"", "invalid", "query-parameter"),
        ("GET", f"{PLAN}?x=NaN&y=1", "", b"", "invalid", "query-parameter"),
        ("GET", f"{PLAN}?x=1e400&y=1", "", b"", "invalid", "query-parameter"),
        ("GET", f"{PLAN}?x=1.&y=1", "", b"", "unclear", ""),
        ("GET", f"{PLAN}?x=1&x=2&y=1", "", b"", "unclear", ""),
        ("GET", f"{PLAN}?x=1&y=1&tolerance=-1", "", b"", "invalid", "query-parameter"),
        ("PUT", DELIVERY.format(3, "1e3"), "", b"", "valid", ""),
        ("PUT", DELIVERY.format(5, "1"), "", b"", "invalid", "path-parameter"),
        ("PUT", DELIVERY.format(3, "1%2C5"), "", b"", "unclear", ""),
        ("PUT", DELIVERY.format(3, "one"), "", b"", "invalid", "path-parameter"),
        ("PUT", DELIVERY.format(3, ""), "", b"", "unclear", ""),
        ("PUT", DELIVERY.format(3, "%2E."), "", b"", "unclear", ""),
    ],
)
def test_requests_are_judged_by_what_they_are_on_the_wire(method, target, media_type, body, verdict, requirement):
    found = validity(CONTRACT, method, target, media_type, body)
    assert (found.verdict, found.requirement) == (verdict, requirement)


class _Careless(Device):
    """A device that fits a value to a robot by breaking it."""

    def fit(self, _api, _id, value):
        return {**value, "w": 1} if "linear" in value else value


def test_a_mistake_of_a_generator_is_the_suite_s():
    api = RestInterface(Run(), HttpClient("http://r2", Connection()))
    (operation,) = (item for item in operations_of(CONTRACT) if item.id == "putVelocity")
    assert example_call(api, operation).body
    api.device = _Careless(api.run)
    with pytest.raises(HarnessError, match="was made as a valid request, and is invalid"):
        example_call(api, operation)


@pytest.mark.parametrize(
    ("schema", "texts"),
    [
        (
            {"anyOf": [{"type": "integer"}, {"type": "string", "pattern": "^[a-z]+$"}]},
            {"7": "valid", "abc": "valid", "A": "invalid", "1.5": "unclear"},
        ),
        ({"type": ["integer", "string"]}, {"7": "valid", "abc": "valid", "": "unclear"}),
        (
            {"oneOf": [{"type": "null"}, {"type": "integer", "minimum": 1}]},
            {"7": "valid", "0": "invalid", "a": "invalid"},
        ),
        ({"enum": [1, 2]}, {"2": "valid", "3": "invalid", "a": "invalid"}),
        ({"type": "boolean"}, {"true": "valid", "True": "unclear", "1": "unclear", "maybe": "invalid"}),
        ({"type": ["integer", "null"]}, {"7": "valid", "null": "unclear", "abc": "invalid"}),
    ],
)
def test_a_parameter_of_several_types_is_valid_as_any_of_them(tmp_path, schema, texts):
    parameter = {"name": "id", "in": "path", "required": True, "schema": schema}
    responses = {"200": {"description": "there"}}
    document = {"paths": {"/things/{id}": {"get": {"parameters": [parameter], "responses": responses}}}}
    (tmp_path / "openapi.json").write_text(json.dumps(document))
    contract = Contract.load(tmp_path)
    assert {text: validity(contract, "GET", f"/things/{text}", "", b"").verdict for text in texts} == texts
    (operation,) = operations_of(contract)
    api = RestInterface(Run(contract=contract), HttpClient("http://r2", Connection()))
    assert example_call(api, operation).path.startswith("/things/")
    # A text that one of the types allows is not among those that a robot must refuse.
    wrong = {item.text for item in wrong_texts(operation.parameter("path")[0])}
    assert not wrong & {text for text, verdict in texts.items() if verdict == "valid"}


_ZERO = {"x": 0.0, "y": 0.0, "z": 0.0}
_BODY = json.dumps({"linear": _ZERO, "angular": _ZERO}).encode()
_CHUNKED = ("Content-Type: application/json; charset=utf-8", "Transfer-Encoding: chunked")


@pytest.fixture(name="api")
def _api(closed_port):
    with closing(HttpClient(f"{closed_port}/prefix", Connection())) as client:
        yield RestInterface(Run(contract=Contract.load()), client)


@pytest.fixture(name="sent")
def _sent(monkeypatch):
    sent = []
    monkeypatch.setattr(raw, "talk", lambda _client, octets, *, answers=0: sent.append((octets, answers)))
    return sent


def _put(api, body, *fields):
    return raw.head(api.client, "PUT", "/robot/velocity/", *fields) + body


def _get(api, path):
    return raw.head(api.client, "GET", path)


def test_valid_requests_are_sent_as_they_are(api, sent):
    absolute = _get(api, "/robot/pose/").replace(b" ", b" http://r2", 1)
    several = _get(api, "/robot/pose/") + raw.head(api.client, "HEAD", "/robot/sensors/") + absolute
    chunked = _put(api, raw.chunked(_BODY, 1), *_CHUNKED)
    for octets in (several, chunked):
        by_hand.talk(api, octets, answers=3)
    assert sent == [(several, 3), (chunked, 3)]


@pytest.mark.parametrize(
    "make",
    [
        lambda api: _put(api, raw.chunked(_BODY, 7)[:-1], *_CHUNKED),
        lambda api: _put(api, raw.chunked(_BODY, 7).replace(b"0\r\n\r\n", b""), *_CHUNKED),
        lambda api: _put(api, raw.chunked(_BODY[:-1], 7), *_CHUNKED),
        lambda api: _put(api, raw.chunked(_BODY.replace(b"0.0", b"null", 1), 1), *_CHUNKED),
        lambda api: _put(api, _BODY, "Content-Length: 5", "Content-Type: application/json"),
        lambda api: raw.head(api.client, "GET", "/robot/pose/", host=False),
        lambda api: _get(api, "/robot/pose/") + b"GET",
        lambda api: _get(api, "/robot/navigation/service/plan?x=abc&y=0"),
    ],
)
def test_what_is_not_valid_is_the_suite_s_mistake(api, sent, make):
    with pytest.raises(HarnessError):
        by_hand.talk(api, make(api))
    assert sent == []


def test_what_is_to_be_refused_is_whole_all_the_same(api, sent):
    by_hand.talk(api, _get(api, "/robot/navigation/service/plan?x=abc&y=0"), refused=True)
    assert len(sent) == 1
    with pytest.raises(HarnessError):
        by_hand.talk(api, b"GET / HTTP/1.1\r\n", refused=True)
