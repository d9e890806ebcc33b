"""A device of irrigation zones, right in several styles, and with faults that show between two exchanges."""

import asyncio
import copy
import hashlib
import itertools
import json
import re
import time
from base64 import b64encode
from datetime import UTC, datetime
from functools import partial

import jsonschema
from aiohttp import web
from small_device import REFUSED, answers, described, error

_ID = {"name": "id", "in": "path", "required": True, "schema": {"type": "string"}}
_KEY = {"name": "Idempotency-Key", "in": "header", "schema": {"type": "string", "minLength": 1, "maxLength": 80}}
_MATCH = {"name": "If-Match", "in": "header", "schema": {"type": "string"}}
_NONE_MATCH = {"name": "If-None-Match", "in": "header", "schema": {"type": "string"}}
_BAD = {"4XX": REFUSED}
_WRITABLE = {
    "name": {"type": "string", "minLength": 1, "maxLength": 60},
    "minutes": {"type": "number", "format": "double", "minimum": 0, "maximum": 600},
    "litres": {"type": "integer", "format": "int64", "minimum": 0, "maximum": 2**60},
    "starts": {"type": "string", "format": "date-time"},
    "valves": {"type": "array", "items": {"type": "integer", "minimum": 0, "maximum": 99}, "maxItems": 8},
}
_ROUND = {"valve": {"type": "integer", "minimum": 0, "maximum": 99}, "minutes": {"type": "number", "minimum": 0}}
_ROUND = {"type": "object", "required": ["valve"], "properties": _ROUND, "additionalProperties": False}
_WRITABLE["rounds"] = {"type": "array", "items": _ROUND, "maxItems": 8}
_AREAS, _SORTS = ["front", "back"], ["minutes", "-minutes"]
_WRITABLE["area"] = {"type": "string", "enum": _AREAS}
_QUERY = [
    {"name": name, "in": "query", "schema": {"type": "string", "enum": values}}
    for name, values in (("area", _AREAS), ("sort", _SORTS))
]
_FIRST = {"area": "front", "minutes": 10, "litres": 0, "starts": "2026-01-31T12:00:00Z", "valves": [], "rounds": []}
_SENT = {"type": "object", "required": ["name"], "properties": _WRITABLE, "additionalProperties": False}
_PATCH = {"type": "object", "properties": _WRITABLE, "additionalProperties": False, "minProperties": 1}
_SETTING = {"season": {"enum": ["summer", "winter"]}, "rain_stop": {"type": "boolean"}}
_SETTING["pressure"] = {"type": "number", "minimum": 0, "maximum": 9}
_SETTINGS = {"type": "object", "required": [*_SETTING], "additionalProperties": False, "properties": _SETTING}
_STATES = ["idle", "running", "paused", "done"]
_SAID = "A retry with its key gets the first answer. A request that is refused does not use up its key."
_LOG = "".join(f"{number:04} valve opened\n" for number in range(40)).encode()


def _shape(style):
    own = {"id": {"type": "string", "readOnly": True}, "state": {"enum": _STATES, "readOnly": True}}
    if style.get("counts"):
        own |= {"reads": {"type": "integer", "readOnly": True}, "seen": {"type": "string", "readOnly": True}}
    properties = {**_WRITABLE, **own}
    return {"type": "object", "required": ["id", "name", "state"], "properties": properties}


def _tag(value, style):
    """Return the entity tag of a value, weak in some styles."""
    text = hashlib.sha256(json.dumps(value, sort_keys=True).encode()).hexdigest()[:16]
    return f'W/"{text}"' if style.get("etag") == "weak" else f'"{text}"'


def _of_a_zone(handle):
    """Return a handler that gets the id of a zone; it answers 404 if there is none."""

    async def found(self, request):
        id_ = request.match_info["id"]
        return await handle(self, request, id_) if id_ in self.zones else error(404, "no such zone")

    return found


class Sprinklers:
    """The zones, their map files, the settings and the log.

    Args:
        style: what is free: see `RIGHT`.
        faults: what is wrong: see `FAULTS`.
    """

    def __init__(self, style, faults):
        self.style, self.faults = style, frozenset(faults)
        self.zones, self.maps, self.keys, self.old = {}, {}, {}, {}
        self.issued, self.numbers, self.ticks = set(), itertools.count(1), itertools.count(1)
        self.settings = {"season": "summer", "rain_stop": True, "pressure": 2.5}
        self.cached, self.made, self.areas = None, 0, {}
        self.since_s = float("-inf")
        for name in ("lawn", "roses"):
            self.add({"name": name})

    def has(self, fault):
        return fault in self.faults

    def add(self, body, id_=""):
        id_ = id_ or f"z{next(self.numbers)}"
        self.zones[id_] = {**_FIRST, **body, "id": id_, "state": "idle", "at": 0.0}
        self.areas[id_] = self.zones[id_]["area"]
        self.settle(id_)
        return id_

    def settle(self, id_):
        """Let readers see what was written, in some styles a while later."""
        if not self.style.get("late"):
            return
        before = self.old.get(id_, (0.0, None))[1] if self.old.get(id_, (0.0, None))[0] > time.monotonic() else None
        self.old[id_] = time.monotonic() + self.style["late"], before

    def shown(self, id_, where="item"):
        zone = self.zones.get(id_)
        if zone is None:
            return None
        if zone["state"] == "running" and time.monotonic() - zone["at"] > self.style.get("takes", 20):
            zone["state"] = "done"
        value = {name: copy.copy(one) for name, one in zone.items() if name != "at"}
        if self.style.get("counts"):
            zone["reads"] = zone.get("reads", 0) + 1
            value |= {"reads": zone["reads"], "seen": datetime.now(UTC).isoformat()}
        if self.has("the list shows another state") and where == "list" and value["state"] == "paused":
            value["state"] = "running"
        if self.has("the list shows the first valve") and where == "list":
            value["valves"] = value["valves"][:1]
        return value

    def known(self, value):
        return {name: one for name, one in value.items() if name not in {"reads", "seen"}}

    def headers(self, value):
        if self.style.get("etag") == "none":
            return {}
        tag = _tag(self.known(value), self.style)
        self.issued.add(tag)
        return {"ETag": tag}

    # --- conditions ---

    def refused(self, request, id_):
        """Return the refusal of a write for its conditions, or None."""
        wanted, value = request.headers.get("If-Match"), self.known(self.shown(id_))
        tag = _tag(value, self.style)
        if self.style.get("etag") == "none":
            return error(412, "no entity tags here") if wanted not in {None, "*"} else None
        if wanted is None:
            return error(428, "If-Match is missing") if self.style.get("asks", True) else None
        tags = re.findall(r'(?:W/)?"[^"]*"', wanted)
        holds = (
            wanted.strip() == "*"
            or (self.has("several other tags are taken") and len(tags) > 1)
            or (tag in tags and not tag.startswith("W/"))
        )
        if self.has("If-Match takes a weak tag"):
            holds |= f"W/{tag}" in tags
        if self.has("a stale If-Match is taken"):
            holds |= not self.issued.isdisjoint(tags)
        return None if holds else error(412, "another version")

    def cached_answer(self, request, value):
        """Return a 304 if the client has this value, or None."""
        fields, asked = self.headers(value), request.headers.get("If-None-Match")
        if asked is None or not fields:
            return None
        tags = {one.removeprefix("W/") for one in re.findall(r'(?:W/)?"[^"]*"', asked)}
        current = fields["ETag"].removeprefix("W/") in tags or asked.strip() == "*"
        return web.Response(status=304, headers=fields) if current else None

    # --- bodies ---

    async def body(self, request, *, whole):
        """Return the valid members of a request's body, or the refusal."""
        if request.content_type != "application/json" and not self.has("any content type is taken"):
            return error(415, "JSON only", Accept="application/json")
        try:
            value = json.loads(await request.read(), parse_constant=lambda text: int(text, 99))
        except (ValueError, RecursionError):
            return error(400, "no JSON")
        if not isinstance(value, dict) or (whole and "name" not in value) or not value:
            return error(422, "no zone")
        problem = next((name for name, one in value.items() if not _fits(name, one)), "")
        return error(422, f"{problem} is not valid") if problem else value

    def taken(self, body):
        """Return what is stored of a body."""
        kept = dict(body)
        if self.has("the offset is lost") and "starts" in kept:
            kept["starts"] = re.sub(r"[+-]\d\d:\d\d$", "Z", kept["starts"])
        elif self.style.get("utc") and "starts" in kept:
            kept["starts"] = datetime.fromisoformat(kept["starts"]).astimezone(UTC).isoformat().replace("+00:00", "Z")
        if self.has("two decimals are kept") and "minutes" in kept:
            kept["minutes"] = round(kept["minutes"], 2)
        if self.has("numbers are single floats") and "minutes" in kept:
            kept["minutes"] = float(f"{kept['minutes']:.7g}")
        if self.has("leading zeros are lost") and "name" in kept:
            kept["name"] = kept["name"].lstrip("0") or "0"
        if self.has("CR LF becomes LF") and "name" in kept:
            kept["name"] = kept["name"].replace("\r\n", "\n")
        return kept

    def write(self, id_, values):
        self.zones[id_] |= values
        self.settle(id_)

    # --- the collection ---

    def wants(self, request, *known):
        """Return the media type for a request, or an empty text where none of these is accepted."""
        accept = request.headers.get("Accept", "*/*")
        ranges = {}
        for part in accept.split(","):
            name, _, rest = part.strip().lower().partition(";")
            found = re.search(r"q\s*=\s*([\d.]+)", rest)
            ranges[name.strip()] = float(found[1]) if found else 1.0
        places = [[name, f"{name.partition('/')[0]}/*", "*/*"] for name in known]
        rated = [(next((ranges[one] for one in some if one in ranges), 0), -n) for n, some in enumerate(places)]
        quality, place = max(rated)
        return known[-place] if quality > 0 else ""

    async def every(self, request):
        media_type = self.wants(request, "application/json", "text/csv")
        if not media_type:
            return error(406, "JSON or CSV")
        area, sort = (request.query.get(one) for one in ("area", "sort"))
        if area not in {None, *_AREAS} or sort not in {None, *_SORTS}:
            return error(422, "no such area or order")
        for zone in self.zones.values():
            if request.method == "HEAD" and self.has("HEAD renames"):
                zone["name"] = "seen"
        found, headers = self.chosen(self.listed(), area, sort), {"Vary": "Accept"}
        if self.style.get("caches"):
            headers["Cache-Control"] = f"max-age={self.style['caches']}"
        if media_type == "application/json":
            return web.json_response(found, headers=headers)
        rows = [[str(one[name]) for name in ("id", "name", "minutes", "state")] for one in found]
        if self.has("CSV lacks the last row"):
            rows = rows[:-1]
        lines = [",".join(_quoted(one) for one in row) for row in [["id", "name", "minutes", "state"], *rows]]
        body = "\r\n".join([*lines, ""]).encode()
        return web.Response(body=body, content_type="text/csv", charset="utf-8", headers=headers)

    def chosen(self, found, area, sort):
        """Return the zones of an area in an order."""
        by = self.areas if self.has("the filter goes by the first area") else {one["id"]: one["area"] for one in found}
        found = [one for one in found if area in {None, by[one["id"]]}]
        as_text = str if self.has("minutes are sorted as texts") else float
        in_order = sorted(found, key=lambda one: as_text(one["minutes"]), reverse=str(sort).startswith("-"))
        return found if sort is None else in_order

    def listed(self):
        """Return the zones as the list shows them, in one style as it was a while ago."""
        found = [self.shown(one, "list") for one in self.zones]
        if self.style.get("caches"):
            if time.monotonic() > self.since_s + self.style["caches"]:
                self.cached, self.since_s = copy.deepcopy(found), time.monotonic()
            return self.cached
        if self.has("a cached list is old"):
            known = {one["id"]: one for one in self.cached or ()}
            found = [known.get(one["id"], one) for one in found]
            self.cached = copy.deepcopy(found)
        return found

    async def create(self, request):
        is_acceptable = bool(self.wants(request, "application/json"))
        if not is_acceptable and not self.has("what is refused with 406 is created"):
            return error(406, "JSON only")
        key, body = request.headers.get("Idempotency-Key"), await self.body(request, whole=True)
        if isinstance(body, web.Response):
            if key is not None and self.has("a refusal spends its key"):
                self.keys[key] = {}, {"id": "none"}
            return body
        if (known := self.answer_of(key, body)) is not None:
            return known
        id_ = f"y{self.made}" if self.has("two at once get one id") else ""
        await asyncio.sleep(0.03 if id_ else 0)
        self.made += 1
        if self.has("later rounds take the first valve"):
            body = {**body, "rounds": [{**one, "valve": body["rounds"][0]["valve"]} for one in body.get("rounds", ())]}
        if self.has("a creation resets the settings"):
            self.settings |= {"rain_stop": True, "pressure": 2.5}
        value = self.shown(self.add(self.taken(body), id_))
        if key is not None and self.style.get("keys", True):
            self.keys[key] = body, value
            while len(self.keys) > (1 if self.has("the next key ends one") else self.style.get("remembers", 1000)):
                del self.keys[next(iter(self.keys))]
        return self.again(201, value) if is_acceptable else error(406, "JSON only")

    def answer_of(self, key, body):
        """Return the answer to a request whose key is known or no key, else None."""
        if key is not None and not 1 <= len(key) <= 80:
            return error(422, "a key has 1 to 80 characters")
        if key not in self.keys:
            return None
        asked, value = self.keys[key]
        is_other = asked != body and self.style.get("prints", True)
        if is_other and not self.has("another body gets the first answer"):
            return error(422, "the key was for another body")
        if self.style.get("repeats") == "refused":
            return error(409, "done before")
        if self.has("a repeated key acts and says nothing"):
            self.add(self.taken(body))
        is_new = self.has("a retry gets the thing as it is now") and value["id"] in self.zones
        return self.again(201, self.shown(value["id"]) if is_new else value)

    def again(self, status, value):
        fields = {"Location": f"/zones/{value['id']}", **self.headers(value)}
        return web.json_response(value, status=status, headers=fields)

    # --- a zone ---

    @_of_a_zone
    async def read(self, request, id_):
        if not self.wants(request, "application/json"):
            return error(406, "JSON only")
        until, before = self.old.get(id_, (0.0, None))
        value = self.shown(id_)
        if before is not None and until > time.monotonic():
            value = before
        fields = self.headers(value)
        if self.has("Content-Location names the first"):
            fields["Content-Location"] = "/zones/z1"
        return self.cached_answer(request, value) or web.json_response(value, headers=fields)

    def acts_anyway(self, status):
        return self.has(f"what is refused with {status} is written")

    @_of_a_zone
    async def put(self, request, id_):
        none = request.headers.get("If-None-Match")
        body = await self.body(request, whole=True)
        if isinstance(body, web.Response):
            if body.status == 415 and self.acts_anyway(415):
                self.write(id_, self.taken(_forced(await request.read())))
            return body
        tags = {"*", *self.headers(self.shown(id_)).values()}
        if none is not None and none.strip() in tags and not self.has("If-None-Match: * is not looked at"):
            return error(412, "there is one")
        return await self.written(request, id_, {**_FIRST, **self.taken(body)})

    @_of_a_zone
    async def patch(self, request, id_):
        body = await self.body(request, whole=False)
        return body if isinstance(body, web.Response) else await self.written(request, id_, self.taken(body))

    async def written(self, request, id_, values):
        accepted, refusal = self.wants(request, "application/json"), None
        if not accepted:
            refusal = error(406, "JSON only")
        refusal = refusal or self.refused(request, id_)
        if self.has("two at once write by one tag"):
            await asyncio.sleep(0.05)
        was = self.shown(id_)
        if refusal is None or self.acts_anyway(refusal.status):
            self.write(id_, values)
        value = self.shown(id_)
        told = {**value, "minutes": was["minutes"]} if self.has("a change tells the old minutes") else value
        return refusal or web.json_response(told, headers=self.headers(value))

    @_of_a_zone
    async def delete(self, request, id_):
        refusal = self.refused(request, id_)
        if refusal is not None:
            return refusal
        del self.zones[id_]
        self.maps.pop(id_, None)
        return web.Response(status=204)

    def transition(self, old, new):
        @_of_a_zone
        async def act(self, _, id_):
            self.shown(id_)
            zone = self.zones[id_]
            if zone["state"] not in old:
                return error(409, f"it is {zone['state']}")
            zone["state"], zone["at"] = new, time.monotonic()
            return web.json_response(self.shown(id_))

        return partial(act, self)

    # --- files ---

    @_of_a_zone
    async def upload(self, request, id_):
        if request.content_type != "application/octet-stream":
            return error(415, "octets only")
        octets = await request.read()
        if self.has("line ends of a file are changed"):
            octets = octets.replace(b"\r\n", b"\n")
        if self.has("a file ends at NUL"):
            octets = octets.partition(b"\0")[0]
        if self.has("a shorter file keeps the tail"):
            octets += self.maps.get(id_, b"")[len(octets) :]
        if self.has("a file in chunks is empty") and "Transfer-Encoding" in request.headers:
            octets = b""
        self.maps[id_] = octets
        if self.has("an upload goes to all"):
            self.maps = dict.fromkeys(self.zones, octets)
        return web.json_response({"size": len(octets), "sha256": hashlib.sha256(octets).hexdigest()})

    @_of_a_zone
    async def download(self, request, id_):
        if id_ not in self.maps:
            return error(404, "no map")
        return self.octets(request, self.maps[id_], "application/octet-stream")

    async def log(self, request):
        if not self.wants(request, "text/plain"):
            return error(406, "text only")
        return self.octets(request, _LOG, "text/plain")

    def octets(self, request, whole, media_type):
        """Answer a file, or the part that Range asks for (RFC 9110 14)."""
        tag, asked = f'"{hashlib.sha256(whole).hexdigest()[:12]}"', request.headers.get("Range", "")
        digest = b64encode(hashlib.sha256(whole[1:] if self.has("the digest is wrong") else whole).digest()).decode()
        fields = {"ETag": tag, "Accept-Ranges": "bytes", "Repr-Digest": f"sha-256=:{digest}:"}
        fields["Content-Type"] = media_type
        found = re.fullmatch(r"bytes=(\d*)-(\d*)", asked)
        condition = request.headers.get("If-Range")
        ignores = condition is not None and condition != tag and not self.has("a stale If-Range gets a part")
        asks_none = request.headers.get("If-None-Match")
        if asks_none is not None and tag in asks_none.replace("W/", ""):
            return web.Response(status=304, headers={"ETag": tag})
        if found is None or found.groups() == ("", "") or ignores or self.style.get("ranges") == "none":
            if self.style.get("ranges") == "none":
                del fields["Accept-Ranges"]
            return web.Response(body=whole, headers=fields)
        first, last = found.groups()
        begin = int(first) if first else max(0, len(whole) - int(last))
        end = min(int(last), len(whole) - 1) if first and last else len(whole) - 1
        if begin >= len(whole) or begin > end:
            return error(416, "no such part", **{"Content-Range": f"bytes */{len(whole)}"})
        moved = 1 if self.has("a part begins one later") and begin + 1 < end else 0
        part = whole[begin + moved : end + 1 + moved]
        end -= end + 1 - begin - len(part)
        fields["Content-Range"] = f"bytes {begin}-{end}/{len(whole)}"
        return web.Response(status=206, body=part, headers=fields)

    # --- settings ---

    async def read_settings(self, request):
        if not self.wants(request, "application/json"):
            return error(406, "JSON only")
        if self.style.get("background"):
            self.settings["pressure"] = 2 + next(self.ticks) % 7 / 4
        if self.style.get("drifts"):
            self.settings["pressure"] = 2 + int(time.monotonic() / self.style["drifts"]) % 7 / 4
        return web.json_response(self.settings)

    async def write_settings(self, request):
        if request.content_type != "application/json":
            return error(415, "JSON only")
        try:
            value = json.loads(await request.read())
        except (ValueError, RecursionError):
            return error(400, "no JSON")
        if not jsonschema.Draft202012Validator(_SETTINGS).is_valid(value):
            return error(422, "not valid")
        self.settings = {**value, "season": self.settings["season"]} if self.has("the season stays") else value
        return web.json_response(value)

    async def weather(self, request):
        if not self.wants(request, "application/json"):
            return error(406, "JSON only")
        if self.has("a forecast stops the rain"):
            self.settings["rain_stop"] = not self.settings["rain_stop"]
        return web.json_response({"rain": False, "at": datetime.now(UTC).isoformat()})


def _forced(octets):
    """Return the members of a body whose media type was refused."""
    try:
        value = json.loads(octets)
    except ValueError:
        return {}
    found = {name: one for name, one in value.items() if _fits(name, one)} if isinstance(value, dict) else {}
    return {"name": "forced", **found}


def _quoted(text):
    return '"{}"'.format(text.replace('"', '""')) if re.search(r'[",\r\n]', text) else text


def _is_time(value):
    try:
        return "T" in value and datetime.fromisoformat(value).tzinfo is not None
    except ValueError:
        return False


_RULES = {
    # Half a surrogate pair is no text that CSV could show.
    "name": lambda one: isinstance(one, str) and 1 <= len(one) <= 60 and one == one.encode(errors="ignore").decode(),
    "minutes": lambda one: type(one) in (int, float) and 0 <= one <= 600,
    "litres": lambda one: type(one) in (int, float) and one % 1 == 0 and 0 <= one <= 2**60,
    "starts": lambda one: isinstance(one, str) and _is_time(one),
    "area": lambda one: one in _AREAS,
    "valves": lambda one: (
        isinstance(one, list) and len(one) <= 8 and all(type(part) is int and 0 <= part <= 99 for part in one)
    ),
    "rounds": jsonschema.Draft202012Validator(_WRITABLE["rounds"]).is_valid,
}


def _fits(name, value):
    """Return whether a member of a zone is valid."""
    return name in _RULES and _RULES[name](value)


def sprinklers(style, faults=()):
    """Return the description and the handlers of a device."""
    device, shape = Sprinklers(style, faults), _shape(style)
    sent = {"required": True, "content": {"application/json": {"schema": _SENT}}}
    patch = {"required": True, "content": {"application/json": {"schema": _PATCH}}}
    file = {"required": True, "content": {"application/octet-stream": {"schema": {}}}}
    kept = {"type": "object", "properties": {"size": {"type": "integer"}, "sha256": {"type": "string"}}}
    octets = {"description": "ok", "content": {"application/octet-stream": {"schema": {}}}}
    conditions = {"412": REFUSED, **({"428": REFUSED} if style.get("asks", True) else {})}
    refusals = {"404": REFUSED, "406": REFUSED, "415": REFUSED, **conditions, **_BAD}
    listing = answers({"type": "array", "items": shape})
    listing["content"]["text/csv"] = {"schema": {"type": "string"}}
    settings = {"required": True, "content": {"application/json": {"schema": _SETTINGS}}}
    weather = {"type": "object", "properties": {"rain": {"type": "boolean"}, "at": {"type": "string"}}}
    prints = {"409": REFUSED, "422": REFUSED} if style.get("prints", True) else {}
    key = [_KEY] if style.get("keys", True) else []
    act = {"parameters": [_ID], "post": {"responses": {"200": answers(shape), "404": REFUSED, "409": REFUSED, **_BAD}}}
    changed = {"200": answers(shape), **refusals}
    cached = {"200": answers(shape), "304": {"description": "as it was"}, **_BAD}
    document = described(
        {
            "/zones": {
                "get": {"parameters": _QUERY, "responses": {"200": listing, **_BAD}},
                "post": {
                    "description": _SAID if style.keys().isdisjoint({"repeats", "remembers"}) else "",
                    "parameters": key,
                    "requestBody": sent,
                    "responses": {"201": answers(shape), "406": REFUSED, **prints, **_BAD},
                },
            },
            "/zones/{id}": {
                "parameters": [_ID],
                "get": {"parameters": [_NONE_MATCH], "responses": cached},
                "put": {"parameters": [_MATCH, _NONE_MATCH], "requestBody": sent, "responses": changed},
                "patch": {"parameters": [_MATCH], "requestBody": patch, "responses": changed},
                "delete": {"parameters": [_MATCH], "responses": {"204": {"description": "gone"}, **refusals}},
            },
            "/zones/{id}/start": act,
            "/zones/{id}/pause": act,
            "/zones/{id}/resume": act,
            "/zones/{id}/map": {
                "parameters": [_ID],
                "get": {"responses": {"200": octets, "206": octets, **_BAD}},
                "put": {"requestBody": file, "responses": {"200": answers(kept), **_BAD}},
            },
            "/log": {"get": {"responses": {"200": answers({"type": "string"}, "text/plain"), **_BAD}}},
            "/settings": {
                "get": {"responses": {"200": answers(_SETTINGS), **_BAD}},
                "put": {"requestBody": settings, "responses": {"200": answers(_SETTINGS), **_BAD}},
            },
            "/weather": {"get": {"responses": {"200": answers(weather), **_BAD}}},
        }
    )
    routes = {
        "/zones": {"GET": device.every, "POST": device.create},
        "/zones/{id}": {"GET": device.read, "PUT": device.put, "PATCH": device.patch, "DELETE": device.delete},
        "/zones/{id}/start": {"POST": device.transition({"idle", "done"}, "running")},
        "/zones/{id}/pause": {"POST": device.transition({"running"}, "paused")},
        "/zones/{id}/resume": {"POST": device.transition({"paused"}, "running")},
        "/zones/{id}/map": {"GET": device.download, "PUT": device.upload},
        "/log": {"GET": device.log},
        "/settings": {"GET": device.read_settings, "PUT": device.write_settings},
        "/weather": {"GET": device.weather},
    }
    return document, routes
