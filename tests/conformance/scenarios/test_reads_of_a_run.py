"""Which reads a run sends to a device: none twice that is judged in the same way, and each often enough."""

import pytest
from small_device import certified, constant, described, reading, small_device

from conformance.api.rest.inputs import Inputs
from conformance.api.rest.values import Values
from conformance.documents.openapi import Operation
from conformance.documents.parameters import Parameter
from conformance.history.events import Sent, read_history
from conformance.history.writing import HISTORY_NAME
from conformance.scenarios.drawing import draw_requests
from conformance.verdict.effort import Effort

_OPERATIONS = {
    "/none": {},
    "/number": {"type": "integer", "minimum": 0, "maximum": 100},
    "/text": {"type": "string", "maxLength": 8},
    "/choice": {"type": "string", "enum": ["near", "far"]},
}


@pytest.fixture(scope="module")
def sent(tmp_path_factory):
    out = tmp_path_factory.mktemp("reads")
    paths = {path: reading({"type": "object"}) for path in _OPERATIONS}
    for path, schema in _OPERATIONS.items():
        paths[path]["get"]["parameters"] = [{"name": "q", "in": "query", "schema": schema}] if schema else []
    with small_device(described(paths), {path: constant({"v": 1}) for path in paths}) as url:
        certified(f"{url}/openapi.json", out)
    events = [one for one in read_history(out / HISTORY_NAME) if isinstance(one, Sent)]
    return [(one.span, one.method, one.url.removeprefix(url)) for one in events]


@pytest.mark.parametrize("path", _OPERATIONS)
def test_no_value_is_generated_that_the_survey_has_sent_as_allowed_or_forbidden(sent, path):
    own = [one for one in sent if one[2].partition("?")[0] == path]
    generated = [one[1:] for one in own if one[0].endswith("[generated_requests]")]
    assert bool(generated) is (path != "/none")
    assert {method for method, _ in generated} <= {"GET"}
    assert not {url for _, url in generated} & {f"{path}?q=100", f"{path}?q=101", f"{path}?q=near"}


@pytest.mark.parametrize("schema", [{"type": "integer", "minimum": 0, "maximum": 100}, {"type": "number"}, {}])
def test_no_odd_value_is_sent_that_was_sent_as_allowed_or_forbidden(schema):
    operation = Operation("", "GET", "/a", (Parameter("q", "query", schema=schema, required=False),))
    usual, values = Inputs(), Values()
    valid, invalid, odd = draw_requests(operation, usual, values, Effort("standard"), 1)
    assert odd
    assert not [one for one in odd if repr(one.inputs) in {repr(other.inputs) for other in (*valid, *invalid)}]


@pytest.mark.parametrize("path", _OPERATIONS)
def test_each_operation_is_read_so_often_that_one_wrong_response_in_twenty_is_met(sent, path):
    assert sum(method == "GET" and url.partition("?")[0] == path for _, method, url in sent) >= 20
