"""The contract's two descriptions of REST name the same resources, methods and parameters."""

from __future__ import annotations

from conformance.contract.files import Contract
from conformance.http.described import Described, described_by_wadl, differences
from conformance.http.operations import operations_of

CONTRACT = Contract.load()


def test_openapi_and_wadl_agree():
    wadl = described_by_wadl(CONTRACT.wadl_path.read_bytes(), "http://127.0.0.1:7003")
    openapi = [Described.of(item) for item in operations_of(CONTRACT)]
    assert differences(operations_of(CONTRACT), wadl) == []
    assert {(item.method, item.path, item.parameters) for item in wadl} == {
        (item.method, item.path, item.parameters) for item in openapi
    }
