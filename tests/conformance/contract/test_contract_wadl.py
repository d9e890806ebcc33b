"""The contract's two descriptions of REST name the same resources, methods and parameters."""

from __future__ import annotations

from conformance.contract.files import Contract
from conformance.documents.openapi import operations_of
from conformance.documents.rest_description import Described, described_by_wadl, differences

CONTRACT = Contract.load()


def test_openapi_and_wadl_agree():
    wadl = described_by_wadl(CONTRACT.wadl_path.read_bytes(), "http://127.0.0.1:7003")
    openapi = [Described.of(item) for item in operations_of(CONTRACT)]
    assert differences(operations_of(CONTRACT), wadl) == []
    assert {(item.method, item.path, item.parameters) for item in wadl} == {
        (item.method, item.path, item.parameters) for item in openapi
    }
