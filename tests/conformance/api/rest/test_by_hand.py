"""What is written by hand and sent as valid is read back first, by another parser than the one that wrote it."""

import json
from contextlib import closing

import pytest

from conformance.api.rest import by_hand
from conformance.api.rest.interface import RestInterface
from conformance.contract.pack import Contract
from conformance.transport import raw
from conformance.transport.client import Connection, HttpClient
from conformance.verdict.evidence import HarnessError
from conformance.verdict.run import Run

_ZERO = {"x": 0.0, "y": 0.0, "z": 0.0}
_BODY = json.dumps({"linear": _ZERO, "angular": _ZERO}).encode()
_CHUNKED = ("Content-Type: application/json; charset=utf-8", "Transfer-Encoding: chunked")


@pytest.fixture(name="api")
def _api(closed_port):
    with closing(HttpClient(f"{closed_port}/prefix", Connection())) as client:
        yield RestInterface(Run(contract=Contract.load()), client)


@pytest.fixture(name="sent")
def _sent(monkeypatch):
    sent = []
    monkeypatch.setattr(raw, "talk", lambda _client, octets, *, answers=0: sent.append((octets, answers)))
    return sent


def _put(api, body, *fields):
    return raw.head(api.client, "PUT", "/robot/velocity/", *fields) + body


def _get(api, path):
    return raw.head(api.client, "GET", path)


def test_valid_requests_are_sent_as_they_are(api, sent):
    absolute = _get(api, "/robot/pose/").replace(b" ", b" http://r2", 1)
    several = _get(api, "/robot/pose/") + raw.head(api.client, "HEAD", "/robot/sensors/") + absolute
    chunked = _put(api, raw.chunked(_BODY, 1), *_CHUNKED)
    for octets in (several, chunked):
        by_hand.talk(api, octets, answers=3)
    assert sent == [(several, 3), (chunked, 3)]


@pytest.mark.parametrize(
    "make",
    [
        lambda api: _put(api, raw.chunked(_BODY, 7)[:-1], *_CHUNKED),
        lambda api: _put(api, raw.chunked(_BODY, 7).replace(b"0\r\n\r\n", b""), *_CHUNKED),
        lambda api: _put(api, raw.chunked(_BODY[:-1], 7), *_CHUNKED),
        lambda api: _put(api, raw.chunked(_BODY.replace(b"0.0", b"null", 1), 1), *_CHUNKED),
        lambda api: _put(api, _BODY, "Content-Length: 5", "Content-Type: application/json"),
        lambda api: raw.head(api.client, "GET", "/robot/pose/", host=False),
        lambda api: _get(api, "/robot/pose/") + b"GET",
        lambda api: _get(api, "/robot/navigation/service/plan?x=abc&y=0"),
    ],
)
def test_what_is_not_valid_is_the_suite_s_mistake(api, sent, make):
    with pytest.raises(HarnessError):
        by_hand.talk(api, make(api))
    assert sent == []


def test_what_is_to_be_refused_is_whole_all_the_same(api, sent):
    by_hand.talk(api, _get(api, "/robot/navigation/service/plan?x=abc&y=0"), refused=True)
    assert len(sent) == 1
    with pytest.raises(HarnessError):
        by_hand.talk(api, b"GET / HTTP/1.1\r\n", refused=True)
