"""Changes between two reads although only a refused or conditional request came between (RFC 9110 9.2.1, 15.5).

Between two equal reads, only one operation was refused, or the resource was read by other header fields. What changes
then each time, and never between two reads alone, has been changed by that.
"""

from __future__ import annotations

import re
from collections import Counter, defaultdict
from collections.abc import Iterator
from http import HTTPStatus
from typing import Any, Final, NamedTuple

from conformance.api.rest.listing import listing_of
from conformance.api.rest.patches import same
from conformance.api.rest.statuses import refuses
from conformance.api.rest.things import is_shared, parts_of
from conformance.checkers.occasion import Occasion
from conformance.contract.pack import Contract
from conformance.documents.json_text import clip, read_json
from conformance.documents.openapi import SAFE, Operation, is_json, operations_of
from conformance.documents.parameters import plain_name
from conformance.documents.representation import flat
from conformance.verdict.evidence import Case

#: A value is judged to change by refusals if it changed after OFTEN of them, and never between ALONE other reads.
OFTEN, ALONE = 3, 2
_OCTETS = 65_536  # longest response that is kept, bytes
_MOST = 1_000  # responses that are kept
#: Phrases with which an operation says that a refused request changes nothing.
KEEPS: Final = re.compile(r"nothing (?:is )?chang|not chang|unchanged|no effect|without effect", re.IGNORECASE)
# For a revision member _TWICE refusals are enough, if it did not change between _MANY reads without a refusal.
_TWICE, _MANY = 2, 12
# Members that change with every change of a thing.
_REVISION: Final = re.compile(r"(?:revision|version|etag|(?:updated|modified|changed)(?:at|on|time)?)$")
# Phrases with which a description says that no refused request changes anything.
_SAID: Final = re.compile(
    r"\b(?:refus|reject|4xx)\w*\b[^.:]*\b(?:changes? nothing|nothing (?:is )?changed?|no effect|unchanged)",
    re.IGNORECASE,
)
# Paths of lists to which a refused request may add an entry.
_LOG: Final = re.compile(r"log|event|audit|history|alarm|alert|message|metric|request|trace", re.IGNORECASE)
_CONDITIONAL: Final = "GET with If-None-Match"


def keeps_all(contract: Contract) -> bool:
    """Return whether the description promises for all requests that a refused one changes nothing."""
    info = contract.openapi.get("info", {}) if contract.openapi_path else {}
    return bool(_SAID.search(str(info.get("description", ""))))


class _Seen(NamedTuple):
    """Members of a resource at the last read, and the labels of requests since then that must not change them."""

    members: dict[str, Any]
    since: frozenset[str] = frozenset()


class Untouched:
    """Compares each plain GET with the GET before, if no request between them may have changed anything."""

    def __init__(self, contract: Contract) -> None:
        self._keeps_all = keeps_all(contract)
        self._seen: dict[str, _Seen] = {}
        # Operations whose own description says that a refused request changes nothing.
        self._keeping: set[str] = set()
        # How many refusals were seen, by template and refused operation.
        self._count: Counter[tuple[str, str]] = Counter()
        self._changed: dict[tuple[str, str], Counter[str]] = defaultdict(Counter)  # members that had changed after them
        # A case that fails if two reads without a request in between show a member unchanged, by its name, by path.
        self._waiting: dict[str, tuple[str, Any, Case]] = {}

    def forget(self) -> None:
        """Forget all reads: something else may have changed the resources."""
        self._seen.clear()

    def __call__(self, occasion: Occasion) -> Iterator[Case]:
        """Yield the cases of one exchange."""
        operation, request, status = occasion.operation, occasion.request, occasion.response.status
        path = occasion.context.target
        if request.method in SAFE:
            has_condition = any(name.lower() == "if-none-match" for name, _ in request.headers)
            if request.method == "GET" and operation is not None and has_condition and path in self._seen:
                before = self._seen[path]
                self._seen[path] = before._replace(since=before.since | {_CONDITIONAL})
            elif request.method == "GET" and operation is not None and occasion.context.plain:
                yield from self._read(occasion, operation.template, path)
        elif refuses(status, operation) and operation is not None and occasion.context.usual:
            label, place = f"{operation.label} with status {status}", f"{path.partition('?')[0].rstrip('/')}/"
            is_kept = status == HTTPStatus.CONFLICT and KEEPS.search(f"{operation.text} {operation.conflict}")
            self._keeping |= {label} if is_kept else set()
            for target, one in self._seen.items():
                if self._keeps_all or place.startswith(f"{target}/"):
                    self._seen[target] = one._replace(since=one.since | {label})
        else:
            self._seen.clear()

    def _read(self, occasion: Occasion, template: str, path: str) -> Iterator[Case]:
        answer, before = occasion.response, self._seen.pop(path, None)
        is_usable = answer.status == HTTPStatus.OK and is_json(answer.media_type) and len(answer.body) < _OCTETS
        now = read_json(answer.body).value if is_usable and not answer.cut else None
        if isinstance(now, list) and not _LOG.search(template):
            now = {"items": now, "total": answer.header("x-total-count")}
        if not isinstance(now, dict):
            return
        # Things in a list may change by themselves; that there are more or fewer of them counts.
        now = {name: f"{len(one)} items" if _is_list_of_things(one) else one for name, one in now.items()}
        if len(self._seen) < _MOST:
            self._seen[path] = _Seen(now)
        if before is None or len(before.since) > 1:
            return
        label = next(iter(before.since), "")
        if not label and path in self._waiting:
            # A value that changes by itself, such as a job's progress, changes again a moment later, and not back.
            name, was, case = self._waiting.pop(path)
            yield from [case] if any(same(now.get(name), one) for one in (before.members.get(name), was)) else []
        key = template, label
        self._count[key] += 1
        self._changed[key].update(name for name in now if not same(now[name], before.members.get(name)))
        times, alone = self._count[key], self._count[template, ""]
        is_often = times >= OFTEN and alone >= ALONE
        if not label or not (is_often or (times >= _TWICE and alone >= _MANY)):
            return
        # A refused request may not change any member, if the description says so; otherwise not the revision.
        always = [name for name, count in self._changed[key].items() if count == self._count[key]]
        is_all = self._keeps_all or label == _CONDITIONAL
        changed = [found for other, found in self._changed.items() if other[0] == template and other != key]
        others = {text for found in changed for text in found} if label in self._keeping else set(now)
        wrong = [
            name
            for name in always
            if not self._changed[template, ""][name]
            and (_REVISION.search(plain_name(name)) or (is_often and (is_all or name not in others)))
        ]
        id_ = "description/safe" if label == _CONDITIONAL else "description/refused-keeps"
        found = ", ".join(
            f"{clip(now[text])} as {text}, and {clip(before.members.get(text))} before" for text in wrong[:1]
        )
        expected = f"the members as before {label}, as {times} times"
        doubt = "" if self._keeps_all and label != _CONDITIONAL else "it may count requests, also refused ones"
        case = occasion.case(id_, not wrong, expected, found, cause=f"{template} {label} untouched", doubt=doubt)
        if wrong:
            self._waiting[path] = wrong[0], before.members.get(wrong[0]), case
        else:
            yield case


class Parts:
    """Judges whether a resource such as `/config/gripper` shows the same as that member of `/config`."""

    def __init__(self, contract: Contract) -> None:
        operations = operations_of(contract) if contract.openapi_path else ()
        shapes = {one.template.rstrip("/"): one.shape for one in operations if one.method == "GET"}
        # Path templates of such members, as far as clients write them.
        self._parts = {
            path
            for path in (one.template.rstrip("/") for one in operations if one.method in {"PUT", "PATCH"})
            for above, _, name in (path.rpartition("/"),)
            if name in (own := parts_of(shapes.get(above))) and flat(own[name]) == flat(shapes.get(path) or {})
        }
        # What reads have shown since the last change, by path.
        self._values: dict[str, Any] = {}
        self._count = Counter[str]()  # how often two differed

    def forget(self) -> None:
        """Forget all reads: something else may have changed the resources."""
        self._values.clear()

    def __call__(self, occasion: Occasion) -> Iterator[Case]:
        """Yield the cases of one exchange."""
        operation, answer = occasion.operation, occasion.response
        if occasion.request.method not in SAFE:
            self._values = {} if not refuses(answer.status, operation) else self._values
        elif operation is not None and occasion.request.method == "GET" and answer.ok and occasion.context.plain:
            path, template = occasion.context.target.rstrip("/"), operation.template.rstrip("/")
            value = self._values[path] = read_json(answer.body).value if len(answer.body) < _OCTETS else None
            above, _, name = path.rpartition("/")
            whole = self._values.get(above) if template in self._parts else None
            pairs = [(name, whole[name], value)] if isinstance(whole, dict) and name in whole else []
            for one, inner in value.items() if isinstance(value, dict) else ():
                known = f"{template}/{one}" in self._parts and f"{path}/{one}" in self._values
                pairs += [(one, inner, self._values[f"{path}/{one}"])] if known else []
            for one, inner, part in pairs:
                self._count[one] += not same(inner, part)
                if same(inner, part) or self._count[one] >= _TWICE:
                    expected, found = f"{clip(part)} as {one}, as its own resource shows it", clip(inner)
                    id_, doubt = "description/written-is-read", "one of them may be what is in effect"
                    yield occasion.case(id_, same(inner, part), expected, found, cause=f"{one} part", doubt=doubt)


# Phrases with which a description says that a request changes nothing but what it names.
_NAMED: Final = re.compile(
    r"\bno (?:operation|request|call|write)\b[^.]*\bchanges?\b[^.]*\b(?:but|except|other than) (?:\w+ ){1,3}names?\b",
    re.IGNORECASE,
)


def says_named(contract: Contract) -> bool:
    """Return whether the description says that no request changes anything but what it names."""
    info = contract.openapi.get("info", {}) if contract.openapi_path else {}
    return bool(_NAMED.search(str(info.get("description", ""))))


class Elsewhere:
    """Judges whether a write to a part of a thing gives its value to another thing.

    If the description says that no request changes what it does not name, members that clients set of any other
    resource are judged.
    """

    def __init__(self, contract: Contract) -> None:
        operations = operations_of(contract) if contract.openapi_path else ()
        self._is_said = says_named(contract)
        self._reads = {one.label for one in operations if one.method == "GET" and one.shape}
        # Members that a PUT or PATCH of a resource writes, by its path template.
        self._written: dict[str, set[str]] = defaultdict(set)
        for one in operations:
            for body in one.bodies.values() if one.method in {"PUT", "PATCH"} else ():
                self._written[one.template.rstrip("/")] |= parts_of(body.schema).keys()
        # Members at the last read and the writes since, by path.
        self._seen: dict[str, tuple[dict[str, Any], list[Occasion]]] = {}
        self._moving: set[tuple[str, str]] = set()
        self._changed: Counter[tuple[str, str, str]] = Counter()

    def forget(self) -> None:
        """Forget all reads: something else may have changed the resources."""
        self._seen.clear()

    def __call__(self, occasion: Occasion) -> Iterator[Case]:
        """Yield the cases of one exchange."""
        operation, path = occasion.operation, occasion.context.target.partition("?")[0].rstrip("/")
        if occasion.request.method not in SAFE:
            for _, since in self._seen.values() if not refuses(occasion.response.status, operation) else ():
                since.append(occasion)
            return
        is_plain = occasion.request.method == "GET" and occasion.response.ok and occasion.context.plain
        if is_plain and operation is not None and operation.label in self._reads:
            yield from self._read(occasion, operation, path)

    def _read(self, occasion: Occasion, read: Operation, path: str) -> Iterator[Case]:
        now, (before, since) = occasion.members(parts_of(read.shape)), self._seen.pop(path, ({}, []))
        if len(self._seen) < _MOST:
            self._seen[path] = now, []
        changed = {name for name in before if name in now and not same(before[name], now[name])}
        if not since:
            self._moving |= {(read.template, name) for name in changed}
        write = since[0] if len(since) == 1 else None
        if write is None or write.operation is None or not before:
            return
        label, may = write.operation.label, self._free_members(write, read, path, now)
        wrong = [name for name in sorted(changed & may) if (read.template, name) not in self._moving]
        for name in wrong:
            self._changed[label, read.template, name] += 1
        often = [name for name in wrong if self._changed[label, read.template, name] >= _TWICE]
        if may and (often or not wrong):
            name = next(iter(often), "")
            expected = f"the members as before {label}, which does not name them"
            found = f"{clip(now[name])} as {name}, and {clip(before[name])} before" if name else ""
            cause = f"{label} {read.template} {name} elsewhere"
            yield occasion.case("description/written-is-read", not name, expected, found, cause=cause)

    def _free_members(self, write: Occasion, read: Operation, path: str, now: dict[str, Any]) -> set[str]:
        """Return the members of a resource that a write names in no way: of another thing, those with a sent value."""
        there, template = write.context.target.partition("?")[0].rstrip("/"), read.template.rstrip("/")
        at = write.operation.template.rstrip("/") if write.operation is not None else ""
        if f"{path}/".startswith(f"{there}/") or f"{there}/".startswith(f"{path}/"):
            return set()
        value = read_json(write.request.body).value
        sent = value if isinstance(value, dict) else {}
        parts = parts_of(read.shape)
        if "{" in template and at.startswith(f"{template}/") and listing_of(read) is None:
            taken = (name for name, one in now.items() if any(same(one, other) for other in sent.values()))
            return {name for name in taken if not (isinstance(now[name], bool | None) or is_shared(name))}
        own = {plain_name(name) for name in sent}
        names = self._written[template] if self._is_said else set()
        return {name for name in names if not flat(parts.get(name, {})).get("readOnly") and plain_name(name) not in own}


def _is_list_of_things(value: Any) -> bool:
    return isinstance(value, list) and bool(value) and all(isinstance(item, dict) for item in value)
