"""Mutants by rule of described devices: only what breaks a norm or the description counts."""

import json
from pathlib import Path
from urllib.parse import parse_qsl

import pytest
from small_device import contract_of, object_of

from proof.mutation.messages import Request, Response
from proof.selftest.comparison import Comparison, ToolResult
from proof.selftest.generated.described import described_mutants
from proof.selftest.generated.judging import KILLED, SURVIVED, GeneratedResult
from proof.selftest.generated.mutant import GeneratedMutant, Tally
from proof.selftest.generated.report import only_theirs, page

_LAMP = object_of(
    "id",
    "state",
    id={"type": "integer", "minimum": 1},
    state={"type": "string", "enum": ["on", "off"]},
    note={"type": ["string", "null"]},
)
_JSON = {"application/json": {"schema": _LAMP}}
_LIST = object_of(items={"type": "array", "items": _LAMP}, total={"type": "integer"})
_LISTED = {"200": {"description": "all", "content": {"application/json": {"schema": _LIST}}}}
_WHOLE, _STATE = {"type": "integer"}, {"type": "string", "enum": ["on", "off"]}
_NAMES = {"limit": _WHOLE, "offset": _WHOLE, "state": _STATE, "sort": {"type": "string", "enum": ["-id"]}}
_DESCRIPTION = {
    "openapi": "3.1.0",
    "info": {"title": "Lamps", "version": "1"},
    "paths": {
        "/lamps": {
            "get": {
                "parameters": [{"name": name, "in": "query", "schema": schema} for name, schema in _NAMES.items()],
                "responses": _LISTED,
            }
        },
        "/lamps/{id}": {
            "get": {
                "parameters": [
                    {"name": "id", "in": "path", "required": True, "schema": {"type": "integer", "maximum": 9}},
                    {"name": "fine", "in": "query", "schema": {"type": "boolean"}},
                ],
                "responses": {"200": {"description": "it", "content": _JSON}, "404": {"description": "none"}},
            }
        },
    },
}
_GOOD = {"id": 3, "state": "on", "note": None}


@pytest.fixture(name="mutants")
def mutants_fixture(tmp_path: Path) -> dict[str, GeneratedMutant]:
    """Return the mutants of a lamp, by name."""
    contract = contract_of(tmp_path, _DESCRIPTION)
    return {one.name.replace("GET /lamps/{id}", "lamp"): one for one in described_mutants(contract, "/v1")}


def _sent(mutant: GeneratedMutant, target: str, value: object = None) -> tuple[Response, int]:
    """Return what a client gets, and how many messages were altered; invalid ids and texts are refused with 404."""
    tally = Tally()

    def lamp(request: Request) -> Response:
        is_id = request.path.rpartition("/")[2] in set("123456789")
        fine = request.query in {"", "fine=true", "fine=false"}
        body = json.dumps(_GOOD if value is None else value).encode()
        return Response(200, [("Content-Type", "application/json")], body) if is_id and fine else Response(404)

    response = mutant.make(tally)(Request("rest", "GET", target), lamp)
    return response, tally.altered


@pytest.mark.parametrize(
    ("name", "member", "becomes"),
    [("drop:lamp:200.id", "id", None), ("below:lamp:200.id", "id", 0), ("enum:lamp:200.state", "state", "roaas")],
)
def test_a_member_that_breaks_the_schema_is_altered(
    mutants: dict[str, GeneratedMutant], name: str, member: str, becomes: object
) -> None:
    """Alter a member, so that the body breaks its schema."""
    response, altered = _sent(mutants[name], "/v1/lamps/3")
    assert json.loads(response.body).get(member) == becomes
    assert altered == 1


@pytest.mark.parametrize("name", ["drop:lamp:200.note", "null:lamp:200.note", "status:lamp:answer-404"])
def test_what_the_description_leaves_open_is_no_mutant(mutants: dict[str, GeneratedMutant], name: str) -> None:
    """Make no mutant that only does what the description allows."""
    assert name not in mutants


def test_what_breaks_the_schema_anyway_is_left_as_it_is(mutants: dict[str, GeneratedMutant]) -> None:
    """Alter no response that the device itself got wrong: that would be no fault of the mutant."""
    response, altered = _sent(mutants["drop:lamp:200.id"], "/v1/lamps/3", {"id": 3, "state": "purple"})
    assert json.loads(response.body)["id"] == 3
    assert altered == 0


def test_another_path_is_left_as_it_is(mutants: dict[str, GeneratedMutant]) -> None:
    """Alter nothing outside the base path."""
    assert _sent(mutants["drop:lamp:200.id"], "/lamps/3")[1] == 0


@pytest.mark.parametrize(
    ("name", "target", "status"),
    [
        ("takes-type:lamp:query.fine", "/v1/lamps/3?fine=perhaps", 200),
        ("takes-above:lamp:path.id", "/v1/lamps/10", 200),
        ("refuses-value:lamp:query.fine:false", "/v1/lamps/3?fine=false", 422),
        ("needs-optional:lamp:query.fine", "/v1/lamps/3", 422),
        ("crash-negative:lamp:path.id", "/v1/lamps/-1", 500),
    ],
)
def test_requests_are_treated_otherwise_than_described(
    mutants: dict[str, GeneratedMutant], name: str, target: str, status: int
) -> None:
    """Take what the description forbids, refuse what it allows, fail at what is unusual."""
    response, altered = _sent(mutants[name], target)
    assert (response.status, altered) == (status, 1)


def test_a_valid_request_is_left_as_it_is(mutants: dict[str, GeneratedMutant]) -> None:
    """Let a lenient mutant treat valid requests as the device does."""
    assert _sent(mutants["takes-above:lamp:path.id"], "/v1/lamps/3")[1] == 0


def _listed(request: Request) -> Response:
    """Return the lamps 1 to 4 as the parameters of a request say."""
    asked = dict(parse_qsl(request.query))
    lamps = [{"id": one, "state": "on" if one % 2 else "off"} for one in range(1, 5)]
    found = sorted(lamps, key=lambda one: -int(str(one["id"]))) if "sort" in asked else lamps
    found = [one for one in found if one["state"] == asked.get("state", one["state"])]
    begin = int(asked.get("offset", 0))
    body = {"items": found[begin : begin + int(asked.get("limit", 9))], "total": len(found)}
    return Response(200, [("Content-Type", "application/json")], json.dumps(body).encode())


@pytest.mark.parametrize(
    ("name", "query", "ids", "total"),
    [
        ("limit-ignored:GET /lamps:query.limit", "limit=2&state=on", [1, 3], 2),
        ("limit-ignored:GET /lamps:query.limit", "limit=1&sort=-id", [4, 3, 2, 1], 4),
        ("page-repeated:GET /lamps:query.offset", "offset=2&limit=2", [1, 2], 4),
        ("filter-ignored:GET /lamps:query.state", "state=off", [1, 2, 3, 4], 4),
        ("order-ignored:GET /lamps:query.sort", "sort=-id", [1, 2, 3, 4], 4),
        ("total-later:GET /lamps:answer", "limit=1", [1], 5),
    ],
)
def test_parameters_and_totals_of_lists_go_wrong(
    mutants: dict[str, GeneratedMutant], name: str, query: str, ids: list[int], total: int
) -> None:
    """Leave a parameter out where that shows; tell a wrong total after many right ones."""
    tally = Tally()
    change = mutants[name].make(tally)
    for _ in range(11):
        response = change(Request("rest", "GET", f"/v1/lamps?{query}"), _listed)
    found = json.loads(response.body)
    assert ([one["id"] for one in found["items"]], found["total"]) == (ids, total)
    assert bool(tally.altered) == ((ids, total) != ([1, 3], 2))


def test_the_page_has_all_tools_in_one_table_and_names_what_only_another_kills(
    mutants: dict[str, GeneratedMutant],
) -> None:
    """Compare on the same mutants, and name each that only Schemathesis kills."""
    ours, theirs = mutants["drop:lamp:200.id"], mutants["enum:lamp:200.state"]
    results = [GeneratedResult(ours, KILLED, altered=1), GeneratedResult(theirs, SURVIVED, altered=1)]
    seen = [ToolResult(ours.name, False, ()), ToolResult(theirs.name, True, ("GET /x ST108",))]
    compared = [Comparison("plain Schemathesis", ("GET /x ST104",), seen), Comparison("Specmatic", (), seen[:1])]
    text = page("http://lamp", results, {}, compared, ())
    assert "| roaas certify | 1 | 2 | 50.0% |" in text
    assert "| plain Schemathesis | 1 | 2 | 50.0% |" in text
    assert "| Specmatic | 0 | 1 | 0.0% |" in text
    assert only_theirs(results, compared) == [f"plain Schemathesis alone: {theirs.name}: GET /x ST108"]


@pytest.mark.parametrize(
    ("name", "method", "condition", "status", "tag"),
    [
        ("head-missing", "HEAD", "", 404, '"1"'),
        ("head-tag", "HEAD", "", 200, '"roaas"'),
        ("tag-kept", "GET", "", 200, '"0"'),
        ("list-ignored", "GET", 'If-None-Match: "9", "1"', 200, '"1"'),
        ("refused-as-missing", "PATCH", "", 404, None),
    ],
)
def test_a_resource_says_one_thing_and_then_another(mutants, name, method, condition, status, tag):
    count = [-1]

    def lamp(request: Request) -> Response:
        count[0] += 1
        if request.method == "PATCH":
            return Response(405)
        found = Response(200, [("ETag", f'"{count[0]}"')], b"{}")
        return Response(304) if f'"{count[0]}"' in (request.field("If-None-Match") or "") else found

    tally = Tally()
    change = mutants[f"{name}:lamp:resource"].make(tally)
    assert change(Request("rest", "GET", "/v1/lamps/3"), lamp).status == 200
    assert tally.altered == 0
    fields = [tuple(condition.split(": "))] if condition else []
    answer = change(Request("rest", method, "/v1/lamps/3", fields=fields), lamp)
    assert (answer.status, answer.field("ETag"), tally.altered) == (status, tag, 1)
