"""Smaller requests than one: each lacks one part of it."""

import json

from conformance.engine.lost_device import smaller
from conformance.transport.exchange import Request

_JSON = (("Accept", "*/*"), ("Content-Type", "application/json"))


def _minimal(request: Request, does) -> Request:
    """Return the request that is left when no smaller one does it."""
    while (less := next(filter(does, smaller(request)), None)) is not None:
        request = less
    return request


def test_a_parameter_that_does_it_stays_alone():
    request = Request("GET", "http://arm/pose?x=1&z=1e308&y=2", (("Accept", "*/*"), ("X-Trace", "1")))
    assert _minimal(request, lambda one: "z=1e308" in one.url) == Request("GET", "http://arm/pose?z=1e308", _JSON[:1])


def test_a_member_that_does_it_stays_with_those_around_it():
    body = json.dumps({"name": "a", "pose": {"x": 1.0, "z": 1e308, "joints": [1, 2, -1]}, "speed": 3}).encode()

    def does(one: Request) -> bool:
        return b"1e+308" in one.body

    found = _minimal(Request("POST", "http://arm/move", _JSON, body), does)
    assert json.loads(found.body) == {"pose": {"z": 1e308}}
    assert found.headers == _JSON


def test_a_long_text_becomes_shorter():
    body = json.dumps({"text": "a" * 10_000}).encode()
    found = _minimal(Request("POST", "http://arm/say", _JSON, body), lambda one: len(one.body) > 1000)
    assert 1000 < len(found.body) < 2600


def test_no_part_is_taken_twice_and_nothing_is_taken_from_nothing():
    assert list(smaller(Request("GET", "http://arm/pose", _JSON[:1]))) == []
    assert list(smaller(Request("GET", "http://arm/", (), b"", b"raw"))) == []


def test_what_is_no_json_is_halved():
    (empty, half) = smaller(Request("PUT", "http://arm/", _JSON[:1], b"\xff\xfe\x00\x01"))
    assert (empty.body, half.body) == (b"", b"\xff\xfe")
