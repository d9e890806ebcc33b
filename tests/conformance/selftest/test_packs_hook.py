"""What a pack says for its self-test is found and used; of a pack that says little, the defaults do."""

from pathlib import Path

import pytest
from taking_robot import sent_by

from conformance.contract.classes import Interface
from conformance.contract.locating import ContractError
from conformance.contract.pack import Contract
from proof.mutation.messages import Request
from proof.mutation.self_test import GoodDevice, OpenPlace, SelfTest, self_test_of
from proof.selftest.controls import controls_of, variants_of
from proof.selftest.generated.catalogue import generated_mutants
from proof.selftest.generated.mutant import Tally
from proof.selftest.generated.places import classes_of, places
from proof.table1.selftest import BAROQUE, PLAIN

LAMP = Contract.load(Path(__file__).parents[3] / "examples" / "lamp")
OPENAPI = """
openapi: 3.1.0
info: {title: Door, version: "1"}
paths:
  /doors/{door-id}:
    put:
      operationId: putDoor
      parameters: [{name: door-id, in: path, required: true, schema: {type: integer}}]
      requestBody:
        content:
          application/json:
            schema:
              allOf:
                - type: object
                  required: [open, label]
                  properties: {open: {type: boolean}, label: {type: string}}
            example: {open: true, label: front}
      responses: {2XX: {description: done}}
"""

MANIFEST = """
name = "door"
version = "1"
title = "Door"
[[class]]
name = "http"
[[class]]
name = "strict-input"
"""


def pack(folder, **files):
    (folder / "openapi.yaml").write_text(OPENAPI)
    (folder / "pack.toml").write_text(MANIFEST)
    for name, text in files.items():
        (folder / name.replace("__", ".")).write_text(text)
    return Contract.load(folder)


@pytest.fixture
def door(tmp_path):
    return pack(tmp_path)


def mutant(contract, name):
    return next(one for one in generated_mutants(contract) if one.name == name)


def sent(contract, name, request):
    return sent_by(mutant(contract, name).make(Tally()), request)


def test_a_pack_without_a_hook_has_mutants_by_rule_alone(door):
    assert self_test_of(door) == SelfTest()
    assert {place.medium for place in places(door)} == {"json", "path"}
    names = {one.name for one in generated_mutants(door)}
    assert {"status:putDoor:204-500", "default:putDoor:request.open:json", "fill:putDoor:request.label:json"} <= names


def test_parameters_may_have_any_name(door):
    altered = sent(door, "scale:putDoor:request.door-id:path", Request("rest", "PUT", "/doors/4"))
    assert altered.target == "/doors/6"


def test_a_missing_text_is_filled_by_the_descriptions_example(door):
    json = [("Content-Type", "application/json")]
    request = Request("rest", "PUT", "/doors/4", "HTTP/1.1", json, b'{"open": false}')
    assert sent(door, "fill:putDoor:request.label:json", request).body == b'{"open": false, "label": "front"}'


def test_a_hook_is_read_from_the_packs_folder(tmp_path):
    source = "from proof.mutation.self_test import *\nSELFTEST = SelfTest(classes={'put.*': ('doors',)})\n"
    assert classes_of(pack(tmp_path, selftest__py=source), "putDoor", Interface.REST) == ("doors",)


@pytest.mark.parametrize("source", ["SELFTEST = 1", "x = 1", "import no_such_module", "def"])
def test_a_hook_that_cannot_be_used_is_named(tmp_path, source):
    with pytest.raises(ContractError, match=r"selftest\.py"):
        self_test_of(pack(tmp_path, selftest__py=source))


def test_classes_are_the_packs_own_unless_it_says_more():
    table1, lamp = Contract.load(), LAMP
    assert classes_of(lamp, "putLamp", Interface.REST) == ("lamp",)
    assert classes_of(table1, "putVelocity", Interface.REST) == ("rest-resources", "equivalence", "safety")
    assert classes_of(table1, "GetVelocity", Interface.SUBSCRIBERS) == ("soap-subscribers", "equivalence")


def test_an_open_place_is_of_its_side_and_methods():
    place = OpenPlace(r"header-drop:\w+:Vary", "a reason", side="rest", methods=("PUT",))
    assert place.covers("header-drop:putDoor:Vary", "rest", "PUT")
    assert not place.covers("header-drop:putDoor:Vary", "soap", "PUT")
    assert not place.covers("header-drop:putDoor:Vary", "rest", "GET")
    assert not place.covers("header-drop:putDoor:Vary:more", "rest", "PUT")


def test_the_device_in_a_variant_is_the_quick_one_unless_the_pack_says_more():
    needs = self_test_of(Contract.load())
    assert (needs.device_in("tls"), needs.device_in("slow")) == (BAROQUE, PLAIN)
    only = GoodDevice("door", lambda _: [])
    assert SelfTest(devices=(only,)).device_in("slow") is only


def test_controls_are_every_device_with_every_seed_and_once_in_every_variant(monkeypatch):
    contract = Contract.load()
    monkeypatch.setattr("proof.selftest.robots.find_spec", lambda _: None)
    controls = controls_of(contract, 2, short=False, variants=True)
    tried = {(case.device.name, case.seed) for case in controls.cases if case.variant is None}
    assert {("plain", 1), ("legacy", 0), ("node", 0)} <= tried
    assert ("node", 1) not in tried
    assert not any(case.device.on_ros for case in controls.cases)
    assert len(controls.missing) == sum(device.on_ros for device in self_test_of(contract).devices)
    assert {"tls", "behind"} <= {variant.name for variant in variants_of(contract)}
    assert "behind" not in {variant.name for variant in variants_of(LAMP)}
