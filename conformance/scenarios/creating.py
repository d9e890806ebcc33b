"""Create one thing, and find the path by which it is read."""

from __future__ import annotations

import re
from collections.abc import Container
from dataclasses import replace
from typing import Any, Final
from urllib.parse import quote, unquote, urlsplit

from conformance.api.rest.inputs import Inputs, request_of, usual_inputs, whole_body
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.samples import fits, other_texts
from conformance.api.rest.things import collection_of, id_member, may_create
from conformance.api.rest.values import Values
from conformance.api.rest.variations import Kind, Variation
from conformance.documents.json_text import read_json
from conformance.documents.openapi import Operation, is_json
from conformance.scenarios.special_bodies import with_owned
from conformance.scenarios.survey import Probe, Surveyor
from conformance.transport.exchange import Exchange, Outgoing
from conformance.transport.reach import is_same, joined, path_of

#: Statuses by which a device may say that it has no room for another thing.
FULL: Final = frozenset({409, 507})


def created_path(
    surveyor: Surveyor, create: Operation, read: Operation, statuses: Container[int] = frozenset({201})
) -> str:
    """Create a thing; return the path by which it is read, if the response contains it.

    With the status 202 among those of a creation that counts, a thing may come later, or end by itself.
    """
    usual = usual_inputs(create, surveyor.values)[:2]
    body = with_texts(create, usual[0].body)
    # Create it with all members, so that each can be written and removed.
    whole = whole_body(create, surveyor.values)[1]
    whole = whole if isinstance(whole, dict) else usual[0].body
    whole = with_texts(create, whole) or whole
    owned = with_owned(create, read, whole) or (whole if isinstance(whole, dict) else None)
    known = {str(id_) for one in read.parameter("path")[-1:] for id_ in surveyor.values.known_ids(read, one)}
    tried = [*(replace(usual[0], body=item) for item in (owned, body) if item), *usual]
    made = _first_taken(surveyor, create, tried)
    if (
        made is not None
        and made.status in FULL
        and made.exchange is not None
        and makes_room(surveyor.api, made.exchange)
    ):
        made = _first_taken(surveyor, create, tried)
    if made is None or made.exchange is None or not (made.status in statuses or may_create(create, made.status)):
        return ""
    path = location_of(surveyor.api, read, made.exchange)
    # With status 200, the thing may have existed before.
    is_new = made.status in statuses or unquote(path.rstrip("/").rpartition("/")[2]) not in known
    return path if is_new else ""


def _first_taken(surveyor: Surveyor, create: Operation, tried: list[Inputs]) -> Probe | None:
    """Return the first of several creations that is accepted, or the last one."""
    made: Probe | None = None
    for inputs in tried:
        made = surveyor.send(create, Variation(Kind.AGAIN, "", "", inputs))
        if made.ok:
            break
    return made


def makes_room(api: RestInterface, refused: Exchange) -> bool:
    """Return whether things that the run has created were deleted, so that a refused creation may succeed now."""
    path = refused.request.url.removeprefix(api.client.base_url).partition("?")[0]
    return api.left is not None and api.left.make_room(api, path)


def location_of(api: RestInterface, read: Operation, made: Exchange) -> str:
    """Return the path of a created thing if the response contains it; else an empty text."""
    sent, answer = made.request.url, made.response
    location, targets = answer.header("location"), []
    if location and is_same(joined(sent, location), sent):
        targets = [path_of(joined(sent, location)).removeprefix(api.client.prefix)]
    if id_ := id_member(read_json(answer.body).value, read)[1]:
        # A thing that is created below another one may have a path of its own.
        bases = urlsplit(sent).path.removeprefix(api.client.prefix).rstrip("/"), collection_of(read.template)
        end = f"/{quote(str(id_), safe='')}{'/' if read.template.endswith('/') else ''}"
        targets += [base + end for base in dict.fromkeys(bases) if "{" not in base]
    pattern = re.sub(r"\\{[^{}]*\\}", "[^/]+", re.escape(read.template))
    usable = list(dict.fromkeys(target for target in targets if re.fullmatch(pattern, target)))
    # The Location header may be wrong, so try it.
    found = (text for text in usable if len(usable) == 1 or api.send(Outgoing("GET", text)).response.ok)
    return next(found, "")


def path_of_usual(read: Operation, values: Values) -> str:
    """Return the target of an operation's usual request."""
    return request_of(read, usual_inputs(read, values)[0]).target


def with_texts(create: Operation, body: Any) -> Any:
    """Return a JSON object with non-ASCII texts in place of its texts, or None."""
    media_type = next(iter(create.bodies), "")
    if not is_json(media_type) or not isinstance(body, dict):
        return None
    schema = create.bodies[media_type].schema
    changed = {**body, **other_texts(schema, body)}
    return changed if changed != body and fits(schema, changed) else None
