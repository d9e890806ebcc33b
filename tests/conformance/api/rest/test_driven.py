"""By which values a run has named what it may have moved, and how a stop names them again."""

import pytest
from small_device import contract_of, described

from conformance.api.rest.driven import Driven
from conformance.documents.openapi import operations_of
from conformance.transport.exchange import Exchange, Request, Response

_BASE = "http://robot/api"


def _parameter(name, where, kind="string"):
    return {"name": name, "in": where, "required": True, "schema": {"type": kind}}


def _operation(*parameters, body=None, **members):
    content = {"content": {"application/json": {"schema": body}}}
    asked = {"requestBody": content} if body else {}
    return {"post": {"parameters": list(parameters), "responses": {"200": {"description": "ok"}}, **asked, **members}}


def _driven(folder, stop, path):
    axis = {"type": "object", "properties": {"axis": {"type": "integer"}}, "required": ["axis"]}
    document = described(
        {
            "/arms/{arm}/speed": _operation(_parameter("arm", "path")),
            "/axes/{axis}/jog": _operation(_parameter("axis", "path", "integer")),
            "/jog": _operation(_parameter("axis", "query", "integer")),
            "/turn": _operation(body=axis),
            path: stop | {"post": stop["post"] | {"x-roaas-stop": True}},
        }
    )
    contract = contract_of(folder, document)
    operation = next(one for one in operations_of(contract) if one.stop)
    return Driven(contract, _BASE), operation


def _stops(driven, operation):
    return [value for ((_, _, value),) in driven.named_by(operation)]


_AXIS = {"type": "object", "required": ["axis"], "properties": {"axis": {"type": "integer"}}}
CASES = (
    # path of the stop, the stop, what was sent, the values that stop it
    ("/arms/{arm}/stop", _operation(_parameter("arm", "path")), ["/arms/left/speed", "/arms/right%20one/speed"],
     ["right one", "left"]),
    ("/arms/{id}/stop", _operation(_parameter("id", "path")), ["/arms/left/speed"], ["left"]),
    ("/axes/{axis}/stop", _operation(_parameter("axis", "path", "integer")), ["/axes/3/jog", "/axes/x/jog"], [3]),
    ("/stop", _operation(_parameter("axis", "query", "integer")), ["/jog?axis=2", "/jog?axis=7"], [7, 2]),
    ("/stop", _operation(body=_AXIS), ["/axes/4/jog", ("/turn", b'{"axis": 5}')], [5, 4]),
    ("/stop", _operation(), ["/axes/4/jog"], []),
    ("/cells/{cell}/stop", _operation(_parameter("cell", "path")), ["/arms/left/speed"], []),
)  # fmt: skip


@pytest.mark.parametrize(("path", "stop", "sent", "stops"), CASES)
def test_a_stop_names_all_that_was_moved(path, stop, sent, stops, tmp_path):
    driven, operation = _driven(tmp_path, stop, path)
    for one in sent:
        target, body = (one, b"") if isinstance(one, str) else one
        driven.sends("POST", _BASE + target)
        request = Request("POST", _BASE + target, (("Content-Type", "application/json"),), body)
        driven.on_response(Exchange(request, Response(200, (), b"", 1.0)))
    assert _stops(driven, operation) == stops


def test_what_was_refused_is_stopped_last_and_what_was_not_answered_is(tmp_path):
    driven, operation = _driven(tmp_path, _operation(_parameter("arm", "path")), "/arms/{arm}/stop")
    for arm, status in (("lost", None), ("taken", 200), ("unknown", 404), ("taken", 409), ("broken", 500)):
        request = Request("POST", f"{_BASE}/arms/{arm}/speed")
        driven.sends(request.method, request.url)
        if status is not None:
            driven.on_response(Exchange(request, Response(status, (), b"", 1.0)))
    driven.sends("GET", f"{_BASE}/arms/read/speed")
    driven.sends("POST", f"{_BASE}/arms/stopped/stop")
    assert {*_stops(driven, operation)} == {"lost", "taken", "broken"}
    with_refused = driven.named_by(operation, refused=True)
    assert [value for ((_, _, value),) in with_refused] == ["unknown", "broken", "taken", "lost"]


def test_thousands_of_values_cost_a_bounded_number_of_stops(tmp_path):
    driven, operation = _driven(tmp_path, _operation(_parameter("arm", "path")), "/arms/{arm}/stop")
    driven.on_response(Exchange(Request("POST", f"{_BASE}/arms/real/speed"), Response(200, (), b"", 1.0)))
    for number in range(2000):
        driven.sends("POST", f"{_BASE}/arms/made-up-{number}/speed")
    found = _stops(driven, operation)
    assert len(found) <= 64
    assert "real" in found
