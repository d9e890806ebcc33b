"""Checkers of methods, entity tags and conditions: right sequences of exchanges in several styles, and wrong ones."""

import pytest
from exchanges import broken, exchange
from small_device import contract_of

BASE = "http://device:80"
_JSON = {"application/json": {"schema": {"type": "object"}}}
_OK = {"200": {"description": "ok", "content": _JSON}}
_TAGGED = {"parameters": [{"in": "header", "name": "If-Match", "schema": {"type": "string"}}]}


def _described(*, if_match=True, error=None):
    """Return the description of a device with items, an action, a sub-resource and one that is written."""
    changes = {"responses": _OK, **(_TAGGED if if_match else {})}
    key = {"parameters": [{"in": "path", "name": "id", "required": True, "schema": {"type": "string"}}]}
    read = {"responses": {**_OK, **({"405": {"description": "no", "content": error}} if error else {})}}
    paths = {
        "/config": {"get": read, "put": changes},
        "/copied": {"get": {"responses": {**_OK, "304": {"description": "as it was"}}}},
        "/jobs/search": {"post": {"responses": _OK}},
        "/jobs/{id}": {**key, "get": read},
        "/tubes": {"get": read, "post": {"responses": _OK}},
        "/tubes/{id}": {**key, "get": read, "put": changes, "patch": changes, "delete": changes},
        "/tubes/{id}/seal": {**key, "post": {"responses": _OK}},
        "/tubes/{id}/label": {**key, "get": read, "put": changes},
    }
    return {"openapi": "3.1.0", "info": {"title": "d", "version": "1"}, "paths": paths}


def one(line, value=None, body=None, **fields):
    """Return an exchange: "GET /tubes/1 200", content, the request's, and fields, of which some are sent back."""
    method, target, status = line.split()
    back = {"etag": "ETag", "length": "Content-Length", "kind": "Content-Type", "allow": "Allow"}
    told = [(back[name], text) for name, text in fields.items() if name in back]
    asked = [(name.replace("_", "-").title(), text) for name, text in fields.items() if name not in back]
    shown = None if method == "HEAD" else value
    return exchange(method, BASE + target, int(status), shown, sent=body, asked=[("Accept", "*/*"), *asked], told=told)


def _all(tmp_path, exchanges, **described):
    """Return the requirements that are not met in some exchanges."""
    document, folder = _described(**described), tmp_path / str(len(list(tmp_path.iterdir())))
    return broken(contract_of(folder, document), BASE, exchanges)


def _broken(tmp_path, exchanges, **described):
    ids = ("description/head", "description/method-refused", "description/entity-tag", "description/if-match")
    return _all(tmp_path, exchanges, **described) & {*ids, "http/head-length"}


_GET, _A, _B = "GET /tubes/1 200", {"level": 1}, {"level": 2}
_C, _SECOND = {"level": 3}, one("PUT /tubes/1 200", _B, _B, if_match='"a"')
_THIRD = one("PUT /tubes/1 200", _C, _C, if_match='"a"')
_HEAD, _ACTION = "HEAD /tubes/1 200", "GET /tubes/1/seal 404"
_REFUSES = one("GET /tubes/2/seal 405", allow="POST")
_READ, _TAG_A, _TAG_B = one(_GET, _A), one(_GET, _A, etag='"a"'), one(_GET, _B, etag='"b"')
_FIRST, _CONFIG = one("GET /tubes?limit=1 200", _A), one("GET /config 200", _A)
_REFUSED = one("PUT /tubes/1 412", body=_B, if_match='"x"')
_WRITTEN = one("PUT /tubes/1 200", _B, _B, if_match='"x"')
_CURRENT, _GONE = one("GET /tubes/1 304", if_none_match='"a"'), one("GET /tubes/9 404", {"error": "none"})
_UNSTABLE = [_TAG_A, one("PUT /tubes/1 412", body=_B, if_match='"a"'), one(_GET, _A, etag='"c"')]
_KNOWS = [one("GET /tubes/2 200", _A, etag='"k"'), one("PUT /tubes/2 412", body=_B, if_match='"x"')]


@pytest.mark.parametrize(
    "exchanges",
    [
        # HEAD: as GET; without what comes with the content; weakened by a proxy; unknown everywhere; busy; changed.
        [_TAG_A, one(_HEAD, etag='"a"', length="12", kind="application/json"), _TAG_A],
        [_TAG_A, one(_HEAD), _TAG_A],
        [_TAG_A, one(_HEAD, etag='W/"a"'), _TAG_A],
        [_READ, one("HEAD /tubes/1 405"), _READ, one("HEAD /tubes 405"), one("GET /tubes 200", _A)],
        [one("HEAD /tubes 200"), _READ, one("HEAD /tubes/1 429"), _READ],
        [one("HEAD /tubes 200"), _READ, one("HEAD /tubes/1 404"), one("GET /tubes/1 404")],
        [_READ, one(_HEAD, length="12"), one(_GET, {"level": 100})],
        [_READ, one("PUT /tubes/1 200", _B), one(_HEAD, length="99"), _READ],
        [_GONE, one("HEAD /tubes/9 404", length="7", kind="text/html"), _GONE],
        # 404: of a device that refuses no method; of what is gone; of an unknown thing; by another template.
        [_READ, one(_ACTION), _READ],
        [_REFUSES, _READ, one("DELETE /tubes/1 200", _A), one(_ACTION), one("GET /tubes/1 404")],
        [_REFUSES, _READ, one(_ACTION), one("GET /tubes/1 404"), one("GET /tubes/1 404")],
        [_REFUSES, one("GET /tubes/9 404"), one("GET /tubes/9/seal 404"), _READ],
        [_REFUSES, one("POST /jobs/search 200", _A), one("GET /jobs/search 404"), one("POST /jobs/search 200", _A)],
        [_REFUSES, _READ, one("GET /tubes/1/seal 401"), one("GET /tubes/1/seal 501"), _READ],
        [_REFUSES, _READ, one("OPTIONS /tubes/1 404"), _READ],
        [_REFUSES, _READ, one("FOO /tubes/1 400"), _READ],
        # Tags: new with each content; weak ones; of JSON with its members in another order; of a device without 304.
        [_TAG_A, _TAG_B, _TAG_A],
        [one(_GET, _A, etag='W/"a"'), one(_GET, _B, etag='W/"a"')],
        [one(_GET, {"a": 1, "b": 2}, etag='"a"'), one(_GET, {"b": 2, "a": 1}, etag='"a"')],
        [one(_GET, _A, etag='"a"', if_none_match='"a"'), one(_GET, _A, etag='"a"', if_none_match='"b", "a"')],
        [_TAG_A, one("GET /config 200", _B, etag='"a"')],
        [_CURRENT, one(_GET, _B, etag='"b"', if_none_match='"a"')],
        [one("PUT /tubes/1 200", {"ok": 1}, etag='"x"'), _TAG_A],
        [*_UNSTABLE],
        # If-Match: refused; not known to the device; current; after a write; weak; accepted for later.
        [_TAG_A, _REFUSED, _TAG_A],
        [_TAG_A, one("PUT /tubes/1 428", body=_B, if_match='"x"'), _TAG_A],
        [_TAG_A, _SECOND, _TAG_B],
        [_TAG_A, _SECOND, one("PUT /tubes/1 412", body=_C, if_match='"a"'), _TAG_B],
        [_TAG_A, _SECOND, _TAG_A, _THIRD],
        # The same again, which has been done already; after an action that may have brought back what the tag names.
        [_TAG_A, _SECOND, _SECOND],
        [_TAG_A, _SECOND, one("POST /tubes/1/seal 200", _A), _THIRD],
        [_TAG_A, one("PUT /tubes/1 200", _A, _B, if_match='"a"'), one("PUT /tubes/1 200", _C, _C, if_match='"a"')],
        [_TAG_A, _SECOND, one("PUT /tubes/1 200", _B, _C, if_match='"a"')],
        [_TAG_A, one("POST /tubes/1/seal 200", _A), one("PUT /tubes/1 200", _B, _B, if_match='"b"')],
        [one(_GET, _A, etag='W/"a"'), one("PUT /tubes/1 412", body=_B, if_match='W/"a"'), one(_GET, _A, etag='W/"a"')],
        [_TAG_A, one("PUT /tubes/1 412", body=_B, if_match='"a"'), _TAG_B],
        [_TAG_A, one("PUT /tubes/1 202", body=_B, if_match='"x"')],
        [_TAG_A, one("PUT /tubes/1 200", _B, _B, if_match="*")],
        [_TAG_A, one("DELETE /tubes/1 412", if_match='"x"'), _TAG_A],
    ],
)  # fmt: skip
def test_right_devices_of_many_styles_are_not_blamed(tmp_path, exchanges):
    assert _broken(tmp_path, exchanges) == set()


def test_a_device_that_does_not_know_if_match_is_not_blamed(tmp_path):
    exchanges = [_TAG_A, _WRITTEN, _TAG_B]
    assert _broken(tmp_path, [_TAG_A, _SECOND, _THIRD], if_match=False) == set()
    assert _broken(tmp_path, [_TAG_A, _SECOND, _THIRD, *_KNOWS], if_match=False) == {"description/if-match"}
    assert _broken(tmp_path, exchanges, if_match=False) == set()
    assert _broken(tmp_path, [*_KNOWS, *exchanges], if_match=False) == {"description/if-match"}
    assert _broken(tmp_path, [*exchanges, *_KNOWS], if_match=False) == {"description/if-match"}


@pytest.mark.parametrize(
    ("requirement", "exchanges"),
    [
        ("if-match", [_TAG_A, one("PUT /tubes/1 412", body=_B, if_match="*"), _TAG_A]),
        ("head", [one("HEAD /tubes 200"), _READ, one("HEAD /tubes/1 404"), _READ]),
        ("head", [_READ, one("HEAD /tubes/1 405"), _READ, one("HEAD /tubes 200")]),
        ("head", [_READ, one("HEAD /tubes/1 406"), _READ]),
        ("head", [_FIRST, one("HEAD /tubes?limit=1 400"), _FIRST]),
        ("head", [_TAG_A, one(_HEAD, etag='"b"'), _TAG_A]),
        ("head", [one("HEAD /tubes 200", etag='"x"'), _TAG_A, one(_HEAD), _TAG_A]),
        ("head", [_READ, one(_HEAD, kind="text/plain"), _READ]),
        ("head", [_GONE, one("HEAD /tubes/9 200"), _GONE]),
        ("entity-tag", [_TAG_A, one("GET /tubes/1 304", if_none_match='"a"', etag='"b"')]),
        ("length", [_READ, one(_HEAD, length="0"), _READ]),
        ("length", [_READ, one(_HEAD, length="99"), one("PUT /tubes/1 422"), _READ]),
        ("method-refused", [_REFUSES, _READ, one(_ACTION), _READ]),
        ("method-refused", [_READ, one(_ACTION), _READ, _REFUSES]),
        ("method-refused", [_REFUSES, _READ, one("POST /tubes/1 400"), _READ]),
        ("method-refused", [_REFUSES, _CONFIG, one("DELETE /config 404"), _CONFIG]),
        ("method-refused", [one("OPTIONS /tubes 204"), _READ, one("OPTIONS /tubes/1 404"), _READ]),
        ("method-refused", [_REFUSES, _READ, one("PATCH /tubes/1/label 422"), _READ]),
        ("entity-tag", [_TAG_A, one(_GET, _B, etag='"a"')]),
        ("entity-tag", [_TAG_A, _TAG_B, one(_GET, _B, etag='"a"')]),
        ("entity-tag", [_CURRENT, one(_GET, _A, etag='"a"', if_none_match='"b", "a"')]),
        ("entity-tag", [one(_GET, _A, etag='"a"', if_none_match='W/"a"'), _CURRENT]),
        ("entity-tag", [one("GET /copied 200", _A, etag='"a"', if_none_match='"a"')]),
        ("entity-tag", [_TAG_A, one("GET /tubes/1 304", if_none_match='"a"')]),
        ("entity-tag", [one("GET /tubes/1 412", if_none_match='"b"')]),
        ("entity-tag", [one("PUT /tubes/1 200", _A, etag='"old"'), _TAG_A]),
        ("if-match", [_TAG_A, _WRITTEN]),
        ("if-match", [_TAG_A, _SECOND, _THIRD]),
        ("if-match", [*_UNSTABLE, *_UNSTABLE]),
        ("if-match", [_TAG_A, one("DELETE /tubes/1 204", if_match='"x"')]),
        ("if-match", [_TAG_A, _SECOND, one("PATCH /tubes/1 200", _C, _C, if_match='"x", "a"')]),
        ("if-match", [_TAG_A, one("PATCH /tubes/1 412", body=_B, if_match='"x"'), _TAG_B]),
        ("if-match", [_TAG_A, one("DELETE /tubes/1 412", if_match='"x"'), one("GET /tubes/1 404")]),
        ("if-match", [_TAG_A, one("PUT /tubes/1 412", body=_B, if_match='"a"'), _TAG_A]),
        ("if-match", [one(_GET, _A, etag='W/"a"'), one("PUT /tubes/1 200", _B, _B, if_match='"x", W/"y"')]),
    ],
)  # fmt: skip
def test_faults_are_found_wherever_they_come(tmp_path, requirement, exchanges):
    assert _broken(tmp_path, exchanges) == {
        f"description/{requirement}" if requirement != "length" else "http/head-length"
    }


@pytest.mark.parametrize("status", [500, 502, 504])
def test_a_head_that_crashes_is_a_crash_alone(tmp_path, status):
    found = _all(tmp_path, [_READ, one(f"HEAD /tubes/1 {status}"), _READ])
    assert (set(found) & {"description/head", "robustness/no-server-error"}) == {"robustness/no-server-error"}


def test_a_declared_405_is_judged_by_its_schema(tmp_path):
    error = {"application/json": {"schema": {"type": "object", "required": ["error"]}}}
    for body, blamed in (({"error": "no"}, set()), ({"detail": "no"}, {"description/method-refused"})):
        assert _broken(tmp_path, [one("DELETE /config 405", body, allow="GET, PUT")], error=error) == blamed
        assert _broken(tmp_path, [one("DELETE /config 405", body, allow="GET, PUT")]) == set()


@pytest.mark.parametrize(
    ("allow", "broken"),
    [
        ("GET, PUT", set()),
        ("GET", {"description/allow"}),  # a router that looks at one of two routes
        ("GET, PUT, MOVE", {"description/allow"}),
        ("GET, PUT, DELETE", {"description/allow", "http/allow-agrees"}),
        (None, {"http/allow"}),
    ],
)
def test_allow_of_a_refusal_lists_the_methods_of_the_path(tmp_path, allow, broken):
    found = _all(tmp_path, [one("DELETE /config 405", {"error": "no"}, **({"allow": allow} if allow else {}))])
    assert found & {"description/allow", "http/allow", "http/allow-agrees"} == broken


_TEXT = "Zo\u00eb e\u0301 \U0001f916"


def _wrote(seen, before="old", line="PUT /tubes/1 200"):
    """Return a read, a write of a text and the read after it."""
    write = one(line, {}, {"label": _TEXT}, content_type="application/json")
    return [one(_GET, {"label": before}), write, one(_GET, {"label": seen})]


@pytest.mark.parametrize(
    "seen",
    [_TEXT, "old", "Zo\u00eb \u00e9 \U0001f916", f" {_TEXT.upper()}", "zoe e", "zoe-e", f"{_TEXT} (2)", None, 7],
    ids=["same", "later", "composed", "case and space", "ASCII alone", "slug", "not taken", "null", "a number"],
)
def test_texts_that_read_as_they_were_written(tmp_path, seen):
    assert "description/written-is-read" not in _all(tmp_path, _wrote(seen))


@pytest.mark.parametrize(
    "seen",
    ["Zo\u00eb", "Zo\u00eb e\u0301 ", _TEXT.encode().decode("latin-1"), ""],
    ids=["cut", "no emoji", "Latin-1", "empty"],
)
def test_texts_that_read_in_another_way(tmp_path, seen):
    assert "description/written-is-read" in _all(tmp_path, _wrote(seen))
    assert "description/written-is-read" not in _all(tmp_path, _wrote(seen, line="PUT /tubes/1 422"))


def test_a_text_that_an_earlier_write_gave_may_come_late(tmp_path):
    earlier = one("PUT /tubes/1 200", {}, {"label": "first"}, content_type="application/json")
    assert "description/written-is-read" not in _all(tmp_path, [earlier, *_wrote("first")])
    assert "description/written-is-read" in _all(tmp_path, [earlier, *_wrote("fir")])
