"""What should change nothing: refused requests, and reads by a condition; what changes by itself is not blamed."""

import pytest
from exchanges import broken, exchange, failed
from small_device import REFUSED, answers, contract_of, described

_BASE = "http://device:8000"
_VALVE = {"type": "object", "properties": {"id": {}, "revision": {"type": "integer"}, "seen": {"type": "integer"}}}
_ID = {"name": "id", "in": "path", "required": True, "schema": {"type": "string"}}
_KEPT, _SAFE, _INSIDE = "description/refused-keeps", "description/safe", "robustness/no-internals"
_READ = "description/written-is-read"
_OK = {"200": answers(_VALVE), "4XX": REFUSED}
_PATHS = {
    "/valves/{id}": {
        "parameters": [_ID],
        "get": {"responses": _OK},
        "patch": {"requestBody": {"content": {"application/json": {"schema": _VALVE}}}, "responses": _OK},
    },
    "/events": {"get": {"responses": _OK}},
    **{
        path: {"get": {"responses": {"200": answers({"type": "array", "items": _VALVE})}}}
        for path in ("/valves", "/log")
    },
}
_SAYS = "(R1) A request that is refused (4xx) changes nothing: no resource, and it appends no event."
_TAG = ("If-None-Match", '"roaas-nothing"')


@pytest.fixture(name="contracts", scope="module")
def _contracts(tmp_path_factory):
    """Return the contract of a device that says of all refusals that they change nothing, and of one that does not."""
    found = {}
    for text in (_SAYS, ""):
        document = described(_PATHS, "3.1.0")
        document["info"]["description"] = text
        found[bool(text)] = contract_of(tmp_path_factory.mktemp("pack"), document)
    return found


def _broken(contract, steps):
    exchanges = []
    for number, (line, members, *fields) in enumerate(steps):
        method, path, status = line.split()
        sent = {"revision": "x"} if method == "PATCH" else None
        exchanges.append(
            exchange(method, _BASE + path, int(status), members, sent=sent, asked=fields, at_s=float(number))
        )
    return broken(contract, _BASE, exchanges) & {_KEPT, _SAFE, _INSIDE}


def _rounds(between, name="revision", path="/valves/1", idle=0, times=3):
    """Return rounds of a read twice, a request that should change nothing, and a read that shows a change."""
    found, now = [], 1
    for _ in range(times):
        found += [(f"GET {path} 200", {name: now}), (f"GET {path} 200", {name: now + idle})]
        now += 1 + idle
        found += [between, (f"GET {path} 200", {name: now})]
    return [*found, (f"GET {path} 200", {name: now + idle})]


def _listed(path, times=3):
    """Return rounds of reading a list before and after a refusal that adds an item to it."""
    rounds = _rounds(_REFUSAL, path=path, times=times)
    return [(line, [{}] * members["revision"] if "GET" in line else members) for line, members in rounds]


_REFUSAL = ("PATCH /valves/1 422", {})
_ECHOED = ("GET /valves/9 404", {"detail": "last: Bearer roaas-not-this-one"})
# Jobs in a list go on, whatever is refused meanwhile.
_GOES_ON = [
    (line, {"jobs": [{"progress": members["revision"]}]} if "GET" in line else members)
    for line, members in _rounds(_REFUSAL)
]
_BROKEN = {
    "a refused patch counts as a revision": (_rounds(_REFUSAL), False, _KEPT),
    "a refused patch appends an event": (_rounds(_REFUSAL, "last", "/events"), True, _KEPT),
    "a refused patch adds an item": (_listed("/valves"), True, _KEPT),
    "a read by a condition counts": (_rounds(("GET /valves/1 200", {"revision": 1}, _TAG)), False, _SAFE),
    "an error shows credentials of an earlier request": ([_ECHOED], False, _INSIDE),
}
_RIGHT = {
    "a count that goes on by itself": (_rounds(_REFUSAL, idle=1), True),
    "a list of requests": (_listed("/log"), True),
    "items, where nothing is said": (_listed("/valves"), False),
    "once, by chance": (_rounds(_REFUSAL, times=2), True),
    "a member of which nothing is said": (_rounds(_REFUSAL, "seen"), False),
    "an event, where nothing is said": (_rounds(_REFUSAL, "last", "/events"), False),
    "a patch that was taken": (_rounds(("PATCH /valves/1 200", {})), True),
    "a job in a list that goes on": (_GOES_ON, True),
    "its own wrong credentials": ([(*_ECHOED, ("Authorization", "Bearer roaas-not-this-one"))], False),
}


@pytest.mark.parametrize("name", _BROKEN)
def test_what_should_change_nothing_is_judged(contracts, name):
    steps, is_said, requirement = _BROKEN[name]
    assert _broken(contracts[is_said], steps) == {requirement}


@pytest.mark.parametrize("name", _RIGHT)
def test_what_may_change_is_not(contracts, name):
    steps, is_said = _RIGHT[name]
    assert _broken(contracts[is_said], steps) == set()


def _written(texts, seen):
    """Return reads of valve 1, between which valve 2 is sent texts, with what the reads show of the revision."""
    steps = [("GET", "1", seen[0])]
    for text, after in zip(texts, seen[1:], strict=True):
        steps += [("PATCH", "2", text), ("GET", "1", after)]
    return steps


def _of_another(contract, steps):
    """Return what breaks because of another thing; steps: method, end of the path, revision, and the id in the body."""
    exchanges = [
        exchange(
            method, f"{_BASE}/valves/{path}", shown=(shown := {"id": id_, "revision": revision}),
            sent=shown if method == "PATCH" else None, at_s=10.0 * number,
        )
        for number, (method, path, revision, id_) in enumerate(steps)
    ]  # fmt: skip
    return {case.requirement for case in failed(contract, _BASE, exchanges) if "another" in case.cause}


@pytest.mark.parametrize(
    ("steps", "blamed"),
    [
        (_written(["first text", "other text"], [1, "first text", "other text"]), {_READ}),
        (_written(["first text", "other text"], [1, "first text", "first text"]), set()),  # once may be chance
        (_written(["first text", "other text"], [1, 2, 3]), set()),
        (_written(["first text", "other text"], [1, 1, 1]), set()),
        ([*_written(["first text"], [1, "first text"]), ("PATCH", "1", "own text"), ("GET", "1", "own text")], set()),
    ],
)
def test_what_one_thing_is_sent_is_not_in_another(contracts, steps, blamed):
    assert _of_another(contracts[False], ((*step, step[1]) for step in steps)) == blamed


def test_a_path_that_leads_to_the_last_thing_is_not_judged_by_it(contracts):
    writes = [step for text in ("text one", "text two") for step in (("PATCH", "2", text), ("GET", "latest", text))]
    steps = [("GET", "latest", "a text"), *writes]
    assert _of_another(contracts[False], ((*step, "2") for step in steps)) == set()


_LAMP = {"type": "object", "properties": {"id": {}, "glow": {"type": "integer"}, "heat": {"type": "integer"}}}
_MODE = {"type": "object", "properties": {"mode": {"type": "string"}, "at": {"type": "string", "readOnly": True}}}
_TAKES = {"level": {"type": "integer"}}


def _bodied(schema):
    return {"requestBody": {"content": {"application/json": {"schema": schema}}}, "responses": {"200": answers(schema)}}


def _lit(contract, *steps):
    """Return what breaks of reads of lamps and of a mode around writes of levels; steps: method, path, and a body."""
    exchanges = [
        exchange(method, f"{_BASE}/{path}", shown=body, sent=body if method == "PUT" else None, at_s=10.0 * number)
        for number, (method, path, body) in enumerate(steps)
    ]
    return {case.requirement for case in failed(contract, _BASE, exchanges) if "elsewhere" in case.cause}


def _around(path, changes, writes=("lamps/1/level", "lamps/1/level")):
    """Return reads of a resource before and after writes of the levels 10, 20 and so on."""
    steps = [("GET", path, changes[0])]
    for number, (change, at) in enumerate(zip(changes[1:], writes, strict=True), 1):
        steps += [("PUT", at, {"level": 10 * number}), ("GET", path, change)]
    return steps


@pytest.mark.parametrize("says", ["No operation changes anything but what it names.", ""])
@pytest.mark.parametrize(
    ("path", "changes", "blamed"),
    [
        ("lamps/2", [{"glow": 1}, {"glow": 10}, {"glow": 20}], "always"),
        ("lamps/1", [{"glow": 1}, {"glow": 10}, {"glow": 20}], ""),
        ("lamps/2", [{"glow": 1}, {"glow": 10}, {"glow": 10}], ""),
        ("lamps/2", [{"heat": 1}, {"heat": 2}, {"heat": 3}], ""),
        ("mode", [{"mode": "a"}, {"mode": "b"}, {"mode": "a"}], "said"),
        ("mode", [{"at": "a"}, {"at": "b"}, {"at": "c"}], ""),
    ],
    ids=["another lamp takes it", "this lamp", "another lamp once", "a lamp gets warm", "the mode", "a time"],
)
def test_what_a_write_does_not_name_stays(says, path, changes, blamed, tmp_path):
    document = described(
        {
            "/lamps/{id}": {"parameters": [_ID], "get": {"responses": {"200": answers(_LAMP)}}},
            "/lamps/{id}/level": {"parameters": [_ID], "put": _bodied({"type": "object", "properties": _TAKES})},
            "/mode": {"get": {"responses": {"200": answers(_MODE)}}, "put": _bodied(_MODE)},
        },
        "3.1.0",
    )
    document["info"]["description"] = says
    is_blamed = blamed == "always" or (blamed == "said" and bool(says))
    assert _lit(contract_of(tmp_path, document), *_around(path, changes)) == ({_READ} if is_blamed else set())
