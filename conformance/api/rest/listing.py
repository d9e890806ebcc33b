"""Find the query parameters that limit, filter, sort and page a list, and the part of it in a response."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from datetime import datetime
from functools import cached_property, lru_cache
from typing import Any, Final, NamedTuple

from conformance.api.rest.references import in_link
from conformance.api.rest.samples import entry_of, fits
from conformance.documents.json_schema import Schema, is_number, kinds_of
from conformance.documents.json_text import read_json
from conformance.documents.openapi import Operation, is_json, is_xml
from conformance.documents.parameter_reading import VALID, decoded_query, judge_texts, pairs_of
from conformance.documents.parameters import Parameter, plain_name
from conformance.documents.representation import UnreadableError, flat, read
from conformance.transport.exchange import Exchange, Response

# Normalised names of limit parameters, and of members beside a list that repeat the limit. The second group also names
# item counts: it counts as a limit only without a parameter of the first group, and if no item has such a member.
_LIMITS: Final = ("limit", "pagesize", "perpage", "maxresults", "maxitems", "pagelimit", "itemsperpage")
_ALSO_LIMITS: Final = ("top", "take", "max", "size", "count", "first")
_OFFSETS: Final = ("offset", "skip", "pageoffset")
_PAGES: Final = ("page", "pagenumber", "pageindex", "pageno")
_CURSORS: Final = ("cursor", "pagetoken", "after", "startingafter", "pagecursor", "pageafter", "marker")
_SORTS: Final = ("sort", "sortby", "orderby", "ordering", "order", "sortfield", "sortkey")
_DIRECTIONS: Final = ("order", "direction", "dir", "sortorder", "sortdirection", "sortdir", "orderdir")
_REVERSING: Final = frozenset({"reverse", "reversed", "desc", "descending"})
_WRAPPERS: Final = ("items", "data", "results", "value", "records", "entries", "content", "rows", "list", "embedded")
_NO_ITEMS: Final = frozenset({"errors", "warnings", "links", "included", "facets", "messages"})
#: Members and header fields with the number of items; those of the third group may give the number on this page
#: instead.
TOTALS: Final = frozenset(
    {"total", "totalcount", "totalitems", "totalelements", "totalresults", "totalrecords", "totalsize", "totalrows",
     "totalhits", "odatacount", "hydratotalitems", "numfound", "nbhits", "recordsfiltered", "xtotalcount", "xtotal"}
)  # fmt: skip
_HEADERS: Final = ("x-total-count", "x-total", "total-count", "x-pagination-total", "x-wp-total")
COUNTS: Final = frozenset({"count", "itemcount", "itemscount", "recordcount", "numitems", "length"})
_COUNT: Final = re.compile(r"\s*(\d{1,18})\s*", re.ASCII)
_RANGE: Final = re.compile(r"\s*[A-Za-z]+\s+(?:\d+-\d+|\*)/(\d{1,18})\s*")
# Parameters whose name is also a member's, but which choose no items by it: those for the form of the response, and
# search texts.
_NO_FILTERS: Final = frozenset(
    {"format", "lang", "language", "locale", "unit", "units", "currency", "timezone", "tz", "fields", "view", "include",
     "expand", "embed", "version", "precision", "resolution", "interval", "search", "q", "query", "text", "name",
     "title", "label", "description", "message", "comment", "note", "depth"}
)  # fmt: skip
# Parameters that search texts, and phrases in a description on what they find.
_SEARCHES: Final = ("q", "search", "query", "text")
_INCLUDES: Final = re.compile(r"(?:include|with|show)(\w+)")
_OTHERWISE: Final = re.compile(
    r"\b(?:words?|prefix|starts?|begins?|fuzzy|similar|tokens?|pattern|response|order\w*|sort\w*)\b", re.IGNORECASE
)
_CONTAINS: Final = re.compile(
    r"\b(?:contain(?:s|ing)?|substring|occurs|occurring|appears|somewhere in|part of)\b", re.IGNORECASE
)
#: Phrases in a description for an order in time; the first group: the newest items come first.
IN_TIME: Final = re.compile(
    r"\b(?:(newest|latest|most recent(?:ly \w+)?|youngest)|oldest|earliest)(?: \w+){0,2} first\b", re.IGNORECASE
)
#: Phrases in a description which say that upper and lower case are the same.
CASELESS: Final = re.compile(
    r"\bcase.?insensitive|\b(?:ignor\w+|regardless of|whatever|without regard to|in any) (?:the |its )?case\b"
    r"|\bcase (?:is|does) (?:ignored|not)",
    re.IGNORECASE,
)
#: Phrases in a description which say that upper and lower case differ.
CASED: Final = re.compile(
    r"\bcase.?sensitive|\bupper(?:case)? and lower(?:case)? (?:case )?(?:differ|are (?:not|diff))", re.IGNORECASE
)
# Phrases in a description for the member of the last item that is the cursor of the next page.
_OF_LAST: Final = re.compile(r"\b(\w+)`? of the (?:last|latest|newest|previous)\b", re.IGNORECASE)
_SIGN: Final = re.compile(r"([+-]?)(.*)", re.DOTALL)
_SUFFIX: Final = re.compile(r"(.+?)[:._ \-]?(asc|desc)(?:ending)?", re.IGNORECASE)
_IDENTIFYING: Final = ("id", "uuid", "guid", "pk", "key", "slug", "name", "serial", "serialnumber", "number")
_NEXT: Final = re.compile(r"next", re.IGNORECASE)
_DEPTH: Final = 3
#: Normalised names of members with the link to the next page, or its cursor.
NEXT: Final = re.compile(
    r"next(?:page)?(?:cursor|token|marker|link|url|href|key|after|id)?|end(?:cursor|token)|continuationtoken"
)
# How deep such members are looked for.
_LINKS_DEPTH: Final = 3


@dataclass(frozen=True)
class Sorting:
    """One value of a parameter that sorts.

    Attributes:
        member: plain name of the items' member.
        descending: the direction; None if the value does not say it.
    """

    member: str
    descending: bool | None


@dataclass(frozen=True, eq=False)
class Listing:
    """The query parameters of an operation that answers a list.

    Attributes:
        operation: the operation.
        item: schema of an item; empty where the description does not tell it.
        limit, offset, page, cursor: how much of the list is shown, and from where on.
        sort, direction: by which member it is sorted.
        reverses: whether a further parameter may turn the order around.
        filters: the parameters that choose items by a member, by the plain name of both.
        bounds: parameters that choose items by the least or greatest value of a member.
        search: the parameter whose text chosen items contain, in members that its description names.
        includes: parameters that add items with a true boolean member, such as `include_archived`, by that member.
    """

    operation: Operation
    item: Schema = field(default_factory=dict)
    limit: Parameter | None = None
    offset: Parameter | None = None
    page: Parameter | None = None
    cursor: Parameter | None = None
    sort: Parameter | None = None
    direction: Parameter | None = None
    reverses: bool = False
    filters: Mapping[str, Parameter] = field(default_factory=dict)
    bounds: tuple[Bound, ...] = ()
    search: Parameter | None = None
    includes: Mapping[str, Parameter] = field(default_factory=dict)

    @cached_property
    def searched(self) -> tuple[str, ...]:
        """The plain names of the members that a search looks at, by its description."""
        if self.search is not None and (found := _member_in(self.search, self.members)):
            return (found,)
        said = re.split(r"[.;]\s", self.search.says) if self.search is not None else []
        words = {plain_name(word) for text in said if _CONTAINS.search(text) for word in re.findall(r"\w+", text)}
        return tuple(name for name, part in self.members.items() if name in words and "string" in kinds_of(part))

    @cached_property
    def members(self) -> dict[str, Schema]:
        """The schemas of an item's members by plain name, those below ``attributes`` too (JSON:API)."""
        own = flat(self.item).get("properties", {})
        inner = own.get("attributes")
        inner = flat(inner).get("properties", {}) if isinstance(inner, dict) else {}
        return {plain_name(name): part for name, part in {**inner, **own}.items() if isinstance(part, dict)}

    @cached_property
    def says(self) -> dict[str, str]:
        """Return the description's texts on the members around the list and its header fields, by name."""
        around = [(name, schema) for name, (_, schema) in self.operation.headers.get("200", {}).items()]
        around += flat(self.operation.shape or {}).get("properties", {}).items()
        return {name: str(flat(one).get("description", "")) for name, one in around if isinstance(one, dict)}

    @cached_property
    def known_names(self) -> frozenset[str]:
        """The names of all parameters whose part is known."""
        parts = (self.limit, self.offset, self.page, self.cursor, self.sort, self.direction)
        return self.selecting | {parameter.name for parameter in parts if parameter is not None}

    @cached_property
    def selecting(self) -> frozenset[str]:
        """The names of the parameters that select items."""
        chosen = (*self.filters.values(), *(bound.parameter for bound in self.bounds), self.search)
        return frozenset(parameter.name for parameter in chosen if parameter is not None)

    @cached_property
    def sortings(self) -> dict[str, Sorting]:
        """Return what each declared value of the sort parameter means."""
        return {} if self.sort is None else {text: one for text, one in self._sortings(self.sort) if one is not None}

    def _sortings(self, sort: Parameter) -> Iterator[tuple[str, Sorting | None]]:
        schema = flat(sort.schema)
        schema = flat(schema["items"]) if isinstance(schema.get("items"), dict) else schema
        given = [
            item for item in (*schema.get("enum", ()), *sort.examples, schema.get("default")) if isinstance(item, str)
        ]
        found = {text: self._sorting(text) for text in given}
        turned = {sorting.member for sorting in found.values() if sorting is not None and sorting.descending}
        for text, one in found.items():
            # If a parameter takes "-name" for descending order, then "name" means ascending order.
            plain = one is not None and one.descending is None and one.member in turned
            yield text, Sorting(one.member, descending=False) if one is not None and plain else one

    def _sorting(self, text: str) -> Sorting | None:
        match = _SIGN.fullmatch(text.strip())
        sign, rest = (match[1], match[2]) if match else ("", text)
        if plain_name(rest) in self.members:
            return Sorting(plain_name(rest), {"": None, "+": False, "-": True}[sign])
        suffix = _SUFFIX.fullmatch(rest)
        if suffix is None or sign or plain_name(suffix[1]) not in self.members:
            return None
        return Sorting(plain_name(suffix[1]), suffix[2].lower() == "desc")

    def query_texts(self, target: str) -> dict[str, str] | None:
        """Return the query's texts by name; None if a parameter occurs twice, is invalid, or is not declared."""
        declared = {parameter.name: parameter for parameter in self.operation.parameter("query")}
        try:
            pairs = [(name, text) for name, text in pairs_of(target.partition("?")[2])]
            texts = {name: decoded_query(text) for name, text in pairs}
        except ValueError:
            return None
        if len(texts) < len(pairs) or not texts.keys() <= declared.keys():
            return None
        valid = all(judge_texts(declared[name], [text], decoded_query) == VALID for name, text in pairs)
        return texts if valid else None

    def most(self, sent: Mapping[str, str]) -> int:
        """Return how many items the parameters allow: the sent limit or its default; 0 if there is neither."""
        if self.limit is None:
            return 0
        if self.limit.name in sent:
            return number_of(sent[self.limit.name])
        default = flat(self.limit.schema).get("default")
        is_plain = sent.keys() <= self.known_names and (self.cursor is None or self.cursor.name not in sent)
        return default if is_plain and isinstance(default, int) and not isinstance(default, bool) else 0


@dataclass(frozen=True)
class Page:
    """A list in a response.

    Attributes:
        items: its items.
        totals: how many items there are, by the name of each member and header that tells it.
        goes_on: whether the response has something like a link to the next page.
        around: the objects that stand around the list, from outside.
        by: plain name of the member by which items are told apart, as where several of one rank may change places.
    """

    items: tuple[Any, ...]
    totals: Mapping[str, int] = field(default_factory=dict)
    goes_on: bool = False
    around: tuple[Mapping[str, Any], ...] = ()
    by: str = ""

    @cached_property
    def identities(self) -> tuple[str, ...]:
        """Return for each item its identifier, or its whole content if it has none."""
        return tuple(json.dumps(members_of(item).get(self.by)) if self.by else identity_of(item) for item in self.items)


def number_of(text: str) -> int:
    """Return a whole number in a text, or 0."""
    return int(text) if re.fullmatch(r"\+?\d{1,9}", text, re.ASCII) else 0


def members_of(item: Any) -> dict[str, Any]:
    """Return the members of an item, and those below ``attributes``, by plain name; none if it is no object."""
    if not isinstance(item, dict):
        return {}
    inner = item.get("attributes")
    return {plain_name(name): one for name, one in {**(inner if isinstance(inner, dict) else {}), **item}.items()}


def identity_of(item: Any) -> str:
    """Return an item's identifier as text; its whole content if it has none."""
    own = members_of(item)
    found = next((own[name] for name in _IDENTIFYING if isinstance(own.get(name), str | int)), None)
    return json.dumps(item if found is None else found, sort_keys=True)


def items_of(value: Any) -> list[Any] | None:
    """Return the items of a list: the body, or the only list in an envelope; None if there is no such list."""
    found = _find_list(value, 0)
    return None if found is None else found[1]


def _find_list(value: Any, depth: int) -> tuple[tuple[str, ...], list[Any]] | None:
    """Return the names on the way to a list, and the list."""
    if isinstance(value, list):
        return (), value
    if not isinstance(value, dict) or depth >= _DEPTH:
        return None
    named = {name: one for name, one in value.items() if plain_name(name) not in _NO_ITEMS}
    lists = [name for name, one in named.items() if isinstance(one, list)]
    usual = [name for wrapper in _WRAPPERS for name in lists if plain_name(name) == wrapper]
    if len(lists) == 1 or usual:
        chosen = (usual or lists)[0]
        return (chosen,), value[chosen]
    around = [] if lists else [(name, one) for name, one in named.items() if isinstance(one, dict)]
    inner = [(name, _find_list(one, depth + 1)) for name, one in around]
    found = [(name, one) for name, one in inner if one is not None]
    usual = [one[0] for wrapper in _WRAPPERS for one in found if plain_name(one[0]) == wrapper]
    for name, one in found:
        if len(found) == 1 or usual[:1] == [name]:
            return (name, *one[0]), one[1]
    return None


def page_of(response: Response, operation: Operation | None = None) -> Page | None:
    """Return the list in a successful JSON response, or in an XML response by the operation's schema, or None."""
    value: Any = _value_of(response, operation) if response.ok and response.body and not response.cut else None
    if operation is not None and isinstance(value, dict) and entry_of(operation.shape) is not None:
        value = [{"id": key, "name": key, **one} for key, one in value.items() if isinstance(one, dict)]
    found = _find_list(value, 0)
    if found is None:
        return None
    around, inner = [], value
    for name in found[0]:
        around.append({key: one for key, one in inner.items() if key != name})
        inner = inner[name]
    beside = [item for part in around for item in (part, *part.values()) if isinstance(item, dict)]
    totals: dict[str, int] = {}
    for part in reversed(beside):
        totals |= {key: one for key, one in part.items() if plain_name(key) in TOTALS | COUNTS and type(one) is int}
    for name in _HEADERS:
        if told := _COUNT.fullmatch(response.header(name) or ""):
            totals[name] = int(told[1])
    if within := _RANGE.fullmatch(response.header("content-range") or ""):
        totals["content-range"] = int(within[1])
    links = [re.sub(r"<[^>]*>", "", response.header("link") or "")]
    names = [name for part in beside for name, one in part.items() if one not in (None, "", False)]
    goes_on = any(_NEXT.search(item) for item in (*links, *names))
    goes_on |= any(one is True and "more" in name.lower() for part in beside for name, one in part.items())
    return Page(tuple(found[1]), totals, goes_on, tuple(around))


def _value_of(response: Response, operation: Operation | None) -> Any:
    """Return the content of a response as a JSON value; None where it cannot be read."""
    if is_json(response.media_type):
        text = read_json(response.body)
        return None if text.malformed else text.value
    schema = (operation.schemas_for(response.status) or {}).get(response.media_type) if operation is not None else None
    if schema is None or not is_xml(response.media_type):
        return None
    try:
        return read(response.media_type, response.body, schema)
    except UnreadableError:
        return None  # another requirement says what is wrong with the document


@lru_cache(maxsize=1024)
def listing_of(operation: Operation) -> Listing | None:
    """Return the roles of a GET's list parameters; None if it declares no list of objects or values."""
    success = [one for status, one in operation.responses.items() if status.startswith("2")]
    in_xml = (schema for content in success for name, schema in content.items() if is_xml(name))
    item = _item_of(operation.shape or next(in_xml, None), 0)
    query = {_plain(parameter.name): parameter for parameter in operation.parameter("query")}
    # A response with one thing is no list, even if the thing has a list among its members, unless it is read in pages.
    is_thing = operation.template.rstrip("/").endswith("}") and query.keys().isdisjoint((*_LIMITS, *_OFFSETS, *_PAGES))
    if operation.method != "GET" or item is None or is_thing:
        return None
    plain = Listing(operation, item)
    free = {name: one for name, one in query.items() if name not in plain.members}
    counts = {name: one for name, one in free.items() if kinds_of(one.schema) - {"null"} == {"integer"}}
    limit = next((counts[name] for name in _LIMITS if name in counts), None)
    if limit is None and not ("max" in counts and "min" in query):
        limit = next((counts[name] for name in _ALSO_LIMITS if name in counts), None)
    directions = {name: one for name, one in query.items() if name in _DIRECTIONS and _directs(one)}
    sorts = [query[name] for name in _SORTS if name in query and name not in directions]
    filters = {
        name: one
        for name, one in query.items()
        if name in plain.members and name not in _NO_FILTERS and one not in sorts and name not in directions
    }
    rest = [parameter for parameter in query.values() if parameter not in (limit, *filters.values())]
    return Listing(
        operation,
        item,
        limit,
        next((counts[name] for name in _OFFSETS if name in counts), None),
        next((counts[name] for name in _PAGES if name in counts), None),
        next((one for name in _CURSORS if (one := free.get(name)) and "format" not in flat(one.schema)), None),
        sorts[0] if len(sorts) == 1 else None,
        next(iter(directions.values())) if len(directions) == 1 else None,
        len(directions) > 1 or not _REVERSING.isdisjoint(query),
        filters,
        tuple(bound for parameter in rest if (bound := bound_of(parameter, plain.members))),
        next((one for one in query.values() if _is_search(one, plain.members)), None),
        {
            found[1]: one
            for name, one in query.items()
            if (found := _INCLUDES.fullmatch(name)) and kinds_of(one.schema) == {"boolean"}
            if kinds_of(plain.members.get(found[1], {})) == {"boolean"}
        },
    )


def _member_in(parameter: Parameter, members: Mapping[str, Schema]) -> str:
    """Return the plain name of the member that a parameter such as `nameContains` searches; empty if there is none."""
    found = re.fullmatch(r"(\w+)contains", plain_name(parameter.name))
    return found[1] if found and "string" in kinds_of(members.get(found[1], {})) else ""


def _is_search(parameter: Parameter, members: Mapping[str, Schema]) -> bool:
    is_named = _plain(parameter.name) in _SEARCHES and bool(_CONTAINS.search(parameter.says))
    return (is_named or bool(_member_in(parameter, members))) and not _OTHERWISE.search(parameter.says)


def _plain(name: str) -> str:
    """Return the plain name of a parameter, without the ``filter`` of JSON:API."""
    return plain_name(name[len("filter") :] if name.lower().startswith("filter[") else name)


def _directs(parameter: Parameter) -> bool:
    values = flat(parameter.schema).get("enum", ())
    return bool(values) and all(str(value).lower().startswith(("asc", "desc")) for value in values)


def _item_of(schema: Any, depth: int) -> Schema | None:
    """Return the schema of a list's items, also in an envelope; None if the schema has no list, or several."""
    given = flat(schema) if isinstance(schema, dict) else {}
    if "array" in kinds_of(given):
        return given["items"] if isinstance(given.get("items"), dict) else {}
    parts = {name: one for name, one in given.get("properties", {}).items() if plain_name(name) not in _NO_ITEMS}
    lists = [name for name, one in parts.items() if isinstance(one, dict) and "array" in kinds_of(flat(one))]
    usual = [name for wrapper in _WRAPPERS for name in lists if plain_name(name) == wrapper]
    if len(lists) == 1 or usual:
        return _item_of(parts[(usual or lists)[0]], depth)
    if lists or depth >= _DEPTH:
        return None
    found = [(plain_name(name), _item_of(one, depth + 1)) for name, one in parts.items()]
    there = [(name, one) for name, one in found if one is not None]
    usual = [name for wrapper in _WRAPPERS for name, _ in there if name == wrapper]
    return next((one for name, one in there if len(there) == 1 or usual[:1] == [name]), None)


def fitting(parameter: Parameter | None, value: Any) -> bool:
    """Return whether there is a parameter, and its schema allows a value."""
    return parameter is not None and fits(parameter.schema, value)


_LEAST: Final = frozenset(
    {"min", "minimum", "from", "since", "after", "gte", "ge", "gt", "start", "newer", "lower", "begin", "above", "over"}
)
_MOST: Final = frozenset(
    {"max", "maximum", "to", "until", "till", "before", "lte", "le", "lt", "end", "older", "upper", "below", "under"}
)
# Phrases in a parameter's description which say that it is a lower bound.
_SAYS_LEAST: Final = re.compile(
    r"at least|or (?:more|later|after|newer|above|greater|higher|heavier|longer|larger|warmer|faster)"
    r"|not (?:before|below|less)|minimum|lower bound"
    r"|greater than|more than|later than|newer than|higher than|since|\bfrom\b|>=?"
    r"|\ba (?:greater|larger|higher|later|newer) (?!bound|limit)",
    re.IGNORECASE,
)
_SAYS_MOST: Final = re.compile(
    r"at most|or (?:less|earlier|before|older|below|fewer|lower|lighter|shorter|smaller|cooler|slower)"
    r"|not (?:after|above|more)|maximum|upper bound"
    r"|less than|fewer than|earlier than|older than|lower than|\bbefore\b|until|up to|<=?"
    r"|\ba (?:smaller|lower|earlier|older) (?!bound|limit)",
    re.IGNORECASE,
)
# Phrases in it which say that the bound belongs to the values.
_SAYS_EQUAL: Final = re.compile(
    r"\bat (?:least|most)\b|\bor \w+(?:er|re|ess|ve|ow)\b|inclusive|[<>]=|\bequal", re.IGNORECASE
)
# Phrases in it which say that the bound does not belong to the values.
_SAYS_BEYOND: Final = re.compile(
    r"(?<!not )(?<!no )(?:\b(?:greater|higher|larger|more|less|lower|smaller|fewer) than\b"
    r"|\ba (?:greater|higher|larger|lower|smaller) (?!bound|limit))",
    re.IGNORECASE,
)
_WORD: Final = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])|\d+")
_STEM: Final = re.compile(r"(?:at|on|date|time)$")
_FREE: Final = frozenset({"", "date", "time", "datetime", "timestamp"})
_DATES: Final = ("date-time", "date")
_DAY: Final = re.compile(r"\d{4}-\d\d-\d\d")


class Bound(NamedTuple):
    """A parameter that is a lower or upper bound of a member.

    Attributes:
        parameter: the parameter.
        member: plain name of the member.
        is_least: whether items below it are left out; else those above.
        is_said: whether the description says so; else only its effect shows that.
    """

    parameter: Parameter
    member: str
    is_least: bool
    is_said: bool

    @staticmethod
    def rank(text: str) -> float | None:
        """Return the place of the parameter's text in its order; None if it has no order."""
        found = _rank(text)
        return None if found is None else found[1]

    def excludes(self, text: str, value: Any) -> bool:
        """Return whether a value of the member lies on the wrong side of the parameter's text."""
        bound, own = _rank(text), _rank(value)
        if bound is None or own is None or bound[0] != own[0]:
            return False
        is_below = own[1] < bound[1] - bound[2] if self.is_least else own[1] > bound[1] + bound[2]
        return is_below or (self.is_strict and own == bound)

    @property
    def is_strict(self) -> bool:
        """Whether the description says that a number is no item's value itself."""
        says = self.parameter.says
        is_said = bool(_SAYS_BEYOND.search(says)) and not _SAYS_EQUAL.search(says)
        return is_said and _kind(self.parameter.schema) == "number"

    def includes(self, text: str, value: Any) -> bool:
        """Return whether a value of the member lies on the right side of the parameter's text, or on it if said."""
        bound, own = _rank(text), _rank(value)
        if bound is None or own is None or bound[0] != own[0]:
            return False
        is_beyond = own[1] > bound[1] + bound[2] if self.is_least else own[1] < bound[1] - bound[2]
        return is_beyond or (own == bound and str(value) == text and bool(_SAYS_EQUAL.search(self.parameter.says)))


def bound_of(parameter: Parameter, members: Mapping[str, Schema]) -> Bound | None:
    """Return the member that a parameter bounds, by its name, type and description; None if it is no bound."""
    words = [item.lower() for item in _WORD.findall(parameter.name)]
    kind, levels = _kind(parameter.schema), flat(parameter.schema).get("enum")
    for index in (0, -1) if words and (kind or levels) else ():
        if words[index] not in _LEAST | _MOST:
            continue
        rest = "".join(words[1:] if index == 0 else words[:-1])
        # "createdAfter" bounds "createdAt".
        ends = ("", "at", "on", "date", "time") if rest and kind in _DATES else ("",)
        named = [name for name in members if name in {f"{rest}{end}" for end in ends}]
        dated = [name for name, one in members.items() if _kind(one) == "date-time"]
        if len(dated) > 1:
            # "raised at this time or later" means `raisedAt`.
            dated = [name for name in dated if _STEM.sub("", name) in re.findall(r"[a-z]+", parameter.says.lower())]
        said = {name for text in re.findall(r"`([\w.-]+)`", parameter.says) if (name := plain_name(text)) in members}
        # "with a greater seq" means the member `seq`.
        said |= {
            name for name in re.findall(r"\w+$", parameter.says.rstrip(" .")) if _kind(members.get(name, {})) == kind
        }
        found = named or (dated if rest in _FREE and kind in _DATES and len(dated) == 1 else [*said] * (len(said) == 1))
        own, is_level = _kind(members[found[0]]) if found else "", words[index].startswith(("min", "max"))
        is_level = is_level and bool(levels and named) and flat(members[named[0]]).get("enum") == levels
        if is_level or (kind and own and (kind in _DATES) is (own in _DATES)):
            is_least = words[index] in _LEAST
            says = _SAYS_LEAST if is_least else _SAYS_MOST
            return Bound(parameter, found[0], is_least, bool(says.search(parameter.says)))
    return None


def _kind(schema: Schema) -> str:
    """Return "number" or the date format; empty for values without an order that everybody shares."""
    given = flat(schema)
    if kinds_of(schema) - {"null"} and kinds_of(schema) <= {"number", "integer", "null"} and "enum" not in given:
        return "number"
    return str(given.get("format")) if given.get("format") in _DATES else ""


def _rank(value: Any) -> tuple[str, float, float] | None:
    """Return a value's kind, its place in its order, and how exact that place is; None without an order.

    A time is shown in whole seconds, whatever a device compares.
    """
    if is_number(value):
        return "number", float(value), 0.0
    text = str(value)
    try:
        return "number", float(text), 0.0
    except ValueError:
        pass
    try:
        found = datetime.fromisoformat(text.upper())
    except ValueError:
        return None
    if _DAY.fullmatch(text):
        return "date", float(found.toordinal()), 0.0
    return ("time", found.timestamp(), 1.0) if found.tzinfo else None


def cursors(listing: Listing, exchange: Exchange, page: Page) -> Iterator[str]:
    """Yield values in a response that name the beginning of the next page."""
    name = listing.cursor.name if listing.cursor is not None else ""
    for text in next_texts(exchange, page):
        linked = dict(in_link(text))
        if name in linked:
            yield linked[name]
        elif "?" not in text and "/" not in text:
            yield text
    last = members_of(page.items[-1]) if page.items else {}
    if plain_name(name) == "startingafter" and page.goes_on and last:
        yield str(last.get("id", ""))
    said = f"{listing.operation.text} {listing.cursor.says}" if listing.cursor is not None else ""
    yield from (str(last[plain_name(one)]) for one in _OF_LAST.findall(said) if plain_name(one) in last)


def next_texts(exchange: Exchange, page: Page) -> Iterator[str]:
    """Yield the links and cursors in a response that announce a next page."""
    links = [one for one in (exchange.response.header("link") or "").split(",") if "next" in one]
    yield from (link.partition("<")[2].partition(">")[0] for link in links)
    yield from _following(page.around, 0, said=False)


def _following(value: Any, depth: int, *, said: bool) -> Iterator[str]:
    """Yield the texts and numbers in members whose names announce a next page."""
    if isinstance(value, dict) and depth <= _LINKS_DEPTH:
        for name, one in value.items():
            yield from _following(one, depth + 1, said=said or bool(NEXT.fullmatch(plain_name(name))))
    elif isinstance(value, tuple):
        for one in value:
            yield from _following(one, depth, said=said)
    elif said and isinstance(value, str | int) and not isinstance(value, bool) and value != "":
        yield str(value)
