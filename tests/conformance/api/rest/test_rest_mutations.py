import pytest

from conformance.api.rest.body_mutations import KINDS, is_invalid, mutations, near_misses, xml_mutations
from conformance.api.rest.parameters import wrong_texts
from conformance.api.rest.samples import sample
from conformance.contract.pack import Contract
from conformance.documents.json_shape import shape_of
from conformance.documents.openapi import operations_of
from conformance.documents.writing import json_text, xml_bytes

TAKING = [item for item in operations_of(Contract.load()) if item.bodies]
# Not every body has bounds.
EVERYWHERE = {*KINDS} - {"bounds"}


@pytest.mark.parametrize("operation", TAKING, ids=lambda item: item.id)
def test_every_mutation_is_invalid_and_every_kind_is_there(operation):
    body = operation.bodies["application/json"]
    made = mutations(body.examples[0], body.schema)
    assert {item.kind for item in made} >= EVERYWHERE
    assert all(is_invalid(item.made, body.schema) for item in made)
    assert len({item.made for item in made}) > 0.9 * len(made)


@pytest.mark.parametrize("operation", TAKING, ids=lambda item: item.id)
def test_the_examples_themselves_are_valid(operation):
    body = operation.bodies["application/json"]
    for value in body.examples:
        assert not is_invalid(json_text(value).encode(), body.schema)


def test_bounds_of_optional_fields_are_broken_too():
    body = next(item for item in TAKING if item.id == "putGoal").bodies["application/json"]
    names = [item.what for item in mutations(body.examples[0], body.schema) if item.kind == "bounds"]
    assert "a text too long at goal_id.id" in names
    assert any("nanosec" in name for name in names)


def test_xml_mutations_are_invalid_and_the_plain_form_is_not_among_them():
    body = TAKING[0].bodies["application/json"]
    value = body.examples[0]
    made = {item.what: item.made for item in xml_mutations(value, body.schema, "Twist")}
    assert len(made) > 50
    assert xml_bytes(value, "Twist") not in made.values()
    assert b"<x>NaN</x>" in made["'NaN' at linear.x"]


@pytest.mark.parametrize("operation", TAKING, ids=lambda item: item.id)
def test_sample_values_are_valid(operation):
    schema = operation.bodies["application/json"].schema
    assert not shape_of(schema).problem(sample(schema))


def test_wrong_texts_of_numbers_and_codes():
    delivery = next(item for item in operations_of(Contract.load()) if item.id == "putDelivery")
    by_name = {item.name: {wrong.text for wrong in wrong_texts(item)} for item in delivery.parameters}
    assert {"5", "2", "3.5", "NaN", ""} <= by_name["code"]
    assert {"Infinity", "1e400", "abc"} <= by_name["depot_x"]
    assert "3" not in by_name["code"]
    plan = next(item for item in operations_of(Contract.load()) if item.id == "getPlan")
    texts = {item.name: [wrong.text for wrong in wrong_texts(item)] for item in plan.parameters}
    assert texts["frame_id"] == []
    assert "-1" in texts["tolerance"]


def test_near_misses_hold_what_the_valid_body_asks_for():
    body = next(item for item in TAKING if item.id == "putVelocity").bodies["application/json"]
    made = near_misses(body.examples[0], body.schema, ("linear", "x"))
    names = {item.what for item in made}
    wanted = {"a body cut short", "an array as root", "NaN at linear.x", "x missing at linear"}
    assert names >= wanted | {"linear twice at the body"}
    assert not names & {"no bytes", "null as root", "null at angular.z"}
    assert all(is_invalid(item.made, body.schema) for item in made)
