"""What was written, created or deleted: a device that forgets is blamed, and none whose things change or end."""

import pytest
from exchanges import exchange, failed
from small_device import answers, contract_of, described

from conformance.checkers.rest import RestCheckers
from conformance.transport.exchange import NoAnswer, Unanswered

BASE = "http://device:8000/api"
_MEMBERS = {
    "id": {"type": "string"}, "name": {"type": "string"}, "rank": {"type": "integer"}, "state": {"type": "string"},
    "is_default": {"type": "boolean"}, "phase": {"enum": ["queued", "running", "done", "cancelled", "archived"]},
}  # fmt: skip
_MEMBERS["tag_id"] = {"type": ["string", "null"]}
_MEMBERS["laps"] = {"type": "integer", "description": "How many; it never falls."}
_OWN = {"built": {"type": "string", "readOnly": True}, "serial": {"type": "integer", "readOnly": True}}
_JOB = {"type": "object", "properties": {**_MEMBERS, **_OWN, "kept": {"type": "boolean", "default": False}}}
_UUID = {"name": "id", "in": "path", "required": True, "schema": {"type": "string", "format": "uuid"}}
_BODY = {"required": True, "content": {"application/json": {"schema": _JOB}}}
_ID = {"name": "id", "in": "path", "required": True, "schema": {"type": "string"}}
_ONCE = {**_ID, "schema": {"type": "string", "description": "Never given twice."}}
_OK = {"200": answers(_JOB), "201": answers(_JOB), "204": {"description": "done"}, "4XX": {"description": "refused"}}
_FOR_GOOD = {"204": {"description": "It is gone: reading or deleting it again is 404."}, "404": {"description": "none"}}
_PATHS = {
    "/jobs": {
        "post": {"requestBody": _BODY, "responses": _OK},
        "get": {
            "parameters": [{"name": "rank", "in": "query", "schema": {"type": "integer"}}],
            "responses": {"200": answers({"type": "array", "items": _JOB})},
        },
    },
    "/jobs/{id}": {
        "parameters": [_ID],
        "get": {"responses": _OK},
        "put": {"requestBody": _BODY, "responses": _OK},
        "patch": {"requestBody": _BODY, "responses": _OK},
        "delete": {"summary": "Delete a job, and its label and its parts with it; its report stays.", "responses": _OK},
    },
    **{
        f"/jobs/{{id}}/{name}": {
            "parameters": [_ID],
            "get": {"responses": _OK},
            "put": {"requestBody": _BODY, "responses": _OK},
            "delete": {"responses": _OK},
        }
        for name in ("label", "report")
    },
    "/jobs/{id}/parts": {
        "parameters": [_ID],
        "get": {"responses": {"200": answers({"type": "array"}), "404": {"description": "no such job"}}},
    },
    "/jobs/{id}/start": {
        "parameters": [_ID],
        "post": {
            "summary": "409 while another job is `running`, and 409 unless the job is queued. Archived is final.",
            "responses": {**_OK, "409": {"description": "no"}},
        },
    },
    "/tags": {"post": {"requestBody": _BODY, "responses": _OK}},
    "/tags/{id}": {
        "parameters": [_ONCE],
        "get": {"responses": _OK},
        "delete": {"responses": {**_OK, "404": {"description": "no such tag"}}},
    },
    "/jobs/{id}/cancel": {"parameters": [_ID], "post": {"responses": {**_OK, "409": {"description": "ended"}}}},
    "/jobs/{id}/retry": {
        "parameters": [_ID],
        "post": {"responses": {**_OK, "409": {"description": "Not ended. Nothing changes."}}},
    },
    "/keys": {"post": {"requestBody": _BODY, "responses": _OK}},
    "/keys/{id}": {"parameters": [_UUID], "get": {"responses": _OK}, "delete": {"responses": _FOR_GOOD}},
    "/notes/{id}": {
        "parameters": [_ID],
        "get": {"summary": "Read a note; its `rank` never falls.", "responses": _OK},
        "patch": {"requestBody": {"content": {"application/merge-patch+json": {"schema": _JOB}}}, "responses": _OK},
    },
    "/drafts/{id}": {
        "parameters": [_ID],
        "get": {"summary": "The published job.", "responses": _OK},
        "put": {"requestBody": _BODY, "responses": _OK},
    },
    "/reset": {"post": {"responses": _OK}},
    "/mode": {"get": {"responses": _OK}, "put": {"requestBody": _BODY, "responses": _OK}},
}
GONE, THERE, READ, DEFAULTS, KEEPS = (
    f"description/{name}"
    for name in ("deleted-is-gone", "created-is-there", "written-is-read", "defaults", "refused-keeps")
)  # fmt: skip
PATCH, OWN, STATES = (f"description/{name}" for name in ("patch", "read-only", "states"))


def _below(method, status=200, name="label"):
    return method, f"/jobs/1/{name}", {"name": "a"} if method == "PUT" else None, status, {} if status == 200 else None


def _parts():
    return "GET", "/jobs/1/parts", None, 200, []


def _started(id_):
    running = {"id": id_, "phase": "running"}
    return [("POST", f"/jobs/{id_}/start", None, 200, running), ("GET", f"/jobs/{id_}", None, 200, running)]


def _tag():
    return "POST", "/tags", {"name": "a"}, 201, {"id": "1", "name": "a"}


def _job(id_, name="a", rank=1, **more):
    return {"id": id_, "name": name, "rank": rank, **more}


def _post(id_, status=201, **values):
    return "POST", "/jobs", {"name": "a", "rank": 1, **values}, status, _job(id_, **values)


def _put(id_, status=200, **values):
    return "PUT", f"/jobs/{id_}", {"name": "a", "rank": 1, **values}, status, _job(id_, **values)


def _patch(id_, status=200, **values):
    return "PATCH", f"/jobs/{id_}", values, status, _job(id_, **values)


def _get(id_, status=200, **values):
    return "GET", f"/jobs/{id_}", None, status, _job(id_, **values)


def _delete(id_, status=204):
    return "DELETE", f"/jobs/{id_}", None, status, None


_NO_TAG = ("DELETE", "/tags/1", None, 204, None)
_U1, _U2 = (f"3fa85f64-5717-4562-b3fc-2c963f66af0{number}" for number in (1, 2))


def _key(id_, **sent):
    return "POST", "/keys", {"name": "a", **sent}, 201, _job(id_)


_KEPT = ("POST", "/jobs", {"name": "a"}, 201, _job("2", kept=True))
_KEY_GONE = ("DELETE", f"/keys/{_U1}", None, 204, None)
_NULLED = ("PATCH", "/notes/1", {"name": None}, 200, _job("1"))


def _jobs(query, *jobs):
    return "GET", f"/jobs{query}", None, 200, list(jobs)


def _note(**values):
    return "GET", "/notes/1", None, 200, _job("1", **values)


_REFUSED = ("PATCH", "/jobs/9", {"rank": "x"}, 400, None)
_RESET = ("POST", "/reset", None, 204, None)
_MODE = ("PUT", "/mode", {"name": "home"}, 200, {"name": "home"})
_CANCEL = ("POST", "/jobs/1/cancel", None, 200, _job("1"))
_BY_HAND = ("RAW", "", None, None, None)
_LOST = ("DELETE", "/jobs/2", None, None, None)


def _cancel(status=200, act="cancel", **values):
    return "POST", f"/jobs/1/{act}", None, status, _job("1", **values)


def _status(value):
    return _get("1", phase=value)


def _set(status=200, **values):
    return "PUT", "/mode", values, status, values


def _mode(**values):
    return "GET", "/mode", None, 200, values


_CANCELLED = _cancel(phase="cancelled")
# Another thing whose name and rank read as written for ten seconds.
_LASTING = [_put("8", rank=5, name="c"), 10.0, _get("8", rank=5, name="c")]
_LABEL, _NO_LABEL = _below("PUT", 201), _below("DELETE", 204)


def _tagged(id_, shown=None):
    """Return the creation of a job with a reference to the tag, and the read of it."""
    job = _job(id_, tag_id=shown)
    return [
        ("POST", "/jobs", {"name": "a", "rank": 1, "tag_id": "1"}, 201, job),
        ("GET", f"/jobs/{id_}", None, 200, job),
    ]


#: What is sent, one second after each other or after so many, and the requirement that is broken.
BROKEN = {
    "deleted, and read": ([_post("1"), _delete("1"), 5.0, _get("1")], GONE),
    "references to a tag that is there are lost": ([_tag(), *_tagged("2"), *_tagged("3")], READ),
    "a label is deleted, and read": ([_LABEL, _NO_LABEL, 4.0, _below("GET")], GONE),
    "parts outlive their job": ([_delete("1"), _get("1", 404), 4.0, _parts()], GONE),
    "a rank falls": (
        [("GET", "/notes/1", None, 200, {"rank": 5}), ("GET", "/notes/1", None, 200, {"rank": 4})], STATES,
    ),
    "told archived, and then queued": ([_cancel(phase="archived"), _cancel(act="retry", phase="queued")], STATES),
    "a cancelled job is started": (
        [_status("cancelled"), ("POST", "/jobs/1/start", None, 200, {"id": "1", "phase": "running"})], STATES,
    ),
    "refused, and cancelled": ([_status("running"), _cancel(409), _status("cancelled")], STATES),
    "laps fall": ([_get("1", laps=5), _get("1", laps=3)], STATES),
    "two run where one may": (
        [_get("1", phase="running"), *_started("2"), _get("1", phase="running")], STATES,
    ),
    "a label outlives its job": ([_post("1"), _LABEL, _delete("1"), 4.0, _below("GET")], GONE),
    "a tag is deleted twice": ([_NO_TAG, ("GET", "/tags/1", None, 404, None), _NO_TAG], GONE),
    "a key is marked, which has to be gone by the description": (
        [_key(_U1), _KEY_GONE, 5.0, ("GET", f"/keys/{_U1}", None, 200, {"id": _U1, "active": False})], GONE,
    ),
    "an identifier is given twice": ([_tag(), ("DELETE", "/tags/1", None, 204, None), _tag()], THERE),
    "deleted where another one is gone": ([_delete("2"), _get("2", 404), _delete("1"), 5.0, _get("1")], GONE),
    "deleted where another one goes": ([_delete("1"), 5.0, _get("1"), _delete("2"), _get("2", 404)], GONE),
    "deleted after an action": ([_post("1"), _CANCEL, _delete("1"), 4.0, _get("1")], GONE),
    "deleted, and another one created": ([_put("1", 201), _delete("1"), _post("2"), 3.0, _get("1")], GONE),
    "created, and never there": ([*_LASTING, _post("1"), 4.0, _get("1", 404)], THERE),
    "created, and another one lasts": (
        [_post("1"), _post("8", name="b"), 4.0, _get("1", 404), _get("8", name="b")], THERE,
    ),
    "created, and the mode was set": ([*_LASTING, _post("1"), _MODE, 4.0, _get("1", 404)], THERE),
    "created, and a raw request": ([*_LASTING, _post("1"), _BY_HAND, 4.0, _get("1", 404)], THERE),
    "created after a refusal": ([*_LASTING, _REFUSED, _post("1"), 4.0, _get("1", 410)], THERE),
    "created under a name of the client's": ([*_LASTING, _put("1", 201), 4.0, _get("1", 404)], THERE),
    "lost after another's creation": (
        [*_LASTING, _put("1", rank=7), _get("1", rank=7), _post("2"), _get("1"), _get("1")], READ,
    ),
    "lost after a refusal": (
        [*_LASTING, _patch("1", rank=7), _get("1", rank=7), _REFUSED, _get("1", rank=3), _get("1", rank=3)], READ,
    ),
    "never written": ([*_LASTING, _patch("1", name="b"), 5.0, _get("1"), _get("1")], READ),
    "one member of a PATCH before": (
        [
            *[*_LASTING, _patch("1", name="b"), _get("1", name="b"), _patch("1", rank=2)],
            *[_get("1", rank=2), _get("1", rank=2)],
        ],
        READ,
    ),
    "a serial number that changes by PUT": ([_get("1", serial=7), _put("1"), _get("1", serial=8)], OWN),
    "a member of the device's that PUT writes": (
        [_get("1", built="2026"), _put("1", built="roaas-own"), _get("1", built="roaas-own")], OWN,
    ),
    "a member of the device's that PATCH writes": (
        [_get("1", built="2026"), _patch("1", built="roaas-own"), _get("1", built="roaas-own")], OWN,
    ),
    "a member of the device's that POST writes": ([_post("1", built="roaas-own"), _get("1", built="roaas-own")], OWN),
    "null without effect": ([_note(name="a"), _NULLED, _note(name="a")], PATCH),
    "a UUID twice": ([_key(_U1), _KEY_GONE, _key(_U1)], THERE),
    "a list has what was deleted": ([_post("1"), _delete("1"), _get("1", 404), 5.0, _jobs("", _job("1"))], GONE),
    "a filtered list has what was deleted": (
        [_post("1"), _post("2"), _delete("2"), _get("2", 404), 5.0, _jobs(""), _jobs("?rank=1", _job("2"))], GONE,
    ),
    "a list has what was deleted, at last": (
        [_post("1"), _delete("1"), 5.0, _get("1", 404), _jobs("?rank=1"), _jobs("", _job("9"), _job("1"))], GONE,
    ),
    "a refused text is set": ([_mode(name="home"), _set(422, name="roaas 1", rank="x"), _mode(name="roaas 1")], KEEPS),
    "a refused number is set, twice": (
        [_mode(rank=1), _set(401, rank=2), _mode(rank=2), _set(401, rank=3), _mode(rank=3)], KEEPS,
    ),
    "a text is set by a stale condition": (
        [_get("1"), _patch("1", 412, name="roaas 1"), _get("1", name="roaas 1")], KEEPS,
    ),
    "deleted, and refused": ([_get("1"), _delete("1", 403), _get("1", 404)], KEEPS),
    "cancelled goes on": (
        [_status("running"), _CANCELLED, _status("cancelled"), _RESET, _status("cancelled"), _status("done")], STATES,
    ),
    "cancelled is told and not so": ([_status("running"), _CANCELLED, 4.0, _status("running")], STATES),
    "cancelled is told, and it is done": (
        [_status("running"), _CANCELLED, _status("running"), _status("done")], STATES,
    ),
    "cancelled goes on after a refusal": ([_CANCELLED, _status("cancelled"), _REFUSED, _status("running")], STATES),
    "cancelled goes on after another's creation": (
        [_CANCELLED, _status("cancelled"), _post("2"), _status("queued")], STATES,
    ),
    "done is cancelled": ([_status("done"), _CANCELLED], STATES),
    "done is cancelled without a word": (
        [_status("done"), ("POST", "/jobs/1/cancel", None, 204, None), _status("cancelled")], STATES,
    ),
    "done is cancelled by a refusal": ([_status("done"), _cancel(409), _status("cancelled")], STATES),
    "done is cancelled by itself": ([_status("done"), _status("cancelled")], STATES),
    "a start that is told and not so": (
        [_status("queued"), _cancel(act="retry", phase="running"), 4.0, _status("queued")], STATES,
    ),
    "a default that is not applied": ([_post("1"), _KEPT, _post("3"), _KEPT], DEFAULTS),
}  # fmt: skip
#: The same for right devices.
RIGHT = {
    "parts of a job that is not gone for sure": [_delete("1"), 4.0, _parts()],
    "parts of another job": [_delete("1"), _get("1", 404), 4.0, ("GET", "/jobs/2/parts", None, 200, [])],
    "told queued, and then archived": [_cancel(act="retry", phase="queued"), _cancel(phase="archived")],
    "laps of a job that is put again, and of two": [_get("1", laps=5), _put("1"), _get("1", laps=0), _get("2", laps=3)],
    "one runs when the other one has ended": [
        _get("1", phase="running"), *_started("2"), _get("1", phase="done"), _get("2", phase="running"),
    ],
    "a label that DELETE resets": [_below("PUT", 204), _NO_LABEL, 4.0, _below("GET")],
    "a label that is put again": [_LABEL, _NO_LABEL, _LABEL, 4.0, _below("GET")],
    "a report that stays": [_post("1"), _below("PUT", 201, "report"), _delete("1"), 4.0, _below("GET", 200, "report")],
    "refused, and all as before": [_mode(name="home"), _set(422, name="roaas 1"), _mode(name="home")],
    "refused, and another value": [_mode(rank=1), _set(422, rank=7), _mode(rank=2)],
    "refused, and set by another request": [
        *(_mode(name="a"), _set(422, name="roaas 1"), _set(name="roaas 1"), _mode(name="roaas 1")),
    ],
    "refused by a proxy that waited": [_mode(name="a"), _set(408, name="roaas 1"), _mode(name="roaas 1")],
    "a reference to a tag that is gone": [_tag(), _NO_TAG, *_tagged("2"), *_tagged("3")],
    "a reference that is lost once": [_tag(), *_tagged("2"), *_tagged("3", "1")],
    "a refused DELETE of what is not there": [_delete("1", 404), _get("1", 404)],
    "a job that runs": [_status("queued"), _cancel(act="retry", phase="running"), _status("running"), _status("done")],
    "a job that is cancelled later": [_status("running"), _CANCELLED, _status("running"), _status("cancelled")],
    "cancelled twice": [_CANCELLED, _status("cancelled"), _CANCELLED, _status("cancelled")],
    "a cancelled job that is put away": [_CANCELLED, _status("cancelled"), 9.0, _status("archived")],
    "a cancelled job that is retried": [
        *(_CANCELLED, _status("cancelled"), _cancel(act="retry", phase="queued"), _status("running")),
    ],
    "a done job that is retried, and refused before": [
        *(_status("done"), _cancel(409), _status("done"), _cancel(act="retry", phase="queued"), _status("queued")),
    ],
    "a timetable": [_status("done"), 9.0, _status("running"), 9.0, _status("done")],
    "a cancelled job that PUT changes": [
        *(_CANCELLED, _status("cancelled"), _put("1", phase="queued"), _status("queued")),
    ],
    "a cancelled job, and all is as before": [_CANCELLED, _status("cancelled"), _RESET, _status("queued")],
    "a member of the device's that changes": [_get("1", built="2026"), _put("1", built="x"), _get("1", built="2027")],
    "a member of the device's that is sent back": [
        *(_get("1", serial=71234), _put("1", serial=71234), _get("1", serial=71234)),
    ],
    "a serial number of another thing in its place": [
        *(_get("1", serial=7), _delete("1"), _put("1", 201), _get("1", serial=8)),
    ],
    "null removes": [_note(name="a"), _NULLED, ("GET", "/notes/1", None, 200, {"id": "1"})],
    "null, and written again": [
        *(_note(name="a"), _NULLED, ("PATCH", "/notes/1", {"name": "a"}, 200, _job("1")), _note(name="a")),
    ],
    "a list that is late": [_post("1"), _delete("1"), _get("1", 404), _jobs("", _job("1")), 5.0, _jobs("")],
    "a list of the deleted": [_post("1"), _delete("1"), _get("1", 404), 5.0, _jobs("", _job("1", state="deleted"))],
    "a list with what was created again": [
        *(_post("1"), _delete("1"), _get("1", 404), _put("1", 201), 5.0, _jobs("", _job("1"))),
    ],
    "a PUT of what another request has ended": [
        *(_put("1", 201), _get("1"), _put("2", 201), _get("1", 404), _put("1", 201)),
    ],
    "a UUID of the client's twice": [_key(_U1, id=_U1), _KEY_GONE, _key(_U1, id=_U1)],
    "two UUIDs": [_key(_U1), _KEY_GONE, _key(_U2)],
    "a name twice": [_post("1"), _delete("1"), _post("1")],
    "a default once": [_KEPT, ("POST", "/jobs", {"name": "a"}, 201, _job("3", kept=False)), _KEPT],
    "another value than the default that was sent": [_post("1", kept=True), _post("2", kept=True)],
    "another one is the default one": [
        *(_put("8", name="c", is_default=True), 10.0, _get("8", name="c", is_default=True)),
        *(_put("1", is_default=True), _get("1", is_default=True), _put("2", is_default=True)),
        *(_get("1", is_default=False), _get("1", is_default=False), _get("1", is_default=False)),
    ],
    "deleted a moment ago": [_delete("1"), _get("1"), _get("1", 404)],
    "deleted, and always there": [_post("2"), _delete("2"), _get("2", 404), _delete("1"), 5.0, _get("1")],
    "deleted, and marked so": [
        *(_delete("1"), 5.0, _get("1", deleted=True), _get("1", state="archived"), _get("1", phase="cancelled")),
    ],
    "deleted, and put again": [_delete("1"), _put("1", 201), 5.0, _get("1")],
    "deleted, and put in another case": [_delete("a"), _put("A", 201), 5.0, _get("a")],
    "deleted, and created again": [_delete("1"), _post("1"), 5.0, _get("1")],
    "deleted, and all is as before": [_delete("1"), _RESET, 5.0, _get("1")],
    "deleted, and brought back": [_delete("1"), _CANCEL, 5.0, _get("1")],
    "deleted, and put again over a raw socket": [_delete("1"), _BY_HAND, 5.0, _get("1")],
    "a number that was taken as the nearest one": [
        *[*_LASTING, ("PUT", "/jobs/1", {"rank": 99}, 200, {"id": "1", "rank": 9}), 5.0, _get("1", rank=9)],
        _get("1", rank=9),
    ],
    "deleted, and a request got lost": [_delete("1"), _LOST, 5.0, _get("1")],
    "a refused DELETE": [_delete("1", 409), 5.0, _get("1")],
    "a DELETE for later": [_delete("1", 202), 5.0, _get("1")],
    "things that end, and whose identifiers come again": [
        *[_post("8"), 9.0, _get("8"), _post("1"), 4.0, _post("1"), _post("2"), 4.0, _get("2", 404)],
    ],
    "things that end": [_post("8"), _get("8"), _post("1"), 9.0, _get("1", 404)],
    "created, and replaced by another one of its name": [
        *[_post("8", name="b"), _post("1"), _post("2"), _post("3", name="c"), 4.0, _get("1", 404)],
        *[4.0, _get("8", name="b")],
    ],
    "created, and perhaps deleted": [*_LASTING, _post("1"), ("RAW", "DELETE", None, None, None), 4.0, _get("1", 404)],
    "created, and deleted": [*_LASTING, _post("1"), _delete("1"), 5.0, _get("1", 404)],
    "created, and reset": [*_LASTING, _post("1"), _RESET, 5.0, _get("1", 404)],
    "created for later": [*_LASTING, _post("1", 202), 5.0, _get("1", 404)],
    "a name is normalized": [*_LASTING, _put("1", name="A b"), 5.0, _get("1", name="a  B")],
    "a value that expires": [
        *[_put("1", rank=7), _get("1", rank=7), 3.0, _REFUSED, _get("1", rank=0), _get("1", rank=0)],
        *[_put("2", rank=7), _get("2", rank=7), 3.0, _REFUSED, _get("2", rank=0), _get("2", rank=0)],
    ],
    "a value that expires, where zero lasts": [
        *[_put("8", rank=0), 10.0, _get("8", rank=0), _put("1", rank=7), _get("1", rank=7), 3.0, _REFUSED],
        *[_get("1", rank=0), _get("1", rank=0)],
    ],
    "a value that another operation changes": [
        *_LASTING, _put("1", rank=7), _get("1", rank=7), _RESET, _get("1", rank=0), _get("1", rank=0),
    ],
    "a value that a mode changes": [
        *_LASTING, _put("1", rank=7), _get("1", rank=7), _MODE, _get("1", rank=0), _get("1", rank=0),
    ],
    "a value that its action changes": [
        *_LASTING, _put("1", rank=7), _get("1", rank=7), _CANCEL, _get("1", rank=0), _get("1", rank=0),
    ],
    "a value of the device's": [
        *[_post("8", state="new"), 10.0, _get("8", state="new"), _post("1", state="new"), _get("1", state="new")],
        *[_post("2"), _get("1", state="done"), _get("1", state="done")],
    ],
    "once, by another process": [
        *_LASTING, _put("1", rank=7), _get("1", rank=7), _post("2"), _get("1"), _get("1", rank=7),
    ],
    "written by a PUT after it": [
        *_LASTING, _patch("1", name="b"), _get("1", name="b"), _put("1"), _get("1"), _get("1"),
    ],
    "written at the same time": [
        *[*_LASTING, _put("1", rank=7), 0.0, _put("1", rank=3), _get("1", rank=7), 5.0],
        *[_get("1", rank=7), _get("1", rank=7)],
    ],
}  # fmt: skip


@pytest.fixture(name="contract", scope="module")
def _contract(tmp_path_factory):
    document = described(_PATHS, "3.1.0")
    return contract_of(tmp_path_factory.mktemp("pack"), document)


def _broken(contract, steps):
    """Return what is broken in exchanges one second after each other; a number is another time before the next."""
    checkers, now, after, found = RestCheckers(contract, BASE), 1000.0, 1.0, set()
    for step in steps:
        if isinstance(step, float):
            after = step
            continue
        now, after = now + after, 1.0
        if step[0] == "RAW":
            checkers.forget(deletes=step[1] == "DELETE")
            continue
        attempt = _exchange(step, now)
        if step[3] is None:
            attempt = Unanswered(attempt.request, NoAnswer.TIMEOUT, "no response")
        found |= {case.requirement for case in checkers(attempt) if not case.holds}
    return found & {GONE, THERE, READ, DEFAULTS, KEEPS, PATCH, OWN, STATES}


def _exchange(step, now):
    method, path, sent, status, seen = step
    kind = "application/merge-patch+json" if path.startswith("/notes") else "application/json"
    shown = None if status in {204, 404} else seen
    return exchange(method, BASE + path, status or 200, shown, sent=sent or None, kind=kind, at_s=float(now))


def _doubts(contract, requirement, steps):
    """Return whether the failed cases of a requirement have doubts; steps: second, and the rest as above."""
    cases = failed(contract, BASE, [_exchange(step, now) for now, step in steps])
    return {bool(case.doubt) for case in cases if case.requirement == requirement}


def test_what_is_published_later_is_a_doubt(contract):
    for path, doubts in (("/drafts/1", {True}), ("/jobs/1", {False})):
        put, read = ("PUT", path, {"name": "a", "rank": 7}, 204, None), ("GET", path, None, 200, _job("1"))
        again, shown = ("PUT", path, {"rank": 3}, 204, None), ("GET", path, None, 200, {"id": "1", "rank": 3})
        steps = [(0, put), (5, read), (6, read), (9, again), (20, shown)]
        assert _doubts(contract, READ, steps) == doubts


def test_what_a_refused_operation_cancels_is_no_doubt_if_nothing_may_change_by_the_description(contract):
    for name, doubts in (("start", {True}), ("retry", {True, False})):
        steps = []
        for at, path in ((0, "/jobs/1"), (9, "/jobs/2")):
            running, cancelled = ({"id": path[-1], "phase": phase} for phase in ("running", "cancelled"))
            refused = ("POST", f"{path}/{name}", None, 409, None)
            steps += [(at, ("GET", path, None, 200, running)), (at + 1, refused)]
            steps.append((at + 2, ("GET", path, None, 200, cancelled)))
        assert _doubts(contract, STATES, steps) == doubts


def test_deleted_twice_is_no_doubt_where_the_description_says_how_that_is_answered(contract):
    for made, path, doubts in ((_tag(), "/tags/1", {True}), (_key(_U1), f"/keys/{_U1}", {False})):
        delete = ("DELETE", path, None, 204, None)
        steps = [(0, made), (1, delete), (2, ("GET", path, None, 404, None)), (3, delete)]
        assert _doubts(contract, GONE, steps) == doubts


def test_a_lost_thing_is_a_doubt_until_an_older_one_is_still_there(contract):
    made = [(number, _post(str(number), name=f"job {number}")) for number in range(3)]
    first_is_lost = [*made, (8, _get("0", 404)), (12, _get("2", name="job 2"))]
    assert _doubts(contract, THERE, first_is_lost) == {True}
    second_is_lost = [*made, (8, _get("1", 404)), (12, _get("2", name="job 2")), (12, _get("0", name="job 0"))]
    assert _doubts(contract, THERE, second_is_lost) == {True, False}


@pytest.mark.parametrize("name", BROKEN)
def test_a_device_that_forgets_is_blamed(contract, name):
    steps, requirement = BROKEN[name]
    assert _broken(contract, steps) == {requirement}


@pytest.mark.parametrize("name", RIGHT)
def test_a_device_whose_things_change_or_end_is_not_blamed(contract, name):
    assert _broken(contract, RIGHT[name]) == set()
