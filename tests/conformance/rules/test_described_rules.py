"""The rules of the classes `description` and `robustness` by traces made by hand: right devices, and one fault each."""

import json
from dataclasses import replace

import pytest
from small_device import contract_of, object_of

from conformance.api.rest.conversions import is_converted
from conformance.api.rest.invalid_variations import NO_OBJECT
from conformance.api.rest.variations import WIDE, Kind
from conformance.documents.json_shape import shape_of
from conformance.rules.description import test_answers as answers
from conformance.rules.description import test_requests as requests
from conformance.rules.robustness import test_robustness as robustness
from conformance.scenarios.rule import NotSeen
from conformance.scenarios.survey import Probe, Survey
from conformance.transport.exchange import Exchange, NoAnswer, Request, Response, Unanswered
from conformance.verdict.run import Run

_SCHEMA = object_of("n", n={"type": "integer"}, at={"type": ["string", "null"], "format": "date-time"})
_ERROR = {"description": "", "content": {"application/problem+json": {"schema": {"required": ["detail"]}}}}
_LEAST = Kind.USUAL, Kind.GENERATED
_LABEL, _OTHER, _PLAIN = "GET /a/{id}", "POST /b", "GET /c"


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    well = {
        "description": "",
        "content": {"application/json": {"schema": _SCHEMA}},
        "headers": {"X-N": {"required": True, "schema": {"type": "integer"}}},
    }
    parameters = [{"name": "id", "in": "path", "required": True, "schema": {"type": "integer"}}]
    paths = {
        "/a/{id}": {"get": {"parameters": parameters, "responses": {"200": well, "404": _ERROR}}},
        "/b": {
            "post": {
                "requestBody": {"content": {"application/json": {"schema": _SCHEMA}}},
                "responses": {"2XX": {"description": ""}, "404": _ERROR},
            },
            "put": {"requestBody": {"content": {"application/json": {"schema": _SCHEMA}}}, "responses": {}},
        },
        "/c": {
            "get": {"responses": {"200": {"description": ""}}},
            "put": {
                "requestBody": {"content": {"application/json": {"schema": _SCHEMA}}},
                "responses": {"200": well, "400": _ERROR},
            },
        },
    }
    document = {"openapi": "3.1.0", "info": {"title": "t", "version": "1"}, "paths": paths}
    return Run(contract=contract_of(tmp_path_factory.mktemp("pack"), document))


def _probe(
    status=200,
    body=None,
    kind=Kind.USUAL,
    *,
    operation=_LABEL,
    media_type="application/json",
    x_n="1",
    sent=b"",
    **more,
):
    method = operation.split()[0]
    content = json.dumps({"n": 1} if body is None else body).encode() if not isinstance(body, bytes) else body
    fields = (("Content-Type", media_type), *((("X-N", x_n),) if x_n else ()))
    headers = (("Content-Type", "application/json"),) if sent else ()
    target = operation.split()[1].replace("{id}", "1")
    request = Request(method, f"http://h{target}", headers, sent)
    return Probe(operation, kind, exchange=Exchange(request, Response(status, fields, content, 1.0)), **more)


def _conditional(probe, name="If-None-Match", value='"a"'):
    request = replace(probe.exchange.request, headers=((name, value),))
    return replace(probe, exchange=replace(probe.exchange, request=request))


def _silent(kind_of_silence, kind=Kind.ODD, operation=_LABEL):
    unanswered = Unanswered(Request("GET", "http://h/a/1", (), b""), "nothing came", kind_of_silence)
    return Probe(operation, kind, unanswered=unanswered)


def _took(ms):
    return replace(_OK.exchange, response=replace(_OK.exchange.response, elapsed_ms=ms))


def _page(status=404, **more):
    return _probe(status, b"<html>", media_type="text/html", x_n="", **more)


def _multipart(body):
    probe = _probe(400, {"detail": ""}, kind=Kind.GENERATED, operation=_OTHER, **_PROBLEM)
    request = replace(probe.exchange.request, headers=(("Content-Type", "multipart/form-data; boundary=b"),), body=body)
    return replace(probe, exchange=replace(probe.exchange, request=request))


_PROBLEM = {"media_type": "application/problem+json", "x_n": ""}
_OK = _probe()
_RIGHT = [
    _OK,
    _probe(404, {"detail": ""}, Kind.UNKNOWN, **_PROBLEM),
    _probe(body={"n": 1, "at": "2026-01-31T12:00:00Z", "more": 1}),
    _probe(body={"n": 1, "at": None}),
    _conditional(_probe(304, b"")),
    _conditional(_probe(206), "Range", "bytes=0-"),
    _probe(401, b"", x_n=""),
    _probe(429, b"", x_n=""),
    _page(400, kind=Kind.ODD),
    _page(403, kind=Kind.GENERATED),
    _multipart(b"--b\r\nx--b--"),
    _page(404, kind=Kind.ODD, place="path id", operation=_PLAIN),
    _probe(422, {"detail": ""}, kind=Kind.GENERATED, invents=True, **_PROBLEM),
    _page(414, kind=Kind.ODD),
    _page(405, kind=Kind.ODD),
    _probe(201, b"", operation=_OTHER, sent=b'{"n": 1}'),
    _probe(404, {"detail": ""}, operation=_OTHER, **_PROBLEM),
    _probe(200, operation=_PLAIN, kind=Kind.AGAIN),
    _silent(NoAnswer.CIRCUIT_OPEN),
    _silent(NoAnswer.TIMEOUT, operation="GET /events"),
]
_ALL = [
    answers.status_declared, answers.errors_declared, answers.media_type, answers.body_schema, answers.formats,
    answers.headers,
    requests.operations, requests.invalid_refused, requests.types, requests.required, requests.optional, requests.enums,
    requests.examples, requests.defaults, requests.valid_accepted, robustness.no_crash, robustness.no_hang,
    robustness.recovers,
]  # fmt: skip


def _failed(rule, trace, run):
    return [one for one in rule.outcomes(trace, {"run": run}.__getitem__) if not getattr(one, "holds", True)]


@pytest.mark.parametrize("rule", _ALL, ids=lambda rule: rule.requirement)
def test_a_right_device_is_not_blamed(rule, run):
    assert _failed(rule, Survey(tuple(_RIGHT)), run) == []


@pytest.mark.parametrize(
    ("rule", "probes"),
    [
        (answers.status_declared, [_probe(409)]),
        (answers.status_declared, [_probe(206)]),
        (answers.status_declared, [_probe(304, b"")]),
        (answers.status_declared, [_probe(403)]),
        (answers.status_declared, [_probe(403, kind=Kind.GENERATED)]),
        (answers.errors_declared, [_multipart(b"--b\r\nContent-Disposition: form-data; name=a\r\n\r\nx\r\n--b--")]),
        (answers.status_declared, [_probe(428)]),
        (answers.errors_declared, [_probe(422, kind=Kind.GENERATED)]),
        (answers.status_declared, [_probe(503, kind=Kind.ODD)]),
        (answers.errors_declared, [_probe(400, kind=Kind.ODD)]),
        (answers.errors_declared, [_page(400, kind=Kind.INVALID)]),
        (answers.errors_declared, [_probe(400)]),
        (answers.errors_declared, [_probe(410)]),
        (answers.media_type, [_page(200)]),
        (answers.media_type, [_page(404, kind=Kind.UNKNOWN)]),
        (answers.body_schema, [_probe(body={})]),
        (answers.body_schema, [_probe(body={"n": 1.5})]),
        (answers.body_schema, [_probe(body=b"{")]),
        (answers.body_schema, [_probe(body=b"")]),
        (answers.body_schema, [_probe(404, {}, **_PROBLEM)]),
        (answers.formats, [_probe(body={"n": 1, "at": "2026-01-31T12:00:00"})]),
        (answers.headers, [_probe(x_n="")]),
        (answers.headers, [_probe(x_n="one")]),
        (requests.operations, [_page(operation=_PLAIN)]),
        (requests.operations, [_page(405, operation=_PLAIN)]),
        (requests.invalid_refused, [_probe(kind=Kind.INVALID)]),
        (requests.invalid_refused, [_probe(kind=Kind.GENERATED, validity="invalid", why="'x' at n")]),
        (requests.invalid_refused, [_probe(kind=Kind.GENERATED, validity="invalid", why="'x' at header X-Lane")]),
        (requests.required, [_probe(kind=Kind.MISSING)]),
        (requests.optional, [_probe(422, operation=_PLAIN), _probe(operation=_PLAIN, kind=Kind.OPTIONAL)]),
        (requests.enums, [_OK, _probe(422, kind=Kind.ENUM)]),
        (requests.examples, [_probe(400, kind=Kind.EXAMPLE)]),
        (requests.defaults, [_OK, _probe(422, kind=Kind.DEFAULT)]),
        (requests.valid_accepted, [_OK, _probe(400, kind=Kind.BOUND)]),
        (requests.valid_accepted, [_OK, _probe(400, kind=Kind.GENERATED, validity="valid")]),
        (robustness.no_crash, [_silent(NoAnswer.CLOSED)]),
        (robustness.no_hang, [_silent(NoAnswer.TIMEOUT)]),
        (robustness.no_hang, [_OK, _silent(NoAnswer.TIMEOUT)]),
        (robustness.recovers, [_OK, _silent(NoAnswer.CLOSED, Kind.AGAIN)]),
        (robustness.recovers, [_OK, _probe(500, kind=Kind.AGAIN)]),
    ],
)  # fmt: skip
def test_a_fault_is_one_finding(rule, probes, run):
    assert len(_failed(rule, Survey((*_RIGHT[1:], *probes)), run)) == 1


@pytest.mark.parametrize(
    ("rule", "probes"),
    [
        (answers.status_declared, [_page(404, operation=_PLAIN)]),
        (answers.status_declared, [_probe(500)]),
        (answers.status_declared, [_probe(410)]),
        (answers.status_declared, [_probe(422)]),
        (answers.media_type, [_page(500)]),
        (requests.operations, [_page(404)]),
        (requests.operations, [_probe(404, {"detail": "no"}, operation=_OTHER, **_PROBLEM)]),
        (requests.enums, [_probe(422), _probe(422, kind=Kind.ENUM)]),
        (requests.optional, [_probe(422), _probe(422, kind=Kind.OPTIONAL)]),
        (requests.valid_accepted, [_probe(400, kind=Kind.GENERATED, validity="valid")]),
        *(
            (requests.valid_accepted, [_OK, _probe(400, kind=Kind.GENERATED, validity="valid", sent=sent)])
            for sent in (
                b'{"n": -1.7e308}',
                b'{"at": "0237-06-03T13:10:30Z"}',
                b'{"at": ""}',
                b'{"at": "a\\u0001"}',
                b'{"at": "\xc2\x80"}',
            )
        ),
        (requests.invalid_refused, [_probe(kind=Kind.GENERATED), _probe(kind=Kind.INVALID, validity="valid")]),
        (requests.required, [_probe(kind=Kind.MISSING, validity="valid")]),
        (requests.valid_accepted, [_OK, _probe(400, kind=Kind.BOUND, validity="invalid")]),
        *(
            (
                requests.invalid_refused,
                [_probe(kind=Kind.GENERATED, validity="invalid", why=f"'{{}}' at header {name}")],
            )
            for name in ("If-None-Match", "if-match", "Range", "Accept-Language", "Prefer")
        ),
        (robustness.recovers, [_probe(500), _probe(500, kind=Kind.AGAIN)]),
    ],
)
def test_what_another_rule_judges_is_not_told_twice(rule, probes, run):
    assert _failed(rule, Survey(tuple(probes)), run) == []


_PAIR = b'{"low": 400, "high": 200}'


@pytest.mark.parametrize(
    ("said", "seen"),
    [
        ("low must be less than high.", 0),
        ("Both low and high, or neither.", 0),
        ("low is wrong", 1),
        ("The values low and high are wrong", 1),
        ("low must be less than 100. high is 200", 1),
    ],
)
def test_values_that_must_fit_together_are_the_devices_own_rule(said, seen, run):
    refused = _probe(422, {"detail": said}, Kind.BOUND, operation=_OTHER, sent=_PAIR, place="body /low", **_PROBLEM)
    works = _probe(201, b"", operation=_OTHER, sent=b'{"low": 1, "high": 2}')
    assert len(_failed(requests.valid_accepted, Survey((works, refused)), run)) == seen


def test_what_operations_have_in_common_is_told_once(run):
    probes = [_page(418), _page(418, kind=Kind.INVALID, says="x"), _page(418, operation=_OTHER)]
    (finding,) = _failed(answers.status_declared, Survey(tuple(probes)), run)
    assert (finding.subject, finding.cause) == (_LABEL, "418") or finding.subject == _OTHER
    assert {one.operation: one.seen for one in finding.operations} == {_LABEL: 2, _OTHER: 1}


def test_types_that_a_framework_converts_are_told_once(run):
    at = {"n": 1, "at": 5}
    probes = [
        _probe(kind=Kind.GENERATED, operation=_OTHER, validity="invalid", why=shape_of(_SCHEMA).problem(one))
        for one in ({"n": "1"}, {"n": "2"}, {"n": True}, at)
    ]
    found = _failed(requests.invalid_refused, Survey(tuple(probes)), run)
    assert sorted(one.cause for one in found) == ["a boolean converted", "number ['string', 'null']", "string integer"]


_LENIENT = {
    "required": ["n"],
    "properties": {
        "n": {"type": "integer", "minimum": 0},
        "on": {"anyOf": [{"type": "boolean"}, {"type": "null"}]},
        "text": {"type": "string"},
        "set": {"type": "array", "uniqueItems": True, "items": {"type": "integer"}},
        "at": {"type": "string", "format": "date-time"},
        "in": object_of(x={"type": "number"}),
    },
}


@pytest.mark.parametrize(
    ("sent", "said", "is_same"),
    [
        ('{"n": "5"}', '{"n": 5}', True),
        ('{"n": "5"}', '{"data": {"n": 5}}', True),
        ('{"n": "5"}', '{"id": 1}', True),
        ('{"n": "5"}', "", True),
        ('{"n": "5"}', '{"n": "5"}', False),
        ('{"n": "5"}', '{"n": 0}', False),
        ('{"n": "5 mm"}', "", False),
        ('{"n": "-5"}', "", False),
        ('{"n": false}', '{"n": 0}', True),
        ('{"n": false}', '{"n": false}', False),
        ('{"n": null}', '{"n": 0}', False),
        ('{"n": 1, "on": 0}', '{"n": 1, "on": false}', True),
        ('{"n": 1, "on": "false"}', '{"n": 1, "on": false}', True),
        ('{"n": 1, "on": "false"}', '{"n": 1, "on": true}', False),
        ('{"n": 1, "on": 2}', '{"n": 1, "on": true}', False),
        ('{"n": 1, "text": 5.0}', '{"text": "5"}', True),
        ('{"n": 1, "text": 5}', '{"text": "5.00"}', True),
        ('{"n": 1, "text": true}', '{"text": "1"}', False),
        ('{"n": 1, "text": null}', '{"text": "a"}', True),
        ('{"n": 1, "set": [2, 1, 2]}', '{"set": [1, 2]}', True),
        ('{"n": 1, "set": [2, 1, 2]}', '{"set": [2]}', False),
        ('{"n": 1, "set": "2"}', '{"set": [2]}', True),
        ('{"n": 1, "at": 0}', '{"at": "1970-01-01T00:00:00Z"}', True),
        ('{"n": 1, "in": {"x": "2.5"}}', '{"in": {"x": 2.5}}', True),
        ('{"n": 1, "in": {"x": "2.5"}}', '{"in": {"x": 2}}', False),
        ('{"n": "1", "in": 5}', "", False),
        ('{"n": 1}', '{"n": 1}', False),
    ],
)
def test_a_conversion_without_loss_keeps_the_meaning(sent, said, is_same):
    assert is_converted(_LENIENT, sent.encode(), said.encode()) is is_same


@pytest.mark.parametrize("text", ["5", "five"])
def test_a_device_that_converts_types_without_loss_is_warned_once(text, run):
    body = json.dumps({"n": text}).encode()
    two = [
        _probe(
            body={"n": 5}, kind=Kind.INVALID, operation=_OTHER, says="a text as body /n", place="body /n", sent=body
        ),
        _probe(body={"n": 5}, kind=Kind.GENERATED, operation=_OTHER, validity="invalid", why="n: 'a' is b", sent=body),
    ]
    failed = [len(_failed(rule, Survey(tuple(two)), run)) for rule in (requests.types, requests.invalid_refused)]
    assert failed == ([1, 0] if text == "5" else [0, 1])


def test_another_setting_may_decide_a_converted_value(run):
    said = {"body": {"n": 100}, "operation": _OTHER}
    odd = _probe(**said, kind=Kind.INVALID, says="a text as body /n", place="body /n", sent=b'{"n": "5"}')
    allowed = _probe(**said, validity="valid", sent=b'{"n": 5}')
    failed = [len(_failed(requests.invalid_refused, Survey(probes), run)) for probes in ((odd,), (allowed, odd))]
    assert failed == [1, 0]


def test_null_stands_for_an_optional_body(run):
    null = _probe(kind=Kind.INVALID, operation=_OTHER, says="null as body", place="body", sent=b"null")
    failed = [len(_failed(rule, Survey((null,)), run)) for rule in (requests.types, requests.invalid_refused)]
    assert failed == [1, 0]


@pytest.mark.parametrize(("operation", "is_doubtful"), [(_LABEL, True), (_OTHER, False)])
@pytest.mark.parametrize(
    ("rule", "kind"), [(requests.invalid_refused, Kind.INVALID), (requests.required, Kind.MISSING)]
)
def test_a_server_may_ignore_the_content_of_a_get(rule, kind, operation, is_doubtful, run):
    wrong = _probe(kind=kind, operation=operation, says="a wrong body", place="body", sent=b"[1]")
    (finding,) = _failed(rule, Survey((wrong,)), run)
    assert bool(finding.doubt) == is_doubtful


@pytest.mark.parametrize(("sent", "is_doubtful"), [(b'{"m": "\xff"}', True), (b'{"m": "\xff', False), (b"[1]", False)])
def test_a_json_parser_may_replace_octets_that_are_no_utf_8(sent, is_doubtful, run):
    wrong = _probe(kind=Kind.MALFORMED, operation=_OTHER, says="a wrong body", place="body", sent=sent)
    (finding,) = _failed(requests.invalid_refused, Survey((wrong,)), run)
    assert bool(finding.doubt) == is_doubtful


def test_a_body_of_another_type_is_told_once_of_all_operations(run):
    generated = {"kind": Kind.GENERATED, "validity": "invalid"}
    probes = [
        *[_probe(operation=_OTHER, kind=Kind.INVALID, says=one, place="body", sent=b"[]") for one in NO_OBJECT],
        *[
            _probe(operation="PUT /b", why=f"the value is {one}, not of type object", sent=one.encode(), **generated)
            for one in ("[]", "0", "false", '"A"')
        ],
    ]
    (finding,) = _failed(requests.invalid_refused, Survey(tuple(probes)), run)
    assert {one.operation: one.seen for one in finding.operations} == {_OTHER: 2, "PUT /b": 4}


def test_characters_that_a_program_counts_twice_are_told_once(run):
    operations = {_OTHER, "PUT /b"}
    probes = [_probe(201, b"", operation=one, sent=b'{"n": 1}') for one in operations]
    probes += [_probe(400, {}, Kind.BOUND, operation=one, says=f"32{WIDE}", place="body /n") for one in operations]
    (finding,) = _failed(requests.valid_accepted, Survey(tuple(probes)), run)
    assert {one.operation for one in finding.operations} == operations
    assert "count a character beyond U+FFFF twice" in finding.doubt


@pytest.mark.parametrize(("kind", "seen"), [(Kind.INVALID, 0), (Kind.GENERATED, 0), (Kind.UNKNOWN, 1)])
def test_a_router_that_reads_path_parameters_by_type_answers_404_in_its_own_format(kind, seen, run):
    absent = _probe(404, b"<html>", kind, media_type="text/html", says="0.5 as path id", place="path id")
    assert len(_failed(answers.media_type, Survey((absent,)), run)) == seen


def test_what_a_device_accepts_and_repeats_is_told_by_one_rule(run):
    wrong = [{"n": "a"}, {"n": []}, {"n": True}, {"n": 1.5}, []]
    sent = {"kind": Kind.INVALID, "operation": "PUT /c", "place": "body /n"}
    probes = [_probe(200, one, sent=json.dumps(one).encode(), says=f"{one} as body /n", **sent) for one in wrong]
    (finding,) = _failed(requests.invalid_refused, Survey(tuple(probes)), run)
    assert finding.observed.startswith("status 200 (as to each of 5 wrong bodies), for ")
    assert not _failed(answers.body_schema, Survey(tuple(probes)), run)
    apart = (*probes[1:], _probe(400, {}, sent=b'{"n": "a"}', says="a as body /n", **sent))
    assert len(_failed(requests.invalid_refused, Survey(apart), run)) > 0
    assert "each of" not in _failed(requests.invalid_refused, Survey(apart), run)[0].observed


def test_members_of_which_none_is_demanded_are_told_once(run):
    probes = [_probe(kind=Kind.MISSING, operation="PUT /c", says=one, place=f"body /{one}", sent=b"{}") for one in "ab"]
    assert len(_failed(requests.required, Survey(tuple(probes)), run)) == 1
    refused = _probe(400, {}, Kind.MISSING, operation="PUT /c", says="c", place="body /c", sent=b"{}")
    assert len(_failed(requests.required, Survey((*probes, refused)), run)) == 2


def test_a_wrong_parameter_is_named_as_the_survey_names_it(run):
    wrong = _probe(kind=Kind.GENERATED, validity="invalid", why="'at AAA' at query offset")
    (finding,) = _failed(requests.invalid_refused, Survey((wrong,)), run)
    assert finding.observed == "status 200, for 'at AAA' as query offset"


def test_what_is_refused_with_nothing_optional_is_told_once(run):
    least = [_probe(422, {}, kind, operation=_OTHER, sent=b"{}", validity="valid") for kind in _LEAST]
    more = _probe(201, b"", Kind.OPTIONAL, operation=_OTHER, sent=b'{"n": 1}', place="body /n")
    both = (requests.optional, requests.valid_accepted)
    assert [len(_failed(rule, Survey((*least, more)), run)) for rule in both] == [1, 0]


def test_bodies_that_are_demanded_and_not_declared_required_are_told_once(run):
    put = "PUT /b"
    works = [_probe(201, b"", operation=one, sent=b'{"n": 1}') for one in (_OTHER, put)]
    empty = {"kind": Kind.GENERATED, "validity": "valid"}
    refused = [_probe(422, {"detail": one}, operation=one, **empty) for one in (_OTHER, put)]
    (finding,) = _failed(requests.valid_accepted, Survey((*works, *refused)), run)
    assert {one.operation for one in finding.operations} == {_OTHER, put}
    assert "for no body, which the description does not require" in finding.observed
    assert "leave out `required: true`" in finding.doubt


def test_fractions_that_a_framework_cuts_are_told_once(run):
    says = {"says": "1.5 as body /n, which is no whole number", "place": "body /n", "kind": Kind.INVALID}
    both = {"PUT /a/{id}", _OTHER}
    (finding,) = _failed(requests.invalid_refused, Survey(tuple(_probe(operation=one, **says) for one in both)), run)
    assert {one.operation for one in finding.operations} == both


def test_what_an_operation_does_not_check_in_one_place_is_told_once(run):
    places = {
        "query n": ["no parameter n", "'x' at query n", "'-1' at query n", "'a is b' at query n"],
        "body": ["not JSON: a", "the value: 1 is not valid under any of the given schemas", "the value has 0 items"],
        "body /p/xs/#": ["p.xs[0] has 3 items", "p.xs[1]: 'a' is not one of ['b']", "p.xs[0] should be non-empty"],
    }
    probes = [_probe(kind=Kind.GENERATED, validity="invalid", why=why) for given in places.values() for why in given]
    found = _failed(requests.invalid_refused, Survey(tuple(probes)), run)
    assert [one.cause for one in found] == [f"{_LABEL} {place}" for place in places]


@pytest.mark.parametrize(
    ("times", "holds"),
    [
        ([5.0] * 90, True),
        ([5.0] * 30 + [70.0] * 30 + [140.0] * 30, False),
        ([140.0] * 30 + [70.0] * 30 + [5.0] * 30, True),
        ([1.0] * 30 + [3.0] * 30 + [9.0] * 30, True),
        ([float(i * 3) for i in range(90)], False),
        ([5.0, 500.0] * 45, True),
    ],
)
def test_latency_that_grows(times, holds, run):
    (found,) = robustness.steady_latency.outcomes(Survey((), tuple(times), _OK.exchange), {"run": run}.__getitem__)
    assert found.holds is holds


def test_latency_of_an_operation_that_grows(run):
    grows, steady = (
        [replace(_OK, operation=label, kind=Kind.AGAIN, exchange=_took(ms * slope)) for ms in range(1, 21)]
        for label, slope in ((_LABEL, 10.0), (_PLAIN, 0.1))
    )
    trace = Survey((*grows, *steady), (5.0,) * 90, _OK.exchange)
    (found,) = _failed(robustness.steady_latency, trace, run)
    assert found.subject == _LABEL


@pytest.mark.parametrize("status", [409, 412, 423, 428, 429, 503, 507])
@pytest.mark.parametrize(
    ("rule", "kind"),
    [
        (requests.invalid_refused, Kind.INVALID),
        (requests.required, Kind.MISSING),
        (requests.examples, Kind.EXAMPLE),
        (requests.enums, Kind.ENUM),
        (requests.optional, Kind.USUAL),
        (answers.headers, Kind.USUAL),
        (answers.formats, Kind.USUAL),
    ],
)
def test_what_the_state_did_not_allow_is_neither_met_nor_broken(rule, kind, status, run):
    probes = [_probe(status, kind=one) for one in dict.fromkeys((Kind.USUAL, kind))]
    said = rule.outcomes(Survey(tuple(probes)), {"run": run}.__getitem__)
    assert said == [NotSeen(f"GET /a/{{id}} was answered only {status}: its state did not allow it")]


def test_a_state_that_changed_during_the_run_hides_nothing(run):
    probes = [_probe(200), _probe(200, kind=Kind.INVALID), _probe(409, kind=Kind.INVALID), _probe(409, kind=Kind.AGAIN)]
    found = _failed(requests.invalid_refused, Survey(tuple(probes)), run)
    assert [one.exchange.response.status for one in found] == [200]


def test_operations_that_the_state_did_not_allow_are_told_in_one_sentence(run):
    labels = [f"POST /{name}" for name in "abcdef"]
    probes = [_probe(409 if one < "POST /d" else 423, operation=one) for one in labels]
    said = requests.optional.outcomes(Survey(tuple(probes)), {"run": run}.__getitem__)
    assert said == [
        NotSeen(
            "POST /a, POST /b, POST /c, POST /d and 2 more operations were answered only 409 or 423: "
            "their state did not allow it"
        )
    ]
