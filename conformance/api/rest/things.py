"""Things of a collection: their paths in a description, their identifiers, and whether they read as written."""

from __future__ import annotations

import math
import re
import unicodedata
from collections.abc import Collection, Iterator, Mapping
from datetime import UTC, datetime
from functools import lru_cache
from http import HTTPStatus
from typing import Any, Final, NamedTuple, TypeGuard

from conformance.api.rest.references import is_free_text, refers, singular
from conformance.api.rest.samples import FORMATS, alike_and_apart, entry_of, fits, sample
from conformance.api.rest.unique import with_number
from conformance.api.rest.values import IDS
from conformance.documents.json_schema import Schema, is_number, kinds_of
from conformance.documents.json_text import clip
from conformance.documents.openapi import Operation
from conformance.documents.parameters import plain_name
from conformance.documents.representation import flat

# Name that stands for the whole document, if it is a list, a number, a text or a boolean and so has no members.
WHOLE: Final = "the whole"
#: Reason why a device may return a list in another order.
SET: Final = "it may keep the items as a set, in which neither order nor repetition counts"
# A path parameter that ends with one of these, such as ``item_pk``, may be the item's ``id``.
_NUMBERED: Final = ("id", "uuid", "guid", "pk", "key", "number")
# Members that a device sets itself or does not return. ``on`` alone is a switch; ``season``, ``format`` and ``standby``
# are other words.
_OWN: Final = re.compile(
    r"(?:id|pk|url|href|status|state|version|revision|etag|created|updated|modified|changed|timestamp|time"
    r"|owner|author|user|password|secret|token|pin|key|[^a-z](?:at|by)|(?:[a-z]ed|[^a-z]?(?:seen|made|built|sent))_?on"
    r"|(?:created|updated|modified|changed|deleted|started|finished|completed)_?(?:at|by))$|^(?:at|by)$"
)
# Times that a client plans or tells, such as `scheduled_at`.
_PLANNED: Final = re.compile(
    r"(?:^|_)(?:(?:schedul|plann|plant|install|purchas)ed|(?:schedule|plan|start|begin|end|due|depart|run|fire|wake|remind"
    r"|valid|available|deliver|pick_?up|sow)s?)_(?:at|on)$"
)
# States of things that are deleted and can still be read.
_DELETED: Final = re.compile(r"delet|remov|archiv|retire|decommission|trash|tombstone|gone|cancell?ed|aborted|revoked")
_STATES: Final = ("status", "state", "lifecycle", "phase")  # members that contain a state
_ALIVE: Final = frozenset({"active", "isactive", "alive"})
# Words of a description: for a text or number that is stored as it is.
_EXACTLY: Final = re.compile(
    r"\b(?:exactly|exact (?:\w+ )?values?|verbatim|case[- ]sensitive|character by character|keeps? the instant"
    r"|as (?:(?:it|they) (?:was|were|is|are) )?(?:sent|written|given)|(?:any|all) (?:fraction|digits)"
    r"|(?:not|never) rounded|(?:full|double) precision)\b",
    re.IGNORECASE,
)
# The same, of an operation.
_PROMISED: Final = re.compile(
    r"\b(?:return|read|show|give|store|keep|kept)\w*\b[^.;]{0,30}\b(?:unchanged|verbatim|as (?:it|they) (?:was|were)"
    r"|(?:exactly )?as (?:sent|written|given))\b",
    re.IGNORECASE,
)
# Words of a description: for a DELETE after which nothing is there, for one that ends or hides a thing, and for things
# that end by themselves.
_REMOVES: Final = re.compile(r"\b(?:delet|remov|eras|destroy|discard|purg|unregister)", re.IGNORECASE)
_HIDES: Final = re.compile(
    r"\b(?:cancel|abort|archiv|deactivat|disabl|retir|soft|restor|undelet|revok|marke?[ds]? as)", re.IGNORECASE
)
# Phrases in a description: after a DELETE nothing is left.
_IS_GONE: Final = re.compile(
    r"\b(?:is|are) gone\b|\bread\w*\b[^.;]*\b(?:404|410)\b|\bno list (?:has|shows|names)\b", re.IGNORECASE
)
# Phrases in a description: a second DELETE is answered 404.
_AGAIN: Final = re.compile(r"\bdelet\w*\b[^.;]*\b(?:again|twice|second time)\b[^.;]*\b(?:404|410)\b", re.IGNORECASE)
# Phrases in a description: a write has no effect yet or GET shows the effect; a device converts a value to store it.
_LATE: Final = re.compile(
    r"\bdraft|\bpublish|\bstaged?\b|\bcandidate\b|takes? effect|\bin(?:to)? (?:force|effect)\b|\bmeasured?\b|\bactual"
    r"|(?:next|after (?:a|the)) (?:re)?(?:start|boot|cycle)\b", re.IGNORECASE
)  # fmt: skip
#: Words of a description: the device changes what is written.
CONVERTED: Final = re.compile(
    r"\b(?:round|truncat|cut\b|shorten|clamp|snap|normali[sz]|adjust|convert|trim|steps? of|nearest|first \d+ char"
    r"|(?:upper|lower)[ -]?case|capital)", re.IGNORECASE
)  # fmt: skip
_PASSES: Final = re.compile(
    r"expir|lifetime|\bttl\b|valid[ _](?:until|to|for)|one[- ]time|\bonce\b|consum|temporar|short-lived", re.IGNORECASE
)
# Members that only one of several things can have, such as the default: setting it on one thing clears it on another.
_SHARED: Final = re.compile(r"(?:default|primary|active|selected|current|order|index|rank|priority|position|sequence)$")
# Formats whose values are equal regardless of case and punctuation.
_COMPARED: Final = frozenset({"", "email", "uuid", "hostname", "date", "date-time"})
# A text with one of these keywords has a declared length, so a device must not shorten it.
_BOUNDED: Final = frozenset({"pattern", "maxLength"})
_ZEROS: Final = re.compile(r"\b0+(?=\d)")
# Members that are compared without case, and may be kept so.
_CASELESS: Final = re.compile(
    r"mail|host|domain|ur[il]|mac(?:address)?$|colou?r|units?$|code|country|lang|locale|currency|slug|key|user|login|hash"
    r"|uuid|hex|serial|extension|format|encoding"
)
# Identifiers that the suite chooses where the client may choose them.
_CHOSEN: Final = ("roaas-{}", "roaas{}", "3fa85f64-5717-4562-b3fc-2c963f66af{:02}")
_CHOSEN_NUMBER: Final = 987_001
_ITEMS = 2  # items that are added to a list of objects, made from its first one
_MANY = 12  # the same, where the schema has maxItems or minItems
_PART: Final = 0.375  # is added to numbers that may have a fraction
_ELSEWHERE: Final = "-03:30"  # offset of a time zone, with minutes
_NEAR: Final = {"rel_tol": 0.02, "abs_tol": 0.01}
_EQUAL: Final = {"rel_tol": 1e-15}
_SECOND: Final = 1.0


def collection_of(template: str) -> str:
    """Return the path of the collection that an item's path is in, without a slash at its end; empty if it is none."""
    before, _, last = template.rstrip("/").rpartition("/")
    return before if re.fullmatch(r"\{[^{}]+\}", last) else ""


def below_others(operations: Mapping[tuple[str, str], Operation], method: str, item: Operation) -> Iterator[Operation]:
    """Yield operations at an item's collection below other things, such as /rooms/{room}/lamps for /lamps/{lamp}."""
    last = collection_of(item.template).rpartition("/")[2]
    for operation in operations.values() if len(item.parameter("path")) == 1 else ():
        template = operation.template.rstrip("/")
        if operation.method == method and template.rpartition("/")[2] == last and operation.parameter("path"):
            yield operation


def creator_of(operations: Mapping[tuple[str, str], Operation], read: Operation) -> Operation | None:
    """Return the POST that creates what a GET reads: at its collection, or a POST elsewhere with the same response."""
    members = parts_of(read.shape)
    below = (one for one in below_others(operations, "POST", read) if "201" in one.responses)
    known = (one for one in below if members and parts_of(one.shape) == members)
    return operations.get(("POST", collection_of(read.template))) or next(known, None)


def may_create(create: Operation, status: int) -> bool:
    """Return whether a status says that a POST has created a thing: 201, or 200 where the description has no 201.

    With 200 it may as well be a search or a login, or have found what was there.
    """
    is_usual = create.method == "POST" and "201" not in create.responses
    return status == HTTPStatus.CREATED or (status == HTTPStatus.OK and is_usual)


def path_chosen(item: Operation, turn: int) -> str:
    """Return the path of a thing with an identifier that the client chooses, another one each turn; else empty.

    Where the schema allows none of the suite's own, it is made like an example or sample, such as `AB0001`.
    """
    if len(item.parameter("path")) != 1:
        return ""
    (parameter,) = item.parameter("path")
    candidates: list[Any] = [one.format(turn) for one in _CHOSEN] + [_CHOSEN_NUMBER + turn]
    for like in (*parameter.examples, sample(parameter.schema)):
        made = with_number(parameter.schema, like, _CHOSEN_NUMBER + turn)
        candidates += [made] if made != like else []
    id_ = next((candidate for candidate in candidates if fits(parameter.schema, candidate)), None)
    return "" if id_ is None else item.template.replace(f"{{{parameter.name}}}", str(id_))


def id_member(value: Any, item: Operation) -> tuple[str, Any]:
    """Return the member of a representation that identifies it in an item's path, and its value; else nothing."""
    parameter = item.parameter("path")[-1]
    plain, thing = plain_name(parameter.name), singular(collection_of(item.template).rpartition("/")[2])
    names = [plain]
    if plain.endswith(_NUMBERED) or plain == thing:
        names += [*IDS[:2], "pk", f"{thing}id", *IDS[2:]]
    members = {plain_name(name): (name, one) for name, one in object_in(value, names).items()}
    found = [members[name] for name in names if name in members]
    usable = (pair for pair in found if isinstance(pair[1], str | int) and fits(parameter.schema, pair[1]))
    return next(usable, ("", None))


def identifier_of(value: Any, item: Operation) -> str:
    """Return the identifier of a representation as an item's path has it, in lower case; empty if there is none."""
    found = id_member(value, item)[1]
    return "" if found is None else str(found).casefold()


def object_in(value: Any, names: Collection[str]) -> dict[str, Any]:
    """Return the object of a response that has the most members of these plain names: the body, or one inside it.

    Of a body that is no object, it has that as its only member (see `parts_of`).
    """
    if not isinstance(value, dict) and value is not None and plain_name(WHOLE) in names:
        return {WHOLE: value}
    found = [value] if isinstance(value, dict) else []
    found += [item for item in value.values() if isinstance(item, dict)] if found else []
    found += [item for inner in found[1:] for item in inner.values() if isinstance(item, dict)]
    return max(found, key=lambda item: len({plain_name(name) for name in item} & set(names)), default={})


def is_marked_deleted(value: Any) -> bool:
    """Return whether a representation is marked as deleted, as that of a restorable thing is."""
    if not isinstance(value, dict):
        return False
    inner = [item for item in value.values() if isinstance(item, dict)]
    pairs = ((plain_name(name), one) for part in (value, *inner) for name, one in part.items())
    return any(
        (_DELETED.search(name) and one not in (None, False, 0, ""))
        or (name.endswith(_STATES) and isinstance(one, str) and _DELETED.search(plain_name(one)))
        or (name in _ALIVE and one is False)
        for name, one in pairs
    )


def says_gone(delete: Operation) -> bool:
    """Return whether a description says that nothing is left to be read after a DELETE."""
    return bool(_IS_GONE.search(f"{delete.text} {delete.success}"))


def says_absent_again(delete: Operation) -> bool:
    """Return whether a description says how a second DELETE is refused."""
    return bool(_AGAIN.search(f"{delete.text} {delete.success}"))


def doubt_of_deletion(delete: Operation) -> str:
    """Return why a thing may be there after a DELETE; nothing if the description says that it is removed."""
    # Without an id of its own, an operation is named by its method.
    is_sure = _REMOVES.search(f"{delete.id} {delete.text}") and not _HIDES.search(f"{delete.id} {delete.text}")
    return "" if is_sure else "DELETE may end or archive a thing that can still be read"


def doubt_of_write(*operations: Operation) -> str:
    """Return why a GET may not show what was written, if the description says so; else an empty text."""
    return "GET may show what is in effect" if any(_LATE.search(one.text) for one in operations) else ""


def doubt_of_life(*operations: Operation) -> str:
    """Return why a created thing may be gone, if the description says so; else an empty text."""
    texts = [text for one in operations for text in (one.text, *map(str, parts_of(one.shape or {}).items()))]
    return "the thing may have ended by itself" if any(map(_PASSES.search, texts)) else ""


def another(schema: Schema, body: dict[str, Any], turn: int, collections: frozenset[str]) -> dict[str, Any]:
    """Return a body with another value of each member that the client may choose, as far as the schema allows it."""
    changed, taken = dict(body), set[Any]()
    for name, part in flat(schema).get("properties", {}).items():
        if name not in body or is_devices(name, part, collections):
            continue
        for value in _others(part, body[name], turn, collections):
            if value != body[name] and fits(part, value) and fits(schema, {**changed, name: value}):
                changed[name] = value
                # Two equal values do not show that a device takes one for the other.
                if not isinstance(value, str | int | float) or isinstance(value, bool) or value not in taken:
                    break
        taken |= {changed[name]} if isinstance(changed[name], str | int | float) else set()
    return changed


def with_items(schema: Schema, body: Any, turn: int, collections: frozenset[str], *, whole: bool = False) -> Any:
    """Return a body with several different items in each list of objects, as far as the schema allows it.

    If ``whole``, the items have their optional members, and there are many where the schema declares a greatest number.
    """
    parts = flat(schema).get("properties", {}) if isinstance(body, dict) else {}
    changed = dict(body) if parts else body
    for name in [name for name in parts if not is_devices(name, parts[name], collections)]:
        value, items = body.get(name), flat(parts[name]).get("items")
        if isinstance(value, list) and value and isinstance(value[0], dict) and isinstance(items, dict):
            made = [another(items, value[0], turn + number, collections) for number in range(_ITEMS)]
            made = [one for place, one in enumerate(made) if one not in (value[0], *made[:place])]
            longer = [[*made[:1], value[0], *made[1:]], [*made[:1], value[0]]]
            full = {**dict(sample(items, whole=True)), **value[0]} if whole else value[0]
            if whole and fits(items, full):
                most = min(_MANY, int(flat(parts[name]).get("maxItems", _ITEMS)))
                many = [another(items, full, turn + number, collections) for number in range(most)]
                longer = [[*many[:1], full, *many[2:]], *longer]
            changed[name] = next(
                (one for one in longer if len(one) > 1 and fits(schema, {**changed, name: one})), value
            )
    return changed


def _others(schema: Schema, value: Any, turn: int, collections: frozenset[str]) -> Iterator[Any]:
    """Yield other values of a member, another one first in each turn."""
    given, kinds, form = flat(schema), kinds_of(schema), str(flat(schema).get("format", ""))
    found: list[Any] = list(given.get("enum", ()))
    if isinstance(value, dict):
        found = [another(schema, value, turn, collections)]
    elif isinstance(value, list):
        made = [alike_and_apart({**given, "minItems": count})[1] for count in (3, 2, _MANY)]
        found = [one for one in made if one and not any(item in one[:place] for place, item in enumerate(one))]
        # Not in the order of an alphabet.
        found = [[*one[1:], one[0]] if all(isinstance(item, str) for item in one) else one for one in found]
    elif not found and isinstance(value, bool):
        found = [not value]
    elif not found and is_number(value) and kinds & {"number", "integer"}:
        bounds = [given[key] for key in ("maximum", "minimum") if is_number(given.get(key))]
        middle = sum(bounds) // 2 if len(bounds) > 1 else value + turn + 1
        found = [*bounds, *([middle + _PART] if "number" in kinds else []), middle]
    elif not found and isinstance(value, str) and (form or "pattern" not in given):
        dated = FORMATS.get(form, "").replace("-01-31", f"-02-{turn % 20 + 1:02}").replace("someone@", f"One{turn}@")
        # A device in one time zone has clients in others.
        dated = dated.replace("Z", _ELSEWHERE) if form == "date-time" and turn % 2 else dated
        found = [dated] if form else [f"roaas {turn}", f"r{turn}"]
    elif not found and isinstance(value, str) and given.get("examples"):
        found = list(given["examples"])
    elif not found and isinstance(value, str) and turn % 2:
        # A pattern need not tell all that a device demands, so it is only tried in every second turn.
        digit, other = (
            re.sub(r"\d(?=\D*$)", lambda last: str((int(last[0]) + more) % 10), value)  # noqa: B023 - called at once
            for more in (turn, turn + 1)
        )
        found = [digit * 3, digit * 2, digit, other]
    begin = turn % len(found) if found else 0
    yield from (*found[begin:], *found[:begin])


def differences(
    sent: dict[str, Any], seen: dict[str, Any], schema: Schema, answer: Schema | None, collections: frozenset[str]
) -> Iterator[str]:
    """Yield each member with another value than was written, as a noun phrase.

    Members that the device sets or hides by their name or mark, that the response does not have, and that are
    normalized (case, space, rounding) are left out.
    """
    parts = members_in(schema, sent)
    shared = parts_for(answer or {}, sent)
    for name, value in sent.items():
        part, other = parts.get(name), seen.get(name)
        if part is None or name not in seen or is_devices(name, part, collections):
            continue
        if (shared and name not in shared) or is_devices(name, shared.get(name, {}), collections):
            continue
        if isinstance(value, dict) and isinstance(other, dict):
            yield from (
                f"{difference} in {name}"
                for difference in differences(value, other, part, shared.get(name), collections)
            )
        elif _are_objects(value) and _are_objects(other):
            items = [flat(one).get("items", {}) for one in (part, shared.get(name, {}))]
            yield from (f"{text} in {name}" for text in _of_items(value, other, items[0], items[1], collections))
        elif not (_alike(value, other, flat(part)) or any(map(_is_converted, (part, shared.get(name))))):
            yield f"{clip(other)} as {name} instead of {clip(value)}"


def _is_converted(part: Any) -> bool:
    """Return whether the description of a member says that the device changes written values."""
    return isinstance(part, dict) and bool(CONVERTED.search(str(flat(part).get("description"))))


def says_exactly(part: Any) -> bool:
    """Return whether the description of a member says that it is stored as it is."""
    return isinstance(part, dict) and bool(_EXACTLY.search(str(flat(part).get("description", ""))))


def _are_objects(value: Any) -> TypeGuard[list[dict[str, Any]]]:
    return isinstance(value, list) and bool(value) and all(isinstance(item, dict) for item in value)


def _of_items(
    sent: list[dict[str, Any]],
    seen: list[dict[str, Any]],
    schema: Schema,
    answer: Schema | None,
    collections: frozenset[str],
) -> Iterator[str]:
    """Yield the values that a list of objects lacks. A device may change the order, add items, and merge items."""

    def other(one: dict[str, Any], item: dict[str, Any]) -> list[str]:
        own = {name: value for name, value in one.items() if not is_shared(name)}
        return list(differences(own, item, schema, answer, collections))

    if 1 < len(seen) < len(sent) and all(any(not other(one, item) for one in sent) for item in seen):
        yield f"{len(seen)} of {len(sent)} items"
    if len(seen) == len(sent):
        pairs = zip(sent, seen, strict=True)
        lost = [other(one, item) for one, item in pairs if all(other(one, each) for each in seen)]
        yield from lost[0][:1] if lost else ()


def members_in(schema: Schema, names: Collection[str]) -> dict[str, Any]:
    """Return the schemas of an object's members; of a map, those of the entries with these names."""
    entry = entry_of(schema)
    return flat(schema).get("properties", {}) if entry is None else dict.fromkeys(names, entry)


def as_answered(
    sent: dict[str, Any], answer: dict[str, Any], before: dict[str, Any], schema: Schema, says: str
) -> dict[str, Any]:
    """Return the values that were written, or those that the response shows in their place.

    A device that tells which other value it took has written that, but for the one that was there before, for another
    value of an enumeration, or of the two of a boolean, and where its description promises what was sent.

    Args:
        sent: the members that were sent.
        answer: those in the response.
        before: those that were read before; empty if nobody read them, or nothing was there.
        schema: the schema of what was sent.
        says: the description's words on the write.
    """
    if _PROMISED.search(says):
        return sent
    parts = flat(schema).get("properties", {})
    told = {
        name: answer[name]
        for name, value in sent.items()
        if isinstance(answer.get(name), str | int | float) and not isinstance(value, bool)
        if "enum" not in flat(parts.get(name, {})) and not says_exactly(parts.get(name))
        if answer[name] not in (value, before.get(name)) and not is_moved(value, answer[name])
        if not _is_narrowed(value, answer[name])
        if not (_BOUNDED & flat(parts.get(name, {})).keys() and str(value).startswith(str(answer[name])))
    }
    return {**sent, **told}


def parts_of(schema: Schema | None) -> dict[str, Any]:
    """Return the members of a schema, or of the object in its envelope; any other schema counts as its only member."""
    kinds = kinds_of(schema or {})
    if kinds - {"null"} and "object" not in kinds:
        return {WHOLE: schema}
    outer: dict[str, Any] = flat(schema or {}).get("properties", {})
    inner = [flat(item).get("properties", {}) for item in outer.values() if isinstance(item, dict)]
    return inner[0] if len(outer) == 1 and inner and inner[0] else outer


def parts_for(schema: Schema, names: Collection[str]) -> dict[str, Any]:
    """Return the properties of the part of a response's schema that has the most of these names."""
    outer = flat(schema).get("properties", {})
    inner = [flat(item).get("properties", {}) for item in outer.values() if isinstance(item, dict)]
    inner += [flat(item).get("properties", {}) for part in inner for item in part.values() if isinstance(item, dict)]
    return max([outer, *inner], key=lambda item: len(set(item) & set(names)))


def is_devices(name: str, part: Any, collections: frozenset[str]) -> bool:
    """Return whether a member is the device's: it sets, hides or checks it."""
    given = flat(part) if isinstance(part, dict) else {}
    marked = given.get("readOnly") or given.get("writeOnly") or given.get("format") in {"password", "byte", "binary"}
    return bool(marked or "const" in given or _is_own_name(name) or refers(name, given, collections))


@lru_cache(maxsize=1024)
def _is_own_name(name: str) -> bool:
    """Return whether a name is that of a member that the device sets: ``created_at``, and ``createdAt`` alike."""
    snake = re.sub(r"[^A-Za-z0-9]+|(?<=[a-z0-9])(?=[A-Z])", "_", name).lower()
    return _OWN.search(snake) is not None and _PLANNED.search(snake) is None


def is_reordered(value: Any, now: Any, part: Any) -> bool:
    """Return whether a list of numbers or texts reads in another order, as neither a set nor sorted texts may."""
    given = flat(part) if isinstance(part, dict) else {}
    is_set = given.get("uniqueItems") or (isinstance(given.get("items"), dict) and "enum" in flat(given["items"]))
    if is_set or not (isinstance(value, list) and isinstance(now, list)) or value == now:
        return False
    is_text = all(isinstance(one, str) for one in (*value, *now))
    is_plain = all(map(is_number, (*value, *now))) or (is_text and now != sorted(now, key=str.casefold))
    return is_plain and sorted(value) == sorted(now)


def is_altered(name: str, part: Schema, value: str, now: str) -> bool:
    """Return whether a free text reads without leading zeros, accents or signs, or with other lines.

    White space at its ends and the form of combining marks are free. Case is too, unless the description says that the
    text is stored as it is.
    """
    is_free = is_free_text(part) and not (_is_converted(part) or _CASELESS.search(plain_name(name)))
    apart = [" ".join(unicodedata.normalize("NFC", text).split()) for text in (value, now)]
    plain = ["".join(one for one in unicodedata.normalize("NFKD", text) if one.isascii()) for text in (value, now)]
    apart = apart if says_exactly(part) else [text.casefold() for text in apart]
    is_same = _letters(plain[0]) == _letters(plain[1]) != "" and apart[0] != apart[1]
    is_broken = _ZEROS.sub("", value) == _ZEROS.sub("", now) or value.splitlines() == now.splitlines()
    return value != now and (is_broken or (is_free and is_same))


def is_shared(name: str) -> bool:
    """Return whether writing another thing may change a member: only one thing can be the default, for example."""
    return bool(_SHARED.search(plain_name(name)))


def _alike(value: Any, other: Any, schema: Schema) -> bool:  # noqa: PLR0911 - one for each type
    if isinstance(value, list) and isinstance(other, list):
        plain = not any(isinstance(item, list | dict) for item in (*value, *other))
        return not plain or sorted(map(_letters, value)) == sorted(map(_letters, other))
    if isinstance(value, list | dict) or isinstance(other, list | dict):
        return True
    if is_number(value):
        try:
            is_exact = isinstance(value, int) and "number" not in kinds_of(schema)
            near = _EQUAL if is_exact or says_exactly(schema) else _NEAR
            step: Any = schema.get("multipleOf", 0)
            near = {"abs_tol": step / 2} if near is _NEAR and is_number(step) and step > 0 else near
            return math.isclose(value, float(other), **near)
        except (TypeError, ValueError):
            return other is not None
    if isinstance(value, str) and str(schema.get("format", "")) not in _COMPARED:
        return True
    is_exact = isinstance(value, str) and says_exactly(schema)
    if schema.get("format") == "date-time" and isinstance(value, str) and isinstance(other, str):
        one, two, most_s = _instant(value), _instant(other), 0.0 if is_exact else _SECOND
        return one is None or two is None or abs((one - two).total_seconds()) <= most_s
    if is_exact:
        return bool(value == other)
    return _letters(value) == _letters(other)


def _letters(value: Any) -> str:
    """Return a scalar as text without case, space and punctuation, and a number rounded."""
    if is_number(value):
        return f"{float(value):.6g}"
    text = "" if value is None else str(value)
    return "".join(one for one in text.casefold() if one.isalnum())


def _instant(text: str) -> datetime | None:
    try:
        found = datetime.fromisoformat(text)
    except ValueError:
        return None
    return found if found.tzinfo else found.replace(tzinfo=UTC)


def _is_narrowed(value: Any, now: Any) -> bool:
    """Return whether an integer of more than 32 bits has become an end of their range, or its lower 32 bits."""
    is_wide = isinstance(value, int) and isinstance(now, int) and not -(2**31) <= value < 2**32
    return is_wide and (now in {-(2**31), 2**31 - 1, 2**32 - 1} or (value - now) % 2**32 == 0 != value - now)


def is_moved(value: Any, now: Any) -> bool:
    """Return whether a time has its hour in another zone, or a date is a day off or has day and month swapped."""
    try:
        sent, read = datetime.fromisoformat(value), datetime.fromisoformat(now)
    except (TypeError, ValueError):
        return False
    if sent.tzinfo is None or read.tzinfo is None:
        is_swapped = sent != read and (sent.year, sent.month, sent.day) == (read.year, read.day, read.month)
        return len(value) == len(now) == len("2026-11-29") and (is_swapped or abs((sent - read).days) == 1)
    return sent != read and sent.replace(tzinfo=None, microsecond=0) == read.replace(tzinfo=None, microsecond=0)


class Leaf(NamedTuple):
    """A member that was sent and exists: its path, its schema, the sent value, the value before, and the value now."""

    name: str
    part: Schema
    value: Any
    was: Any
    now: Any

    @property
    def top(self) -> str:
        """The member of the body that it is in."""
        return self.name.partition(".")[0].rpartition(" ")[2]


def leaves_of(
    parts: Mapping[str, Any],
    sent: dict[str, Any],
    before: dict[str, Any],
    now: dict[str, Any],
    above: str = "",
    of: str = "",
) -> Iterator[Leaf]:
    """Yield the members that were sent and exist now, also in objects and maps, and the numbers in lists of objects.

    Entries of a map, and items of a list, have the name ``of``.
    """
    for name in sent.keys() & now.keys():
        part, value, was, seen = flat(parts.get(name, {})), sent[name], before.get(name), now[name]
        if value and isinstance(value, dict) and isinstance(seen, dict):
            inner = was if isinstance(was, dict) else {}
            entries = "" if entry_of(part) is None else f"an entry of {name}"
            yield from leaves_of(members_in(part, value), value, inner, seen, f"{of or above + name}.", entries)
        else:
            yield Leaf(of or f"{above}{name}", part, value, was, seen)
            yield from _numbers_in_items(f"an item of {of or above + name}.", part, value, seen)


def _numbers_in_items(above: str, part: Schema, value: Any, seen: Any) -> Iterator[Leaf]:
    """Yield the numbers of a list of objects, where an item differs by fractions alone from the one in its place."""
    items = part.get("items")
    if not (_are_objects(value) and _are_objects(seen) and len(value) == len(seen) and isinstance(items, dict)):
        return
    parts = flat(items).get("properties", {})
    for one, other in zip(value, seen, strict=True):
        numbers = [name for name in one if is_number(one[name]) and is_number(other.get(name))]
        is_same = one not in seen and all(one[name] == other.get(name) for name in one if name not in numbers)
        if is_same and all(abs(one[name] - other[name]) < 1 for name in numbers):
            yield from (
                Leaf(f"{above}{name}", flat(parts.get(name, {})), one[name], None, other[name]) for name in numbers
            )


def left_out_of(
    parts: Mapping[str, Any], shape: Schema, bodies: tuple[Any, ...], above: str = ""
) -> Iterator[tuple[Leaf, bool]]:
    """Yield what was there and is not in a body, in its objects too, and whether each response has it.

    Args:
        parts: schemas of the members of the body.
        shape: the shape of the response.
        bodies: what was sent, what was there before, and what is there now.
        above: path of what is read, with a dot.
    """
    needed = shape.get("required", ())
    for name, part in parts.items():
        given = flat(part) if isinstance(part, dict) else {}
        _, was, now = inner = tuple(body.get(name) for body in bodies)
        if name not in bodies[0] and name in bodies[1]:
            yield Leaf(f"{above}{name}", given, given.get("default"), was, now), name in needed
        elif all(isinstance(item, dict) for item in inner):
            within = flat(shape.get("properties", {}).get(name, {}))
            yield from left_out_of(given.get("properties", {}), within, inner, f"{above}{name}.")
