"""What a robot sends in place of preferred formats is one finding, with the values of Accept by which it shows."""

import pytest
from small_device import described

from conformance.api.rest.formats import are_data
from conformance.contract.described import write_described_pack
from conformance.contract.generic import generic_ledger
from conformance.contract.pack import Contract
from conformance.rules.rest_formats.test_formats_accept import Preferred, judge_preferred
from conformance.transport.exchange import Exchange, Request, Response
from conformance.verdict.evidence import Judge

_ID = "rest-formats/q-values"
_FORMATS = ("application/json", "application/xml", "text/plain")


def _got(accept: str, sent: str, status: int = 200) -> Preferred:
    request = Request("GET", "http://robot/pose", (("Accept", accept),), b"")
    return Preferred(_ID, _FORMATS, accept, Exchange(request, Response(status, (("Content-Type", sent),), b"", 1.0)))


@pytest.mark.parametrize(("sent", "findings"), [("application/json", 1), ("application/xml", 0)])
def test_a_robot_that_ignores_quality_values_has_one_finding_with_all_values(sent, findings):
    accepts = [f"application/json;q=0.{digit}, application/xml;q=0.9{digit}" for digit in range(1, 9)]
    judge = Judge(generic_ledger())
    judge_preferred(judge, [_got(accept, sent) for accept in accepts])
    found = list(judge.evidence[_ID].findings.values())
    assert (len(found), judge.evidence[_ID].cases) == (findings, 8)
    for finding in found:
        assert "application/xml when Accept is application/json;q=0.1" in finding.expected
        assert "7 more values of Accept" in finding.expected
        assert all(accept in finding.expected for accept in accepts)


def test_other_formats_in_place_of_the_preferred_one_are_other_findings():
    wrong = [
        _got("application/xml", "application/json"),
        _got("text/plain", "application/xml"),
        _got("image/png", "", 200),
    ]
    judge = Judge(generic_ledger())
    judge_preferred(judge, [*wrong, _got("image/png", "", 406), _got("*/*", "text/plain")])
    assert (len(judge.evidence[_ID].findings), judge.evidence[_ID].failures) == (3, 3)


@pytest.mark.parametrize(
    ("formats", "data"),
    [
        (("application/json", "application/xml"), True),
        (("application/hal+json", "application/yaml"), True),
        (("application/json", "text/csv"), False),
        (("text/plain", "image/svg+xml"), False),
        (("application/json",), False),
    ],
)
def test_formats_of_one_value(formats, data):
    assert are_data(formats) == data


@pytest.mark.parametrize(
    ("path", "formats", "claims"),
    [
        ("/log", ("application/json", "text/csv"), True),
        ("/logs/{id}", ("application/json", "text/csv"), False),
        ("/logs/{id}", ("application/json", "application/xml"), True),
        ("/log", ("application/json",), False),
    ],
)
def test_formats_are_claimed_where_they_can_be_read(path, formats, claims, tmp_path):
    answer = {"description": "", "content": {name: {"schema": {}} for name in formats}}
    document = described({path: {"get": {"responses": {"200": answer}}}})
    folder = write_described_pack(tmp_path / "pack", document, document)
    assert ("rest-formats" in Contract.load(folder).classes) == claims
