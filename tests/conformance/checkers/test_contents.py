"""Parts, digests, files and conditions: right sequences of exchanges in several styles, and wrong ones."""

import hashlib
from base64 import b64encode

import pytest
from exchanges import broken
from small_device import contract_of, described

from conformance.documents.files import file_of
from conformance.transport.exchange import Exchange, Request, Response

_BASE, _OCTETS = "http://device:80", "application/octet-stream"
_FILE = {"description": "", "content": {_OCTETS: {"schema": {}}}}
_PNG = {"image/png": {"schema": {}}}
_TEXT = {"description": "", "content": {"text/plain": {"schema": {}}}}
_JSON = {"description": "", "content": {"application/json": {"schema": {}}}}
_IF = [{"in": "header", "name": name, "schema": {"type": "string"}} for name in ("If-Match", "If-None-Match")]
_CHANGES = {"parameters": _IF, "responses": {"200": _JSON, "412": _JSON, "428": _JSON}}
_PATHS = {
    "/map": {
        "get": {"responses": {"200": _FILE, "206": _FILE}},
        "put": {"requestBody": {"content": {_OCTETS: {"schema": {}}}}, "responses": {"200": _JSON}},
    },
    "/photo": {
        "get": {"responses": {"200": {"description": "", "content": {**_PNG, "image/jpeg": {"schema": {}}}}}},
        "put": {"requestBody": {"content": {**_PNG, "image/jpeg": {"schema": {}}}}, "responses": {"200": _JSON}},
    },
    "/icon": {
        "get": {"responses": {"200": {"description": "", "content": _PNG}}},
        "put": {"requestBody": {"content": _PNG}, "responses": {"200": _JSON}},
    },
    **{
        path: {
            "get": {"summary": said, "responses": {"200": _TEXT}},
            "put": {"requestBody": {"content": {"text/plain": {"schema": {}}}}, "responses": {"200": _JSON}},
        }
        for path, said in (("/label", "The octets that were stored."), ("/note", "The note."))
    },
    "/state": {"get": {"responses": {"200": _JSON}}, "put": _CHANGES},
    "/free": {"get": {"responses": {"200": _JSON}}, "put": {**_CHANGES, "parameters": []}},
}
_WHOLE = b"0123456789"


def _one(line, body=b"", sent=b"", *, kind=_OCTETS, at_s=0.0, **fields):
    """Return an exchange: "GET /map 200", its content, that of the request, and fields; ``_name`` is the response's."""
    method, target, status = line.split()
    back = [(name[1:].replace("_", "-"), text) for name, text in fields.items() if name.startswith("_")]
    asked = [(name.replace("_", "-"), text) for name, text in fields.items() if not name.startswith("_")]
    types = {"/label": "text/plain", "/note": "text/plain", "/icon": "image/png", "/photo": "image/jpeg"}
    asked += [("Content-Type", types.get(target, _OCTETS))] if sent else []
    request = Request(method, _BASE + target, (("Host", "device:80"), *asked), sent)
    headers = tuple([*back, ("Content-Type", kind)] if body else back)
    return Exchange(request, Response(int(status), headers, body, 1.0, received_s=at_s))


def _broken(tmp_path, exchanges):
    ids = ("http/range", "description/digest", "description/written-is-read", "description/entity-tag")
    named = {*ids, "description/problem-status", "description/if-match", "description/required", "rest-formats/vary"}
    return broken(contract_of(tmp_path, described(_PATHS, "3.1.0")), _BASE, exchanges) & named


def _digest(octets):
    return f"sha-256=:{b64encode(hashlib.sha256(octets).digest()).decode()}:"


_GET = _one("GET /map 200", _WHOLE, _etag='"a"')
_OTHER = _one("GET /map 200", b"9876543210", _etag='"b"')
_PART = _one("GET /map 206", b"2345", range="bytes=2-5", _content_range="bytes 2-5/10")
_SHIFTED = _one("GET /map 206", b"3456", range="bytes=2-5", _content_range="bytes 2-5/10")
_PUT = _one("PUT /map 200", b"{}", _WHOLE, kind="application/json")
_PUT_NEXT = _one("PUT /map 200", b"{}", b"next", kind="application/json")


def _stored(path, *pairs, kind="text/plain"):
    """Return files that are stored one after another, and read."""
    steps = [(_one(f"PUT {path} 200", b"{}", sent, kind="application/json"), got) for sent, got in pairs]
    return [one for put, got in steps for one in (put, _one(f"GET {path} 200", got, kind=kind))]


_IMAGES = [file_of("image/png", bytes(range(start, 200))) for start in (0, 1)]
_JPEG = file_of("image/jpeg", bytes(range(200)))
_WRITTEN_ANEW = [(image, file_of("image/png", b"\7" * 100)) for image in _IMAGES]
_AS_TEXT = [(image, image.decode("utf-8", "replace").encode()) for image in _IMAGES]
_HALF = [(image, image[: len(image) // 2]) for image in _IMAGES]
_OTHER_PIXEL = [(image, image.replace(b"\x90", b"?")) for image in _IMAGES]
_CHANGED_ENDS = ((b"a\nb", b"a\r\nb"), (b"c\nd", b"c\r\nd"))
_CUT = ((b"a\nb c", b"a\nb"), (b"c\nd e", b"c\nd"))
_IF_RANGE = {"range": "bytes=2-2", "_etag": '"a"', "_content_range": "bytes 2-2/10"}


def _put(sent):
    return _one("PUT /map 200", sent=sent)


_GET_LATE = _one("GET /map 200", _WHOLE, at_s=9.0)
_PHOTOS = [_one("GET /photo 200", file_of(kind, b"x"), kind=kind, accept=kind) for kind in ("image/png", "image/jpeg")]
_STATE = _one("GET /state 200", b"{}", kind="application/json", _etag='"s"')
_STATE_NOW = _one("GET /state 200", b"{ }", kind="application/json", _etag='"t"')
_STALE = _one("GET /state 304", if_none_match='"r"', _etag='"r"')


@pytest.mark.parametrize(
    "exchanges",
    [
        [_GET, _PART, _GET],
        # A part of what is asked for, and more than that.
        [_GET, _one("GET /map 206", b"89", range="bytes=-4", _content_range="bytes 8-9/10"), _GET],
        [_GET, _one("GET /map 206", b"6789", range="bytes=8-", _content_range="bytes 6-9/10"), _GET],
        # The content has changed in between, by another client or by itself.
        [_GET, _SHIFTED, _OTHER, _GET],
        [_GET, _SHIFTED, _PUT, _GET],
        # The length need not be known, and a part of another coding is not compared.
        [_GET, _one("GET /map 206", b"2345", range="bytes=2-5", _content_range="bytes 2-5/*"), _GET],
        [_GET, _one("GET /map 206", b"zip", range="bytes=0-2", _content_range="bytes 0-2/9", _content_encoding="gzip")],
        # A range is for the server to ignore; a part for the current copy.
        [_GET, _one("GET /map 200", _WHOLE, range="bytes=2-5", _etag='"a"'), _GET],
        [
            _GET,
            _one("GET /map 206", b"2", if_range='"a"', range="bytes=2-2", _etag='"a"', _content_range="bytes 2-2/10"),
        ],
        # Digests of this content, of algorithms that nobody knows, and of a whole that this is a part of.
        [_one("GET /map 200", _WHOLE, _repr_digest=_digest(_WHOLE), _digest=f"sha-256={_digest(_WHOLE)[9:-1]}")],
        [_one("GET /map 200", _WHOLE, _content_digest="md5=:AAAA:, unixsum=:AA==:")],
        [_one("GET /map 206", b"23", range="bytes=2-3", _content_range="bytes 2-3/10", _repr_digest=_digest(_WHOLE))],
        # A file that was replaced by another one, or refused, or will be stored later.
        [_PUT, _one("PUT /map 200", b"{}", b"9876543210", kind="application/json"), _OTHER],
        [_one("PUT /map 415", b"{}", b"x"), _GET],
        [_one("PUT /map 202", b"{}", b"x"), _GET],
        [_one("PUT /map 200", b'{"sha256": "see there", "size": 1}', b"x", kind="application/json")],
        # Another client sends a file; and a file is there a while after it was replaced.
        [_PUT, _OTHER, _PUT_NEXT, _one("GET /map 200", b"next")],
        [_GET, _PUT_NEXT, _GET, _PUT, _GET, _PUT_NEXT, _GET],
        # A state that changed just then; a copy that is current; a condition that nobody declares.
        [_STATE, _STALE, _STATE_NOW],
        [_STATE, _one("GET /state 304", if_none_match='W/"s"', _etag='"s"'), _STATE],
        [_STATE, _one("PUT /state 428"), _one("PUT /state 412", if_none_match="*"), _STATE],
        [_STATE, _one("PUT /state 412", if_match='"s"', if_none_match='"s"'), _STATE],
        [_one("GET /free 200", b"{}", _etag='"s"'), _one("PUT /free 200"), _one("PUT /free 200", if_none_match="*")],
        # Lines of a text may end in several ways where no description says more.
        _stored("/note", *_CHANGED_ENDS),
        # An image may be written anew.
        _stored("/icon", *_WRITTEN_ANEW, kind="image/png"),
        _stored("/photo", (_JPEG, _JPEG), kind="image/jpeg"),
        _stored("/photo", (_JPEG, _IMAGES[0]), kind="image/png"),
        # The other format is declared, and never sent.
        [_PHOTOS[1], _PHOTOS[1]],
        # A problem need not state a status.
        [_one("GET /state 404", b"{}", kind="application/problem+json")],
        [_one("GET /state 404", b'{"status": 404}', kind="application/problem+json")],
        # Nobody knows whether something was there.
        [_one("PUT /state 200", if_none_match="*"), _one("PUT /state 200")],
        [_STATE, _one("PUT /state 200", if_match='"s"'), _one("PUT /state 200")],
    ],
)
def test_right_devices_are_not_blamed(tmp_path, exchanges):
    assert _broken(tmp_path, exchanges) == set()


@pytest.mark.parametrize(
    ("requirement", "exchanges"),
    [
        ("http/range", [_GET, _SHIFTED, _GET]),
        ("http/range", [_GET, _one("GET /map 206", b"0123", range="bytes=-4", _content_range="bytes 0-3/10"), _GET]),
        ("http/range", [_GET, _one("GET /map 206", b"23", range="bytes=2-3", _content_range="bytes 2-3/2"), _GET]),
        ("description/entity-tag", [_one("GET /map 206", b"2", if_range='"z"', **_IF_RANGE)]),
        ("description/entity-tag", [_one("GET /map 206", b"2", if_range='"z"', **{**_IF_RANGE, "_etag": 'W/"a"'})]),
        ("description/written-is-read", _stored("/label", *_CHANGED_ENDS)),
        ("description/written-is-read", _stored("/note", *_CUT)),
        ("description/written-is-read", _stored("/photo", (_JPEG, _JPEG), kind="image/png")),
        *(
            ("description/written-is-read", _stored("/icon", *pairs, kind="image/png"))
            for pairs in (_AS_TEXT, _HALF, _OTHER_PIXEL)
        ),
        ("rest-formats/vary", _PHOTOS),
        ("description/entity-tag", [_STATE, _STALE, _STATE]),
        ("description/digest", [_one("GET /map 200", _WHOLE, _repr_digest=_digest(b"other"))]),
        ("description/digest", [_one("GET /map 200", _WHOLE, _content_digest=f"{_digest(_WHOLE)[:-3]}A=:")]),
        (
            "description/digest",
            [_one("PUT /map 200", b'{"sha256": "%s"}' % (b"0" * 64), b"x", kind="application/json")],
        ),
        ("description/written-is-read", [_PUT, _OTHER, _PUT_NEXT, _one("GET /map 200", b"nex")]),
        # The first file stays, whatever is uploaded.
        ("description/written-is-read", [_GET, _put(b"x"), _GET, _put(b"y"), _GET, _GET_LATE]),
        ("description/if-match", [_STATE, _one("PUT /state 200", if_none_match="*")]),
        ("description/if-match", [_STATE, _one("PUT /state 200", if_match='W/"s"')]),
        ("description/problem-status", [_one("GET /state 404", b'{"status": 400}', kind="application/problem+json")]),
        ("description/if-match", [_STATE, _one("PUT /state 200")]),
    ],
)
def test_faults_are_found(tmp_path, requirement, exchanges):
    assert _broken(tmp_path, exchanges) == {requirement}
