"""The contract's two descriptions of REST name the same resources, methods and parameters."""

from conformance.api.rest.description import described_by_wadl, differences
from conformance.contract.pack import Contract
from conformance.documents.openapi import operations_of

CONTRACT = Contract.load()


def test_openapi_and_wadl_agree():
    wadl = described_by_wadl(CONTRACT.wadl_path.read_bytes(), "http://127.0.0.1:7003")

    def seen(item):
        return item.method, item.template, frozenset((one.where, one.name, one.required) for one in item.parameters)

    assert differences(operations_of(CONTRACT), wadl) == []
    assert {seen(item.operation) for item in wadl} == {seen(item) for item in operations_of(CONTRACT)}
