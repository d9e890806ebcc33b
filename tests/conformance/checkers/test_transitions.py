"""States that a description names, and what a refusal keeps: what the words leave open is not judged."""

import pytest
from exchanges import broken, exchange
from small_device import REFUSED, answers, contract_of, described

from conformance.checkers.transitions import barred_by, state_member
from conformance.documents.openapi import read_operations

_BASE = "http://device:8000"
_BELT = {
    "type": "object",
    "properties": {
        "id": {"type": "string"},
        "state": {
            "enum": ["stopped", "running", "paused", "done", "scrapped", "cancelled"],
            "description": "It becomes `scrapped` by wear; that is final.",
        },
        "runs": {},
        "archived": {"type": "boolean"},
    },
}
_ID = {"name": "id", "in": "path", "required": True, "schema": {"type": "string"}}
_STATES, _KEEPS = "description/states", "description/refused-keeps"
_ELSE = "In another state it is answered 409, and nothing changes."
_SAID = {
    "start": f"Start a stopped belt. {_ELSE}",
    "thaw": "paused becomes running, and its count is set. In every other status, and in mode `off`: 409.",
    "resume": f"Let a paused belt run again. {_ELSE}",
    "pause": "Pause a running belt. 409 if it cannot be done.",
    "halt": f"Not for a stopped belt. {_ELSE}",
    "stop": "409 unless the belt is running or paused. The belt is then stopped.",
    "clean": "409 if it is running, paused already, or has goods.",
    "grease": "409 if the belt is running and nobody watches it. Refused if the motor is stopped.",
    "ship": "While a part of the belt is paused, and while the belt is archived, it is refused with 409.",
    "drop": "A belt is cancelled at once and stays cancelled. One that is done stays running, done or not.",
    "seal": "Seal the belt once. The second time is refused with 409.",
    "restore": "409 if it is not archived. If it was paused, it is then paused.",
    "wake": "A paused belt becomes running. In every other status: 409.",
    "rest": "A running or stopped belt becomes paused.",
    "scrap": "Take it out. A done belt: 409.",
}


@pytest.fixture(name="contract", scope="module")
def _contract(tmp_path_factory):
    acted = {"200": answers(_BELT), "409": REFUSED}
    paths = {
        f"/belts/{{id}}/{name}": {"parameters": [_ID], "post": {"summary": text, "responses": acted}}
        for name, text in _SAID.items()
    }
    put = {"summary": "409 if the belt is archived.", "responses": acted}
    patch = {"summary": "Only while the belt is stopped: 409 otherwise.", "responses": acted}
    read = {"responses": {"200": answers(_BELT)}}
    paths["/belts/{id}"] = {"parameters": [_ID], "get": read, "put": put, "patch": patch}
    begin = {"summary": "Only one belt runs at a time: while one is `running`, 409.", "responses": acted}
    paths["/belts"] = {"post": begin}
    alone = {**acted, "409": {**REFUSED, "description": "Another belt is running"}}
    paths["/belts/{id}/launch"] = {"parameters": [_ID], "post": {"responses": alone}}
    paths["/belts/{id}/goods"] = {"parameters": [_ID], "post": put}
    document = described(paths, "3.1.0")
    return contract_of(tmp_path_factory.mktemp("pack"), document)


def _broken(contract, steps):
    exchanges = []
    for number, (line, *seen) in enumerate(steps):
        method, path, status = line.split()
        shown = dict(zip(("state", "runs", "archived"), seen, strict=False)) or None
        place = f"/{path}" if path[0].isdecimal() else f"/1{path.removeprefix('.')}"
        exchanges.append(exchange(method, f"{_BASE}/belts{place}", int(status), shown, at_s=float(number)))
    return broken(contract, _BASE, exchanges) & {_STATES, _KEEPS}


def _refused(action, *runs, change=1):
    """Return refusals of a running belt with its count before and after each."""
    pairs = [
        (("GET . 200", "running", one), (f"POST /{action} 409",), ("GET . 200", "running", one + change))
        for one in runs
    ]
    steps = [step for pair in pairs for step in pair]
    return [*steps, steps[-1]]


def _not(number, action, after="paused"):
    """Return a refusal of a paused belt, and its state after that."""
    return (f"GET {number} 200", "paused"), (f"POST {number}/{action} 409",), (f"GET {number} 200", after)


_RESUMED = [("GET . 200", "stopped"), ("POST /resume 200", "running")]
_AWAY = ("GET . 200", "stopped", 1, True)
_BROKEN = {
    "stopped from stopped": ([("GET . 200", "stopped"), ("POST /stop 200", "stopped")] * 2, _STATES),
    "stopped from done": ([("GET . 200", "done"), ("POST /stop 200", "stopped")], _STATES),
    "cleaned while paused": ([("GET . 200", "paused"), ("POST /clean 200", "paused")] * 2, _STATES),
    "written while archived": ([_AWAY, ("PUT . 200", "stopped")], _STATES),
    "written while cancelled, by the response before": ([("PATCH . 200", "cancelled")] * 2, _STATES),
    "filled while archived": ([_AWAY, ("POST /goods 200",)], _STATES),
    "shipped while archived": ([_AWAY, ("POST /ship 200",)], _STATES),
    "restored while not archived": ([("GET . 200", "stopped", 1, False), ("POST /restore 200",)], _STATES),
    "not stopped": (
        [("GET . 200", "running"), ("POST /stop 200", "running"), *[("GET . 200", "running")] * 4],
        _STATES,
    ),
    "resumed from stopped": (_RESUMED * 2, _STATES),
    "thawed from done": ([("GET . 200", "done"), ("POST /thaw 200", "running")], _STATES),
    "two run at once": ([(f"GET {number} 200", "running") for number in (1, 2, 1)], _STATES),
    "resumed when told done": ([("POST /stop 200", "done"), ("POST /resume 200", "running")], _STATES),
    "launched beside another": (
        [("GET 1 200", "running"), ("POST 2/launch 200", "running"), ("GET 1 200", "running")],
        _STATES,
    ),
    "a scrapped one that is done": ([("GET . 200", "scrapped"), ("GET . 200", "stopped")], _STATES),
    "one that stays cancelled is done": (
        [("GET 1 200", "cancelled"), ("POST 2/goods 200",), ("POST . 200",), ("GET 1 200", "done")],
        _STATES,
    ),
    "started from paused": ([("GET . 200", "paused"), ("POST /start 200", "running")], _STATES),
    "woken from stopped": ([("GET . 200", "stopped"), ("POST /wake 200", "running")] * 2, _STATES),
    "two are not woken": ([*_not(1, "wake"), *_not(2, "wake")], _STATES),
    "scrapped when done": ([("GET . 200", "done"), ("POST /scrap 200", "scrapped")], _STATES),
    "sealed twice": ([("POST /seal 200",), ("GET . 200", "stopped"), ("POST /seal 200",)], _STATES),
    "a refused start counts": (_refused("start", 1, 2, 3), _KEEPS),
}
_RIGHT = {
    "stopped later": [("GET . 200", "running"), ("POST /stop 200", "running"), ("GET . 200", "running"),
                      *[("GET . 200", "stopped")] * 4],
    "greased while a part of a condition holds": [("GET . 200", "running"), ("POST /grease 200", "running")] * 2,
    "greased while another thing would be refused": [("GET . 200", "stopped"), ("POST /grease 200", "stopped")] * 2,
    "cleaned when stopped": [("GET . 200", "stopped"), ("POST /clean 200", "stopped")] * 2,
    "shipped while it is paused, and not a part of it": [("GET . 200", "paused"), ("POST /ship 200", "paused")] * 2,
    "restored to what it was": [_AWAY, ("POST /restore 200", "stopped"), *[("GET . 200", "stopped")] * 4],
    "a refused change of what is archived": [_AWAY, ("PUT . 409",), _AWAY],
    "resumed from stopped once, which may have been paused just then": _RESUMED,
    "paused from stopped, which no word forbids": [("GET . 200", "stopped"), ("POST /pause 200", "paused")] * 2,
    "halted from running, beside a state that is denied": [("GET . 200", "running"), ("POST /halt 200", "stopped")] * 2,
    "thawed from paused": [("GET . 200", "paused"), ("POST /thaw 200", "running")] * 2,
    "sealed again after another change": [("POST /seal 200",), ("POST /grease 200",), ("POST /seal 200",)],
    "woken, and at its end already": [("GET . 200", "paused"), ("POST /wake 200", "done")],
    "woken, and answered before": [("GET . 200", "paused"), ("POST /wake 200", "paused")] * 2,
    "laid to rest, and out of order": [("GET . 200", "running"), ("POST /rest 200", "scrapped")] * 2,
    "one alone is not woken": [("GET . 200", "paused"), ("POST /wake 409",), ("GET . 200", "paused")] * 3,
    "not woken at times": [
        ("GET 3 200", "paused"), ("POST 3/wake 200", "running"),
        *_not(1, "wake"), *_not(2, "wake"),
    ],
    "not thawed, perhaps for a mode": [*_not(1, "thaw"), *_not(2, "thaw")],
    "not resumed, when not paused any more": [*_not(1, "wake", "running"), *_not(2, "wake", "running")],
    "written while it stops": [("PATCH . 200", "running")] * 2,
    "scrapped when stopped": [("GET . 200", "stopped"), ("POST /scrap 200", "scrapped")],
    "resumed from paused": [("GET . 200", "paused"), ("POST /resume 200", "running")] * 2,
    "a count that goes on by itself from then on": [*_refused("start", 1, 2, 3)[:-1], ("GET . 200", "running", 5)],
    "a count that goes on by itself": [
        *(("GET . 200", "running", 1), ("GET . 200", "running", 2)), *_refused("start", 2, 3, 4),
    ],
    "a count of all refusals": [*_refused("start", 1, 2, 3)[:-2], *_refused("resume", 3, 4, 5)],
    "resumed when told stopped, which may come later": [("POST /stop 200", "stopped"), ("POST /resume 200", "running")],
    "launched when another stops": [
        ("GET 1 200", "running"), ("POST 2/launch 200", "running"), ("GET 1 200", "stopped"),
    ],
    "one that runs after another": [("GET 1 200", "running"), ("GET 2 200", "running"), ("GET 1 200", "stopped")],
    "a refusal of which nothing is said": _refused("pause", 1, 2, 3),
    "a refusal that keeps": _refused("start", 1, 2, 3, change=0)[:3],
}  # fmt: skip


@pytest.mark.parametrize("name", _BROKEN)
def test_what_a_description_says_is_judged(contract, name):
    steps, requirement = _BROKEN[name]
    assert _broken(contract, steps) == {requirement}


@pytest.mark.parametrize("name", _RIGHT)
def test_what_it_leaves_open_is_not(contract, name):
    assert _broken(contract, _RIGHT[name]) == set()


@pytest.mark.parametrize(
    ("says", "barred"),
    [
        ("Only a queued mission can be started.", {"active", "done"}),
        ("Only possible while it is queued", {"active", "done"}),
        ("Not queued", {"active", "done"}),
        ("The mission is not queued", {"active", "done"}),
        ("The mission is not queued any more. Nothing is changed.", {"active", "done"}),
        ("It is done or active already.", {"active", "done"}),
        ("Only queued or active missions can be started", set()),
        ("The mission must be queued", set()),
        ("Another mission is active", set()),
        ("A mission with this name is there", set()),
        ("Conflict", set()),
    ],
)
def test_states_that_the_description_of_a_409_excludes(says, barred):
    state = {"type": "string", "enum": ["queued", "active", "done"]}
    id_ = {"name": "id", "in": "path", "required": True, "schema": {"type": "integer"}}
    shown = answers({"type": "object", "properties": {"id": {"type": "integer"}, "status": state}})
    start = {"responses": {"200": {"description": "started"}, "409": {"description": says}}}
    paths = {
        "/missions/{id}": {"parameters": [id_], "get": {"responses": {"200": shown}}},
        "/missions/{id}/start": {"parameters": [id_], "post": start},
    }
    found = {one.label: one for one in read_operations(described(paths, "3.1.0"))}
    assert barred_by(found["POST /missions/{id}/start"], found["GET /missions/{id}"]).get("status", set()) == barred


@pytest.mark.parametrize(
    ("names", "member"), [(("mode", "state"), "state"), (("mode", "gear"), "mode"), (("gear",), "")]
)
def test_a_mode_is_the_state_of_what_has_no_other_one(names, member):
    shape = {"type": "object", "properties": {name: {"enum": ["a", "b"]} for name in names}}
    reads = read_operations(described({"/belts/{id}": {"get": {"responses": {"200": answers(shape)}}}}, "3.1.0"))
    assert [state_member(read) for read in reads] == [member]
