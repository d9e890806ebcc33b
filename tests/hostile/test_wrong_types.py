"""A member of another type in a description leaves out what it is in, with its place, and is no fault of the suite."""

import json
import re
from pathlib import Path
from typing import Any

import pytest
from wrong_types import OPENAPI, SWAGGER, WRONG, places, with_wrong

from conformance.documents.description import DescriptionError
from conformance.documents.description_faults import invalid, repeated_ids, unfitting_examples
from conformance.documents.openapi import operations_of
from conformance.statement.endpoints import Endpoints
from conformance.target.describing import described_contract
from conformance.transport.client import Connection

_PYTHON = re.compile(r"\w+Error\b|NoneType|object (?:is|has) no|roaas-lazy|is not local|not subscriptable|not iterable")


def _said_of(document: dict[str, Any], folder: Path) -> tuple[str, ...]:
    """Read a description as a run does; return what is said of it."""
    (folder / "given.json").write_text(json.dumps(document), encoding="utf-8")
    try:
        contract, _, said = described_contract(
            str(folder / "given.json"), (), "http://127.0.0.1:1", Endpoints(), Connection(), folder
        )
    except DescriptionError as error:
        return (str(error),)
    assert operations_of(contract) is not None
    for faults in (invalid, repeated_ids, unfitting_examples):
        faults(document)
    return said


@pytest.mark.parametrize("document", [OPENAPI, SWAGGER], ids=["OpenAPI", "Swagger"])
def test_a_member_of_another_type_is_told_in_the_words_of_the_description(document, tmp_path):
    assert _said_of(document, tmp_path) == ()
    for number, place in enumerate(places(document)):
        wrong = WRONG[number % len(WRONG)]
        said = "\n".join(_said_of(with_wrong(document, place, wrong), tmp_path))
        assert not _PYTHON.search(said), (place, wrong, said)


_GET, _POST = ("paths", "/parts/{id}", "get"), ("paths", "/parts/{id}", "post")
_X = ("components", "parameters", "X")
CASES = (
    # the place, what stands there, what is said
    ((*_GET, "parameters"), 5, "GET /parts/{id}: not judged: at /paths/~1parts~1{id}/get/parameters: 5 is not of type"),
    ((*_POST, "requestBody", "content"), ["x"], '/post/requestBody/content: ["x"] is not of type "object"'),
    (_X, None, 'at /components/parameters/X: null is not of type "object"'),
    ((*_GET, "parameters", 0, "content", "application/json", "schema"), 5, "it is no JSON Schema"),
    (_X, {"$ref": "#/components/parameters/X"}, "or leads back to itself"),
)  # fmt: skip


@pytest.mark.parametrize(("place", "wrong", "said"), CASES)
def test_the_place_of_a_wrong_type_is_named(place, wrong, said, tmp_path):
    assert said in "\n".join(_said_of(with_wrong(OPENAPI, place, wrong), tmp_path))


def test_a_callback_that_leads_back_to_its_own_path_leaves_nothing_out(tmp_path):
    ring = {"{$request.body#/url}": {"$ref": "#/paths/~1parts~1{id}"}}
    document = with_wrong(OPENAPI, ("paths", "/parts/{id}", "post", "callbacks", "done"), ring)
    assert _said_of(document, tmp_path) == ()
