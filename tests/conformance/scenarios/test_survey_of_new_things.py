"""What must be new in each creation is found by trying, and a write that needs a condition has the entity tag."""

import datetime as dt
import itertools
import json
import re
from contextlib import closing, contextmanager

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from small_device import contract_of
from toy_server import Handler, server_of

from conformance.api.rest.inputs import whole_body
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.samples import fits
from conformance.api.rest.unique import with_number
from conformance.api.rest.values import Values
from conformance.api.rest.variations import Kind
from conformance.documents.json_text import read_json
from conformance.documents.openapi import operations_of
from conformance.scenarios.survey import Surveyor
from conformance.scenarios.writing import Writer
from conformance.statement.endpoints import Endpoints
from conformance.statement.statement import Calls, Statement
from conformance.transport.client import Connection, HttpClient
from conformance.transport.exchange import Outgoing
from conformance.verdict.run import Run

_MEMBERS = {
    "code": {"type": "string", "pattern": "^BX[0-9]{6}$", "example": "BX204417"},
    "label": {"type": "string", "minLength": 1, "maxLength": 20},
    "slot": {"type": "integer", "minimum": 1, "maximum": 100000},
    "kind": {"type": "string", "enum": ["dna", "rna"]},
    "note": {"type": "string", "maxLength": 40},
    "filled": {"type": "string", "format": "date", "example": "2021-04-30"},
}
_SCHEMA = {"type": "object", "required": ["code", "label", "slot", "kind", "filled"], "properties": _MEMBERS}
_BODY = {"required": True, "content": {"application/json": {"schema": _SCHEMA}}}
_ID = {"name": "id", "in": "path", "required": True, "schema": {"type": "integer"}}
_TAG = {"name": "If-Match", "in": "header", "required": True, "schema": {"type": "string"}}
_KEY = {"name": "Idempotency-Key", "in": "header", "schema": {"type": "string"}}
_OK = {"200": {"description": "it"}}


def _description(*headers):
    return {
        "openapi": "3.1.0",
        "info": {"title": "Tubes", "version": "1"},
        "paths": {
            "/tubes": {"post": {"requestBody": _BODY, "responses": {"201": {"description": "made"}}}},
            "/tubes/{id}": {
                "get": {"parameters": [_ID], "responses": _OK},
                "put": {"parameters": [_ID, *headers], "requestBody": _BODY, "responses": _OK},
            },
        },
    }


def _is_date(text):
    try:
        return bool(dt.date.fromisoformat(text))
    except ValueError:
        return False


class _Tubes:
    """A device that keeps tubes, of which some members are unique.

    Args:
        unique: their names; "code+slot": both together.
        refusal: the status of a second one.
        there: whether one that reads as the example is there from the beginning.
        wants_tag: the status without If-Match, or 0.
        labels: those that it takes; empty: all.
    """

    def __init__(self, unique=(), refusal=409, *, there=True, wants_tag=0, labels=()):
        self.unique, self.refusal, self.wants_tag, self.labels = unique, refusal, wants_tag, labels
        first = {"code": "BX204417", "label": "roaas", "slot": 1, "kind": "dna", "filled": "2021-04-30"}
        self.tubes = {1: first} if there else {}
        self.posts = []
        self.version = 0

    def _is_taken(self, body, but=None):
        others = [one for id_, one in self.tubes.items() if id_ != but]
        keys = [name.split("+") for name in self.unique]
        return any(all(name in body and one.get(name) == body[name] for name in key) for one in others for key in keys)

    def answer(self, method, target, tag, content):
        read = read_json(content)
        body = read.value
        id_ = int(found[1]) if (found := re.fullmatch(r"/tubes/(\d+)", target)) else None
        if method != "GET" and (read.unreadable or not fits(_SCHEMA, body) or not _is_date(body["filled"])):
            return 400, {}
        if method == "POST":
            return self._created(body)
        if id_ not in self.tubes:
            return 404, {}
        refusal = self._refusal(id_, tag, body) if method == "PUT" else 0
        return (refusal, {}) if refusal else (200, {"id": id_, **self.tubes[id_]})

    def _created(self, body):
        self.posts.append(body)
        if self.labels and body["label"] not in self.labels:
            return 422, {"title": "no such label"}
        if self._is_taken(body):
            return self.refusal, {"title": "there is one"}
        self.tubes[max(self.tubes, default=0) + 1] = body
        return 201, {"id": max(self.tubes), **body}

    def _refusal(self, id_, tag, body):
        if self.wants_tag and tag != f'"{self.version}"':
            return 412 if tag else self.wants_tag
        if self._is_taken(body, id_):
            return self.refusal
        self.tubes[id_], self.version = body, self.version + 1
        return 0

    def server(self):
        """Return a server that is it, with an entity tag on each response."""
        tubes = self

        class Tubes(Handler):
            def answer(self):
                status, value = tubes.answer(self.command, self.path, self.headers.get("If-Match"), self.content())
                self.send(status, json.dumps(value).encode())

            def end_headers(self):
                self.send_header("ETag", f'"{tubes.version}"')
                super().end_headers()

        return server_of(Tubes)


@contextmanager
def _surveyor(tmp_path, device, *headers):
    """Yield what surveys a device at quick, and the operations by label."""
    description = _description(*headers)
    contract = contract_of(tmp_path, description)
    with device.server() as server, closing(HttpClient(server.url, Connection())) as client:
        statement = Statement(endpoints=Endpoints(rest=server.url), calls=Calls(allow=("*",)))
        run = Run(statement=statement, contract=contract, seed=1)
        surveyor = Surveyor(RestInterface(run, client, alive=lambda: True), Values({}, frozenset({"tube"})))
        yield surveyor, {one.label: one for one in operations_of(contract)}


def _surveyed(tmp_path, device, label, *headers):
    """Return the probes of an operation that is surveyed at quick, and the status of another creation."""
    with _surveyor(tmp_path, device, *headers) as (surveyor, operations):
        for one in ("POST /tubes", "PUT /tubes/{id}"):
            for _ in surveyor.explore(operations[one]):
                pass
            if one == label:
                break
        again = Writer(surveyor.api, surveyor.values).send(operations["POST /tubes"])
        return [one for one in surveyor.probes if one.operation == label], again.response.status


def test_a_generated_request_names_a_known_thing_and_has_its_tag_and_a_new_key(tmp_path):
    device = _Tubes(wants_tag=428)
    with _surveyor(tmp_path, device, _TAG, _KEY) as (surveyor, operations):
        surveyor.begin(operations["POST /tubes"])
        fields = (("If-Match", ""), ("Idempotency-Key", "0"), ("Content-Type", "application/json"))
        body = json.dumps(device.tubes[1]).encode()
        made = [
            surveyor.reaching.complete(operations["PUT /tubes/{id}"], Outgoing("PUT", target, fields, body))
            for target in ("/tubes/7", "/tubes/7?a=/7", "/tubes/null")
        ]
        assert [one.target for one in made] == ["/tubes/2", "/tubes/2?a=/7", "/tubes/null"]
        assert {one.content_type for one in made} == {"application/json"}
        assert len({dict(one.headers)["Idempotency-Key"] for one in made} - {"0"}) == len(made)
        assert surveyor.api.send(made[0]).response.status == 200


@pytest.mark.parametrize("there", [True, False])
@pytest.mark.parametrize(
    ("unique", "refusal"),
    [
        (("code",), 409),
        (("label",), 409),
        (("slot",), 409),
        (("code", "label"), 409),
        (("code+slot",), 409),
        (("code",), 422),
        (("label",), 400),
    ],
)
def test_what_must_be_new_is_new(tmp_path, unique, refusal, there):
    if there and refusal != 409:
        there = False  # a refusal of the first one may have any reason
    device = _Tubes(unique, refusal, there=there)
    probes, again = _surveyed(tmp_path, device, "POST /tubes")
    accepted = [one for one in probes if one.kind in {Kind.ENUM, Kind.OPTIONAL, Kind.BOUND}]
    assert accepted
    # What another place says may be there already, as the least label of all.
    assert [one.says for one in accepted if not one.ok and one.place.removeprefix("body /") not in unique] == []
    assert again == 201


def test_one_member_must_be_new_although_the_device_refuses_all_members_changed(tmp_path):
    with _surveyor(tmp_path, _Tubes(("code",), labels=("roaas", "a"))) as (surveyor, operations):
        post = operations["POST /tubes"]
        for _ in surveyor.explore(post):
            pass
        assert surveyor.values.unique.names(post) == ("code",)


def test_an_optional_member_that_must_be_new_is_found(tmp_path):
    with _surveyor(tmp_path, _Tubes(("note",))) as (surveyor, operations):
        put = operations["PUT /tubes/{id}"]
        for operation in (operations["POST /tubes"], put):
            for _ in surveyor.explore(operation):
                pass
        assert surveyor.values.unique.names(put) == ("note",)
        new = [Writer(surveyor.api, surveyor.values).send(put, "/tubes/2", whole_body(put, surveyor.values)[1])]
        assert [one.response.status for one in new] == [200]


def test_a_creation_that_is_refused_for_another_reason_is_tried_a_few_times(tmp_path):
    device = _Tubes(("kind",))
    plain, _ = _surveyed(tmp_path, device, "POST /tubes")
    assert all(one.status in {400, 409, 201} for one in plain)
    others = [one for one in device.posts if one.get("code", "BX204417") != "BX204417"]
    assert len(others) <= 8


@pytest.mark.parametrize("wants_tag", [428, 412, 0])
@pytest.mark.parametrize("headers", [(), (_TAG,)])
def test_a_write_that_needs_a_condition_is_accepted(tmp_path, wants_tag, headers):
    device = _Tubes(("code",), wants_tag=wants_tag)
    probes, _ = _surveyed(tmp_path, device, "PUT /tubes/{id}", *headers)
    changed = [one for one in probes if one.kind in {Kind.ENUM, Kind.OPTIONAL} and one.place.startswith("body")]
    assert changed
    assert all(one.ok for one in changed), [(one.says, one.status) for one in changed if not one.ok]


@pytest.mark.parametrize(
    ("schema", "value"),
    [
        ({"type": "string", "pattern": "^BX[0-9]{6}$"}, "BX204417"),
        ({"type": "string", "format": "uuid"}, "3fa85f64-5717-4562-b3fc-2c963f66afa6"),
        ({"type": "string", "format": "email"}, "someone@example.com"),
        ({"type": "string", "minLength": 3}, "bay"),
        ({"type": "integer", "maximum": 100_000}, 1),
        ({"type": "string", "pattern": "^[a-z][a-z0-9-]{2,30}$"}, "arm-1"),
    ],
)
def test_a_numbered_value_fits_and_differs_from_the_others(schema, value):
    made = [with_number(schema, value, turn * 7919) for turn in range(12)]
    assert len({*map(str, made)}) == len(made)
    assert all(fits(schema, one) for one in made)


@settings(max_examples=100, deadline=None, derandomize=True)
@given(st.text(max_size=12), st.integers(0, 10**9), st.integers(0, 12))
def test_a_numbered_text_keeps_its_length_and_form(text, number, most):
    schema = {"type": "string", "maxLength": most}
    made = with_number(schema, text, number)
    assert made == text or (len(made) == len(text) and fits(schema, made))
    kinds = [(one.isdigit(), one.isascii() and one.isupper()) for one in text]
    assert made == text or len(kinds) == len(made)
    for old, new in itertools.zip_longest(text, made):
        assert old.isascii() is new.isascii()
