"""One thing in several responses: a list that stays old is blamed, and a part that is not kept; what moves is not."""

import pytest
from exchanges import broken, exchange
from small_device import REFUSED, answers, body_of, contract_of, described, object_of

_BASE = "http://device"
_NUMBER = {"type": "number"}
_FAN = object_of(id={"type": "string"}, speed=_NUMBER, noise=_NUMBER, label={"type": "string"})
_ID = {"name": "id", "in": "path", "required": True, "schema": {"type": "string"}}
_OK = {"200": answers(_FAN), "4XX": REFUSED}
_PATHS = {
    "/fans": {"get": {"responses": {"200": answers({"type": "array", "items": _FAN})}}},
    "/fans/{id}": {"parameters": [_ID], "get": {"responses": _OK}},
    "/fans/{id}/drive": {
        "parameters": [_ID],
        "put": {"requestBody": body_of(object_of(percent=_NUMBER)), "responses": _OK},
    },
}
_CACHED = [("Cache-Control", "max-age=60")]
_SAME, _READ = "description/same-values", "description/written-is-read"


def _get(at_s, id_="a", **members):
    return exchange("GET", f"{_BASE}/fans/{id_}", 200, {"id": id_, **members}, at_s=at_s)


def _list(at_s, told=(), **members):
    return exchange("GET", f"{_BASE}/fans", 200, [{"id": "a", **members}], told=told, at_s=at_s)


def _drive(at_s, percent, shown=None, id_="a"):
    body = {"id": id_, "speed": percent if shown is None else shown}
    return exchange("PUT", f"{_BASE}/fans/{id_}/drive", 200, body, sent={"percent": percent}, at_s=at_s)


def _driven(reads, wait_s=5.0):
    """Return writes of 10, 20, ..., each with a read after it that shows the given speed."""
    steps = [_get(0, speed=0)]
    for number, speed in enumerate(reads, 1):
        steps += [_drive(10 * number, 10 * number), _get(10 * number + wait_s, speed=speed)]
    return steps


def _listed(listed, read, **more):
    """Return reads of a thing around lists, after both showed 1 and a write of another speed."""
    steps = [_get(0, speed=1), _list(1, speed=1), _drive(2, read[0]), _get(3, speed=read[0])]
    for number, (shown, now) in enumerate(zip(listed, read[1:], strict=True), 1):
        steps += [_list(10 * number, speed=shown, **more), _get(10 * number + 1, speed=now)]
    return steps


@pytest.fixture(name="contract", scope="module")
def _contract(tmp_path_factory):
    return contract_of(tmp_path_factory.mktemp("pack"), described(_PATHS, "3.1.0"))


@pytest.mark.parametrize(
    ("steps", "requirement"),
    [
        pytest.param(_listed([1, 1], [5, 5, 5]), _SAME, id="a list stays old"),
        pytest.param(_driven([10, 20, 0, 0]), _READ, id="two values are forgotten"),
        pytest.param(_driven([10, 20, 25, 25]), _READ, id="values are limited in silence"),
    ],
)
def test_a_difference_that_lasts_is_blamed(contract, steps, requirement):
    assert broken(contract, _BASE, steps) & {_SAME, _READ} == {requirement}


@pytest.mark.parametrize(
    "steps",
    [
        pytest.param(_listed([5, 5], [5, 5, 5]), id="a list that follows"),
        pytest.param(_listed([1, 5], [5, 5, 5]), id="a list that was old once"),
        pytest.param(_listed([1, 1], [5, 5, 5], told=_CACHED), id="a list from a cache"),
        pytest.param(_listed([6, 7], [5, 7, 8]), id="what moves"),
        pytest.param(_driven([10, 20, 0, 40]), id="one value is forgotten"),
        pytest.param(_driven([0, 0, 0, 0]), id="a member that never shows what was sent"),
        pytest.param(_driven([10, 20, 0, 0], wait_s=0.5), id="a device that acts later"),
        pytest.param(
            [_get(0, speed=0), *(_drive(10 * turn, 10 * turn, shown=turn) for turn in (1, 2)), _get(30, speed=0)],
            id="a response that says what it took",
        ),
    ],
)
def test_what_a_right_device_may_do_is_not(contract, steps):
    assert not broken(contract, _BASE, steps) & {_SAME, _READ}
