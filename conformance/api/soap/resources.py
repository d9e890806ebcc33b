"""See the operations of a WSDL as resources, so that the checkers of REST judge the things that SOAP operations keep.

GetJob reads /jobs/{jobId}, ListJobs /jobs, CreateJob posts to /jobs, StartJob posts to /jobs/{jobId}/start. A fault is
a 404 for what reads one thing, and a 409 for all else. No such request is sent. A fault tells nothing of a thing if the
message for a read is odd, for example by a header block that nobody knows.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any, Final
from urllib.parse import parse_qsl, quote, unquote, urlencode, urlsplit

from conformance.api.rest.listing import Page, page_of
from conformance.api.rest.references import singular
from conformance.api.rest.statuses import REFUSALS
from conformance.api.soap.messages import message_of
from conformance.api.soap.mutations import STRANGE
from conformance.api.soap.roles import REFERS, Act, Role, acts_of, payload_of, texts_of
from conformance.contract.pack import Contract
from conformance.documents.json_text import read_json
from conformance.documents.openapi import matching
from conformance.documents.parameters import plain_name
from conformance.documents.wsdl import Wsdl
from conformance.documents.wsdl_pack import services_of
from conformance.documents.xml import Node, clark, elements, has_doctype, local
from conformance.documents.xsd_json import schema_of, value_of
from conformance.documents.xsd_shapes import Complex, Element, Simple, node_of
from conformance.transport.exchange import BUSY, Attempt, Exchange, Outgoing, Request, Response, Unanswered
from conformance.verdict.evidence import Case

if TYPE_CHECKING:
    from lxml import etree

#: Where the resources seem to be.
BASE: Final = "http://things.invalid"
_IN_PATH: Final = re.compile(r"\{[^{}]*\}")
# Items of a list that are seen one by one.
_ITEMS: Final = 50
# Ends of names by which a thing is identified, after its noun.
_NUMBERS: Final = ("no", "nr", "num", "code")
_REQUEST: Final = re.compile(r"\b(GET|PUT|POST|DELETE) (/[^\s,;]*)")
_STATUS: Final = re.compile(r"(?:a refusal )?(?:with )?status (?:403|404|409)(?: or 410)?|\b(?:a refusal )?with 409")
# The found text of a finding in which a number was returned as another number.
_NUMBER: Final = re.compile(r"-?[\d.e+-]+ as [\w.]+ instead of -?[\d.e+-]+(?: in \w+)*")
# The found text of a finding in which a time or a duration was returned in another form, such as PT1M for PT60S.
_FORMS: Final = re.compile(r".{0,2}(?:P[\dT]|\d\d:\d\d).* as [\w.]+ instead of .{0,2}(?:P[\dT]|\d\d:\d\d).*")
_TWICE: Final = "where an earlier thing is"  # in the expected text if a creation returned the id of an earlier thing
# Names of the values by which a success says that the operation failed, and their values if it did not.
_RESULT: Final = re.compile(r"(?:error|result|return|status)(?:code|no|number)|err(?:no|or)|success|errormessage")
_FINE: Final = frozenset({"", "0", "true", "1", "ok", "success", "none", "no error", "noerror"})
_JSON: Final = "application/json"
# How a documentation says that a state forbids an operation, if the WSDL declares no fault for it.
_ELSE: Final = re.compile(
    r"(\bin (?:every|any|all) other states?[,:]? )an? (?:[\w.:-]+ )?fault(?=[.;]|$)", re.IGNORECASE
)
# Elements that are nested deeper than this are not named.
_DEEPEST: Final = 6
# Words around the name of the things of a list.
_AROUND: Final = re.compile(r"^all|list$")
_METHODS: Final = {Role.READS: "GET", Role.WRITES: "PUT", Role.REMOVES: "DELETE"}
_FOUND, _MADE, _FORBIDDEN, _ABSENT, _CONFLICT, _FAILED = 200, 201, 403, 404, 409, 500


@dataclass(frozen=True)
class SoapExchange(Exchange):
    """A SOAP exchange as one with a resource; ``own`` is what was sent."""

    own: Exchange = field(kw_only=True)


@dataclass(frozen=True, eq=False)
class _View(Contract):
    """A contract whose OpenAPI document shows the operations of its WSDL as resources."""

    document: dict[str, Any] = field(default_factory=dict, repr=False)
    __eq__, __hash__ = object.__eq__, object.__hash__

    @cached_property
    def openapi(self) -> dict[str, Any]:
        """The document."""
        return self.document


@dataclass(frozen=True)
class Place:
    """Where an operation is.

    Attributes:
        act: the operation.
        method, template: as in OpenAPI.
        request, response: their elements, below wrappers with one child; None if there is none.
        key: name in the request of the value that identifies the thing; empty if there is none.
        id: name of the value that identifies an item of the list in the response; empty if it is no list of things.
    """

    act: Act
    method: str
    template: str
    request: Element | None
    response: Element | None
    key: str = ""
    id: str = ""

    @property
    def is_query(self) -> bool:
        """Whether the values of the request are parameters, and no body."""
        return self.method in {"GET", "DELETE"}

    @property
    def item(self) -> str:
        """The path template of an item of the list."""
        return f"{self.template}/{{{self.id}}}"

    def fields(self) -> Iterator[tuple[str, Element]]:
        """Yield name and element of each value of the request."""
        yield from _leaves(self.request)


class Resources:
    """The resources that a WSDL describes.

    Args:
        contract: the pack with the WSDL.
        found: what the WSDL describes.
        branch: the branch of each choice in a request, in rotation; None means all of them, as optional.
    """

    def __init__(self, contract: Contract, found: Wsdl, branch: int | None = None) -> None:
        self._types = found.types
        #: Operations that list the things of a template that no operation reads one by one.
        self.lists: dict[str, Place] = {}
        acts = acts_of(found)
        self._names = {
            stem: name for act in acts for stem, name in _thing_of(act, found).items() if act.role is Role.READS
        }
        # Things that only a list reads, each with the name of its identifier.
        items = {
            noun: id_ for act in acts if act.role is Role.READS and (noun := _noun(act)) and (id_ := _id_in(act, found))
        }
        self._names = items | self._names
        self.places, documented = dict[tuple[str, str], Place](), dict[str, dict[str, Any]]()
        taken, ports = dict[tuple[str, str], str](), dict[tuple[str, str | None], str]()
        for act in acts:
            place, name = self._place(act, found), act.operation.name
            if taken.setdefault((place.method, place.template), name) != name:
                place = replace(place, template=f"/{name.lower()}", key="", id="")
            # A second port of one SOAP version leads to a device of its own, such as the other arm.
            if ports.setdefault((act.port.envelope, act.operation.request), act.port.name) != act.port.name:
                place = replace(place, template=f"/{act.port.name.lower()}{place.template}")
            self.places[urlsplit(act.port.url).path, act.operation.request] = place
            documented.setdefault(place.template, {})[place.method.lower()] = _openapi_of(place, branch)
        for place in self.places.values():
            if (
                place.id
                and place.item not in documented.setdefault(place.item, {})
                and "get" not in documented[place.item]
            ):
                documented[place.item]["get"] = _read_of_item(place)
                self.lists[place.item] = place
        document = {
            "openapi": "3.1.0",
            "info": {"title": found.name, "description": found.documentation},
            "paths": documented,
        }
        own = (contract.directory, contract.openapi_path, None, None, None, contract.only, contract.manifest)
        self.contract: Contract = _View(*own, document)

    def _place(self, act: Act, found: Wsdl) -> Place:
        """Return where an operation is, by its verb, its noun and the value by which it names a thing."""
        request = _inside(found.types.shape(act.operation.request) if act.operation.request else None)
        response = _inside(found.types.shape(act.operation.response) if act.operation.response else None)
        method, noun = _METHODS.get(act.role, "POST"), _noun(act)
        things = {stem: name for stem, name in _thing_of(act, found).items() if stem in self._names}
        stem = next((stem for stem in things if noun.startswith(stem)), next(iter(things), ""))
        if stem:
            below = act.noun.removeprefix(stem).removeprefix("s") if act.noun.startswith(stem) else act.noun
            verb = (
                act.operation.name.lower().removesuffix(act.noun)
                if method == "POST" and act.role is not Role.CREATES
                else ""
            )
            rest = "".join(f"/{part}" for part in (below, verb) if part)
            return Place(act, method, f"/{stem}s/{{{self._names[stem]}}}{rest}", request, response, things[stem])
        is_list = act.role is Role.READS and any(_repeats(response))
        is_made = act.role is Role.CREATES or (act.role is Role.OTHER and act.makes and noun in self._names)
        if is_list or is_made:
            id_ = self._names.get(noun, "") if is_list and not act.needs else ""
            return Place(act, method, f"/{noun}s", request, response, id=id_)
        name = act.noun if act.role in {Role.READS, Role.WRITES} else act.operation.name.lower()
        return Place(act, "POST" if act.role is Role.REMOVES else method, f"/{name}", request, response)

    def as_rest(self, attempt: Attempt) -> Attempt | None:
        """Return an attempt to call an operation as one to use its resource; None if it is no such call."""
        request = attempt.request
        payload = payload_of(request.body) if request.method == "POST" else None
        place = self.places.get((urlsplit(request.url).path, str(payload.tag))) if payload is not None else None
        if place is None or payload is None:
            return None
        sent = _without_empty(value_of(_below(place.request, payload), place.request), place.act.emptied)
        sent = sent if isinstance(sent, dict) else {}
        template, body, query = place.template, b"", ""
        if place.key:
            id_ = str(_flat(sent).get(place.key, ""))
            template = re.sub(_IN_PATH, lambda _: quote(id_, safe=""), template, count=1)
        if place.is_query:
            own = {name: one for name, one in _flat(sent).items() if name != place.key and one is not None}
            pairs = {name: ",".join(map(_text, one if isinstance(one, list) else [one])) for name, one in own.items()}
            query = f"?{urlencode(pairs, safe=',')}" if pairs else ""
        else:
            body = json.dumps({name: one for name, one in sent.items() if name != place.key}).encode()
        headers = (("Host", "things.invalid"), ("Accept", _JSON), *((("Content-Type", _JSON),) if body else ()))
        outgoing = Request(place.method, f"{BASE}{template}{query}", headers, body)
        if not isinstance(attempt, Exchange):
            return Unanswered(outgoing, attempt.problem, attempt.kind)
        is_valid, is_read = not self._types.invalid(payload), place.act.role is Role.READS
        answer = self._answer(place, attempt, template, is_valid=is_valid or is_read)
        if is_read and not answer.ok and not (is_valid and _is_plain(payload, place.act)):
            return None
        return SoapExchange(outgoing, answer, own=attempt)

    def items_in(self, seen: SoapExchange, known: set[str]) -> Iterator[SoapExchange]:
        """Yield the items of a list as if each was read alone, and those of ``known`` that a whole list lacks."""
        target = seen.request.url.removeprefix(BASE)
        template = next((name for name, place in self.lists.items() if place.template == target), "")
        page = page_of(seen.response) if template else None
        if page is None or len(page.items) > _ITEMS:
            return
        there = {str(item.get(self.lists[template].id, "")): item for item in page.items if isinstance(item, dict)}
        is_whole = self._lists_all(template, page)
        for id_ in (*there, *(known - there.keys() if is_whole else ())):
            yield self.item_of(seen, template, id_, there.get(id_))
        known |= there.keys()

    def item_of(self, seen: SoapExchange, template: str, id_: str, item: Any) -> SoapExchange:
        """Return an item of a list as if it was read alone; None if the list lacks it."""
        request = replace(seen.request, url=f"{BASE}{re.sub(_IN_PATH, lambda _: quote(id_, safe=''), template)}")
        found = replace(seen.response, octets=json.dumps(item).encode())
        page = page_of(seen.response)
        status = _ABSENT if page is not None and self._lists_all(template, page) else _FAILED
        found = found if item is not None else replace(found, status=status, headers=(), octets=b"")
        return SoapExchange(request, found, own=seen.own)

    def _lists_all(self, template: str, page: Page) -> bool:
        """Return whether a page has all things; a list with filters may leave some out until it is asked for them."""
        return _is_whole(page) and not self.lists[template].act.sent

    def in_soap(self, found: Case) -> Case:
        """Return a case of a resource as one of the operation, with its exchange and the names of operations."""
        if not isinstance(found.exchange, SoapExchange):
            return found
        sent = found.exchange.request
        called = matching(self.contract, sent.method, sent.url.removeprefix(BASE).partition("?")[0])
        expected, observed = self._text_in_soap(found.expected), self._text_in_soap(found.observed)
        subject = called.id if called is not None else ""
        # If the value was once read as it was written, the device does not limit it.
        is_limit = _NUMBER.fullmatch(observed) and "as it was read before" not in expected
        doubt = found.doubt or ("a device may limit a number" if is_limit else "")
        doubt = doubt or ("it may have several forms" if _FORMS.fullmatch(observed) else "")
        doubt = doubt or ("a device may take equal values for one thing" if _TWICE in expected else "")
        doubt = doubt or ("its values may stand for nothing" if _is_unnamed(found) else "")
        return replace(
            found, doubt=doubt, exchange=found.exchange.own, expected=expected, observed=observed, subject=subject
        )

    def _text_in_soap(self, text: str) -> str:
        def name(found: re.Match[str]) -> str:
            operation = matching(self.contract, found[1], found[2].partition("?")[0])
            return found[0] if operation is None else operation.id

        return _STATUS.sub("a fault", _REQUEST.sub(name, text))

    def message(self, place: Place, request: Outgoing) -> Node | None:
        """Return the content of the message to an operation for a request to its resource; None if it has none.

        Raises:
            NoElementError, ValueError: the schema has no place for a value of the request.
        """
        if place.request is None or not place.act.operation.request:
            return None
        path, _, query = request.target.partition("?")
        at = next((at for at, part in enumerate(place.template.split("/")) if part.startswith("{")), 0)
        id_ = {place.key: unquote(path.split("/")[at])} if place.key else {}
        whole = self._types.shape(place.act.operation.request)
        if whole is None:
            raise ValueError("no schema declares its request")
        if place.is_query:
            fields, pairs = dict(place.fields()), parse_qsl(query, keep_blank_values=True)
            if len(dict(pairs)) < len(pairs):
                raise ValueError("a parameter is there twice")
            many = {name for name, one in fields.items() if one.maximum != 1}
            given = {name: text.split(",") if name in many else text for name, text in pairs}
            return message_of(whole, given | id_)
        sent = read_json(request.body).value if request.body else {}
        made = node_of(place.request, _with_attributes(place.request, sent | id_ if isinstance(sent, dict) else sent))
        for one in _wrappers(whole, place.request)[::-1]:
            made = Node(one.tag, "", (made,))
        return made

    @staticmethod
    def _answer(place: Place, exchange: Exchange, path: str, *, is_valid: bool) -> Response:
        """Return a response as that of a resource. What an invalid message did that was accepted is unknown."""
        own = exchange.response
        answer = payload_of(own.body, own.header("content-type") or "")
        told = {name: texts for name, texts in texts_of(answer).items() if name != "nil"} if answer is not None else {}
        is_fault = answer is not None and local(str(answer.tag)) == "Fault" and own.status not in REFUSALS | BUSY
        if is_fault or (own.ok and _says_failed(told)):
            # A creation may be refused for any reason; what is refused with 409 may be there already.
            status = _FORBIDDEN if place.method == "POST" and not place.key else _CONFLICT
            status = _ABSENT if place.method == "GET" and place.key else status
            return replace(own, status=status, headers=(), octets=b"")
        # A read without a value may show that the thing is not there, or an empty thing.
        is_empty = place.method == "GET" and bool(place.key) and not any(map("".join, told.values()))
        if not own.ok or not is_valid or (answer is None and own.body) or is_empty:
            return replace(own, status=_FAILED, headers=(), octets=b"")
        value = value_of(_below(place.response, answer), place.response) if answer is not None else {}
        made = _created_id(place, value) if place.method == "POST" and not place.key else ""
        location = (("Location", f"{BASE}{path}/{quote(made, safe='')}"),) if made else ()
        headers = (("Content-Type", _JSON), *location)
        return replace(own, status=_MADE if made else _FOUND, headers=headers, octets=json.dumps(value).encode())


def _is_unnamed(found: Case) -> bool:
    """Return whether a thing seems to be there by a read that does not show what identifies it."""
    seen = found.exchange
    if not isinstance(seen, SoapExchange) or not seen.response.ok or not found.expected.startswith("status 404"):
        return False
    id_ = unquote(seen.request.url.rpartition("/")[2])
    return id_ not in str(read_json(seen.response.body).value)


def _says_failed(told: dict[str, list[str]]) -> bool:
    """Return whether a success has a code or a text that says that the operation failed."""
    return any(text.strip().lower() not in _FINE for name in told if _RESULT.fullmatch(name) for text in told[name])


def _is_whole(page: Page) -> bool:
    return not page.goes_on and not any(total > len(page.items) for total in page.totals.values())


def _is_plain(payload: etree._Element, act: Act) -> bool:
    """Return whether nothing in a message but its Body could be a reason to refuse it."""
    root = payload.getroottree().getroot()
    blocks = [block for part in elements(root) if local(str(part.tag)) == "Header" for block in elements(part)]
    is_own = str(root.tag) == clark(act.port.envelope, "Envelope") and not has_doctype(root)
    return is_own and not any(str(block.tag).startswith(clark(STRANGE, "")) for block in blocks)


def _without_empty(value: Any, emptied: frozenset[str]) -> Any:
    """Return a request's values without empty lists and xsi:nil, for which a device may keep the old value."""
    if not isinstance(value, dict):
        return [_without_empty(item, emptied) for item in value] if isinstance(value, list) else value
    return {
        name: _without_empty(item, emptied)
        for name, item in value.items()
        if item != [] and (item is not None or name.lower() in emptied)
    }


def _thing_of(act: Act, found: Wsdl) -> dict[str, str]:
    """Return the kinds of things that a request may name, in the singular, each with the name of its identifier."""
    request = _inside(found.types.shape(act.operation.request) if act.operation.request else None)
    noun, things = singular(act.noun), dict[str, str]()
    for name, one in _leaves(request):
        plain = plain_name(name)
        if name.lower() not in act.needs or not isinstance(one.type, Simple) or act.role is Role.CREATES:
            continue
        end = REFERS.search(plain)
        if end or plain.removeprefix(noun) in {"", *_NUMBERS}:
            stem = plain[: end.start()] if end else noun
            things.setdefault(singular(stem) if stem else noun, name)
    return things if act.role is not Role.READS or len(things) == 1 else {}


def _noun(act: Act) -> str:
    """Return the things of an operation, in the singular: ``job`` for ListJobs and GetAllJobs."""
    return singular(_AROUND.sub("", act.noun) or act.noun)


def _id_in(act: Act, found: Wsdl) -> str:
    """Return the name of the value by which the items of a list are identified; empty if there is no such list."""
    response = _inside(found.types.shape(act.operation.response) if act.operation.response else None)
    lists, noun = list(_repeats(response)), _noun(act)
    if act.needs or len(lists) != 1:
        return ""
    kind = lists[0].type
    names = [local(child.tag) for child in lists[0].children if isinstance(child.type, Simple) and child.minimum]
    names += [] if isinstance(kind, Simple) else [local(name) for name, _, needed in kind.attributes if needed]
    ends = ("id", "token", "uuid", "key", "number", *_NUMBERS, "name", "")
    ranked = [name for end in ends for stem in (noun, "") for name in names if plain_name(name) == f"{stem}{end}"]
    return ranked[0] if ranked else ""


def _created_id(place: Place, value: Any) -> str:
    """Return the identifier of what an operation created, if its response has one; else an empty text."""
    own = (
        {name: one for name, one in _flat(value).items() if name.lower() in place.act.makes}
        if isinstance(value, dict)
        else {}
    )
    if isinstance(value, str | int) and len(place.act.makes) == 1:
        return str(value)
    return str(next(iter(own.values())) or "") if len(own) == 1 else ""


def _inside(declared: Element | None) -> Element | None:
    """Return the element in a wrapper that has one child, which may not repeat and has parts of its own."""
    while declared is not None and isinstance(declared.type, Complex) and not declared.type.attributes:
        children = declared.children
        if len(children) != 1 or children[0].maximum != 1 or not children[0].children:
            break
        declared = children[0]
    return declared


def _below(declared: Element | None, element: etree._Element) -> etree._Element | None:
    """Return the element in a message that `_inside` found."""
    found: etree._Element | None = element
    while declared is not None and found is not None and str(found.tag) != declared.tag:
        found = next(iter(elements(found)), None)
    return found


def _wrappers(declared: Element, inner: Element) -> list[Element]:
    """Return the elements around the one that `_inside` found, the outermost first."""
    found = []
    while declared is not inner:
        found.append(declared)
        declared = declared.children[0]
    return found


def _with_attributes(declared: Element, value: Any) -> Any:
    """Return a JSON value as `node_of` has it, with attributes marked."""
    if isinstance(value, list):
        return [_with_attributes(declared, one) for one in value]
    if not isinstance(value, dict):
        return value
    kind, parts = declared.type, {local(child.tag): child for child in declared.children}
    names = set() if isinstance(kind, Simple) else {local(name) for name, *_ in kind.attributes}
    found = {name: _with_attributes(parts[name], one) if name in parts else one for name, one in value.items()}
    return {f"@{name}" if name in names else name: one for name, one in found.items()}


def _leaves(declared: Element | None, depth: int = 0) -> Iterator[tuple[str, Element]]:
    for child in declared.children if declared is not None and depth < _DEEPEST else ():
        if isinstance(child.type, Simple) or not child.children:
            yield local(child.tag), child
        else:
            yield from _leaves(child, depth + 1)


def _repeats(declared: Element | None, depth: int = 0) -> Iterator[Element]:
    for child in declared.children if declared is not None and depth < _DEEPEST else ():
        if child.maximum != 1:
            yield child
        else:
            yield from _repeats(child, depth + 1)


def _flat(value: dict[str, Any]) -> dict[str, Any]:
    """Return the values in an object and in the objects in it."""
    found: dict[str, Any] = {}
    for name, one in value.items():
        found |= _flat(one) if isinstance(one, dict) else {name: one}
    return found


def _text(value: Any) -> str:
    return ("true" if value else "false") if isinstance(value, bool) else str(value)


def _openapi_of(place: Place, branch: int | None) -> dict[str, Any]:
    """Return an operation as OpenAPI describes it."""
    act, parameters = place.act, list[dict[str, Any]]()
    names = re.findall(r"\{([^{}]*)\}", place.template)
    fields = dict(place.fields())
    if names:
        own = fields.get(place.key)
        schema = schema_of(own) if own is not None else {"type": "string"}
        parameters.append({"name": names[0], "in": "path", "required": True, "schema": schema})
    for name, one in fields.items() if place.is_query else ():
        if name != place.key:
            schema = schema_of(one)
            schema = schema if one.maximum == 1 else {"type": "array", "items": schema}
            given = {"name": name, "in": "query", "required": name.lower() in act.needs, "schema": schema}
            given |= {"explode": False} if one.maximum != 1 else {}
            parameters.append({"description": one.documentation or _sentences_on(name, act), **given})
    success: dict[str, Any] = {"description": ""}
    if place.response is not None:
        shown = schema_of(place.response)
        for name, one in shown.get("properties", {}).items():
            one.setdefault("description", _sentences_on(name, act))
        success["content"] = {_JSON: {"schema": shown}}
    is_made = place.method == "POST" and not place.key and act.makes
    responses = {str(_MADE if is_made else _FOUND): success}
    responses |= {str(_ABSENT): {"description": ""}} if place.method == "GET" and place.key else {}
    text = _text_with_409(act)
    is_refused = place.method != "GET" and (act.operation.faults or "409" in text)
    responses |= {str(_CONFLICT): {"description": ""}} if is_refused else {}
    found: dict[str, Any] = {
        "operationId": act.operation.name,
        "description": text,
        "parameters": parameters,
        "responses": responses,
    }
    if not place.is_query and place.request is not None:
        body = schema_of(place.request, branch=branch)
        body["properties"] = {name: one for name, one in body.get("properties", {}).items() if name != place.key}
        body["required"] = [name for name in body.get("required", ()) if name != place.key]
        found["requestBody"] = {"required": True, "content": {_JSON: {"schema": body}}}
    return found


def _read_of_item(place: Place) -> dict[str, Any]:
    """Return the read of an item by a list as OpenAPI describes it."""
    (declared,) = _repeats(place.response)
    schema = schema_of(replace(declared, maximum=1))
    parameter = {"name": place.id, "in": "path", "required": True, "schema": schema["properties"][place.id]}
    found = {
        str(_FOUND): {"description": "", "content": {_JSON: {"schema": schema}}},
        str(_ABSENT): {"description": ""},
    }
    text = _text_with_409(place.act)
    return {"operationId": place.act.operation.name, "description": text, "parameters": [parameter], "responses": found}


def _sentences_on(name: str, act: Act) -> str:
    """Return the sentences of an operation's documentation that name a value."""
    sentences = re.split(r"(?<=[.;])\s+", act.operation.documentation)
    return " ".join(one for one in sentences if re.search(rf"\b{re.escape(name)}\b", one))


def _text_with_409(act: Act) -> str:
    """Return the documentation of an operation, with a status in place of the faults that it declares."""
    names = [re.escape(local(tag)) for tag in act.operation.faults if local(tag) != "Fault"]
    text = _ELSE.sub(r"\g<1>409", act.operation.documentation)
    return re.sub(rf"\b(?:an? |the )?(?:{'|'.join(names)})\b", "409", text) if names else text


@lru_cache(maxsize=4)
def resources_of(contract: Contract) -> Resources | None:
    """Return the resources that a pack's WSDL describes, or None."""
    found = services_of(contract)
    return None if found is None else Resources(contract, found)
