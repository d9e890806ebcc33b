from pathlib import Path

import pytest

from conformance.contract.locating import ContractError
from conformance.contract.pack import Contract
from conformance.documents.openapi import known_path, matching, operations_of, resources_of

LIBRARY = Contract.load(Path(__file__).parent.parent / "data" / "library-contract")


def test_operations_of_the_robot():
    operations = {item.id: item for item in operations_of(Contract.load())}
    put = operations["putVelocity"]
    assert (put.method, put.template, put.motion, put.body_required) == ("PUT", "/robot/velocity/", True, True)
    assert set(put.bodies) == {"application/json", "application/xml"}
    assert put.bodies["application/json"].examples[0]["linear"]["x"] == 0.1
    assert operations["getDeliveries"].optional
    assert not operations["getPose"].motion
    assert operations["getPose"].formats == ("application/json", "application/xml", "text/plain")
    assert operations["getPose"].schemas_for(200)
    assert operations["getPose"].schemas_for(404) is None
    assert operations["putDelivery"].schemas_for(204) == {}


def test_a_foreign_contract_moves_unless_it_says_otherwise():
    motion = {item.id: item.motion for item in operations_of(LIBRARY)}
    assert motion == {"listBooks": False, "getBook": False, "putBook": False, "deleteBook": True, "getHours": False}


def test_parameters_of_the_path_belong_to_each_operation():
    book = next(item for item in operations_of(LIBRARY) if item.id == "deleteBook")
    assert [(item.name, item.where, item.required) for item in book.parameters] == [("isbn", "path", True)]


def test_a_literal_path_wins_over_a_template():
    assert matching(LIBRARY, "GET", "/books/").id == "listBooks"
    assert matching(LIBRARY, "PUT", "/books/") is None
    assert matching(LIBRARY, "HEAD", "/books/5").id == "getBook"
    assert not known_path(LIBRARY, "/books")
    assert {item.template: sorted(item.methods) for item in resources_of(LIBRARY)}["/books/"] == ["GET", "HEAD"]


def test_a_reference_that_leads_nowhere_is_named(tmp_path):
    (tmp_path / "openapi.yaml").write_text(
        "openapi: 3.1.0\npaths: {/a: {get: {responses: {'200': {$ref: '#/components/responses/Gone'}}}}}\n"
    )
    with pytest.raises(ContractError, match="Gone"):
        operations_of(Contract.load(tmp_path))
