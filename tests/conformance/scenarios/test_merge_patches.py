"""Bodies that the suite sends to write, and what each of them shows."""

from small_device import answers, body_of, described, object_of

from conformance.api.rest.patches import merged
from conformance.api.rest.samples import fits
from conformance.api.rest.values import Values
from conformance.contract.described import write_described_pack
from conformance.contract.pack import Contract
from conformance.documents.openapi import operations_of
from conformance.scenarios.special_bodies import special_bodies

_SCENE = {"type": "string", "enum": ["flat", "bloom"]}
_LIGHTS = {"level": {"type": "integer", "minimum": 0, "maximum": 100}, "scene": _SCENE}
_FREE = {**_LIGHTS, "scene": {"enum": ["flat", "bloom", None]}}


def test_null_removes_a_member_of_an_object_beside_a_change(tmp_path):
    name = {"type": "string"}
    shown, taken = (object_of(name=name, lights={"type": "object", "properties": parts}) for parts in (_LIGHTS, _FREE))
    body = body_of(taken, "application/merge-patch+json")
    responses = {"200": answers(shown)}
    paths = {"/settings": {"get": {"responses": responses}, "patch": {"requestBody": body, "responses": responses}}}
    contract = Contract.load(write_described_pack(tmp_path, document := described(paths, "3.1.0"), document))
    read, change = sorted(operations_of(contract), key=lambda operation: operation.method)
    first = {"name": "north", "lights": {"level": 40, "scene": "flat"}}
    removed, states = [], [first]
    for patch in special_bodies(change, read, lambda: states[-1], Values(), lambda _: True):
        if not fits(taken, patch):
            continue
        states.append(merged(states[-1], patch))
        before, state = states[-2:]
        if "scene" in before["lights"] and patch.get("lights", {}).get("scene", "") is None:
            removed.append(before["lights"]["level"] != state["lights"]["level"])
    assert removed == [True]
    assert states[-1] == first


def test_null_is_written_where_every_response_may_have_it(tmp_path):
    text = {"type": ["string", "null"]}
    taken = object_of(name={"type": "string"}, note=text)
    body, responses = body_of(taken), {"200": answers({**taken, "required": ["name", "note"]})}
    paths = {"/settings": {"get": {"responses": responses}, "patch": {"requestBody": body, "responses": responses}}}
    contract = Contract.load(write_described_pack(tmp_path, document := described(paths, "3.1.0"), document))
    read, change = sorted(operations_of(contract), key=lambda operation: operation.method)
    bodies = special_bodies(change, read, lambda: {"name": "north", "note": "a"}, Values(), lambda _: True)
    assert [one for one in bodies if None in one.values()] == [{"note": None}]


def test_a_body_with_one_object_around_its_values_is_sent_with_other_values_in_it(tmp_path):
    taken = object_of(values=object_of(name={"type": "string"}, level={"type": "integer"}))
    shown = object_of(id={"type": "string"}, values=taken["properties"]["values"])
    body, responses = body_of(taken), {"200": answers(shown)}
    paths = {"/settings": {"get": {"responses": responses}, "put": {"requestBody": body, "responses": responses}}}
    contract = Contract.load(write_described_pack(tmp_path, document := described(paths, "3.1.0"), document))
    read, change = sorted(operations_of(contract), key=lambda operation: operation.method)
    now = {"values": {"name": "north", "level": 40}}
    bodies = [one for one in special_bodies(change, read, lambda: now, Values(), lambda _: True) if fits(taken, one)]
    assert bodies[-1] == now
    assert {"north", 40}.isdisjoint(bodies[0]["values"].values())


def test_two_fractions_of_a_number_are_written(tmp_path):
    taken = object_of(hold={"type": "number", "multipleOf": 0.01, "maximum": 600})
    body, responses = body_of(taken), {"200": answers(taken)}
    paths = {"/settings": {"get": {"responses": responses}, "put": {"requestBody": body, "responses": responses}}}
    contract = Contract.load(write_described_pack(tmp_path, document := described(paths, "3.1.0"), document))
    read, change = sorted(operations_of(contract), key=lambda operation: operation.method)
    bodies = [*special_bodies(change, read, lambda: {"hold": 300}, Values(), lambda _: True)]
    assert len({one["hold"] % 1 for one in bodies if fits(taken, one)} - {0}) == 2
