"""Judge what SOAP operations write by others that read it, as SetGain by GetGain, and things as REST's are judged.

Names alone blame nobody. A value has to be read as it was written only where two other values were, for as long, and
only within what was kept so far: a device may limit a number, reach a target slowly, or let a command expire.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from itertools import zip_longest
from math import isclose
from typing import Final
from urllib.parse import urlsplit

from lxml import etree

from conformance.api.rest.request_context import RequestContext
from conformance.api.soap.resources import BASE, Resources, SoapExchange
from conformance.api.soap.roles import KEEPS, REFERS, SETTLES_S, Act, Role, acts_of, payload_of, texts_of
from conformance.checkers.occasion import Occasion
from conformance.checkers.rest import Histories
from conformance.documents.openapi import matching
from conformance.documents.wsdl import Wsdl
from conformance.documents.xml import XSI, clark, local
from conformance.documents.xsd_shapes import INTEGERS, NUMBERS, STRINGS, Simple, is_alike, number_in
from conformance.transport.exchange import Attempt, Exchange
from conformance.verdict.evidence import Case, case

# _KEPT: values that must be stored before another counts as lost. _SEEN: how often another value must be read.
_KEPT: Final = 2
_SEEN: Final = 2
# If this many reads give the same value, whatever was written, the device never stores it.
_LOST: Final = 6
# _FEW: a value with fewer prompt reads for each late one changes in steps. Texts up to this length identify nothing.
_FEW: Final = 3
_MOST: Final = 1_000
_FAILED: Final = 500
# What programs write in place of a text that is not there.
_NO_TEXTS: Final = frozenset({"None", "null", "nil", "undefined", "NULL"})
# Values that are as good as none.
_NOTHING: Final = frozenset({"", "0", "0.0", "false"})
_NIL: Final = clark(XSI, "nil")
# Separator between the values of one name: a character that XML cannot contain.
_BETWEEN: Final = "\0"
_WHOLE: Final = re.compile(r"-?[0-9]{1,19}")
_WORDS: Final = re.compile(r"[\w ]*", re.ASCII)
# The texts of a message by their names.
_Texts = dict[str, list[str]]


@dataclass
class _Write:
    """One accepted write: ``key`` names the thing, ``values`` are its texts; all names are in lower case.

    ``shown`` are those that were read so since, ``late`` those that first were not; ``refused`` what was refused since.
    """

    key: dict[str, str]
    values: dict[str, str]
    at_s: float
    shown: set[str] = field(default_factory=set)
    late: set[str] = field(default_factory=set)
    refused: dict[str, set[str]] = field(default_factory=lambda: defaultdict(set))


@dataclass
class _Past:
    """The history of one value of a reading operation.

    ``kept`` are texts that were read as written, with for how long, s; ``lost`` is what was read of others.
    ``pending`` are failures if another value was kept as long, each with its age, s, and what was read.
    ``prompt`` and ``late`` are how many writes were read at once, and later; ``items`` are the single texts of all.
    """

    kept: dict[str, float] = field(default_factory=dict)
    lost: list[str] = field(default_factory=list)
    pending: list[tuple[float, str, Case]] = field(default_factory=list)
    misses: int = 0
    prompt: int = 0
    late: int = 0
    items: set[str] = field(default_factory=set)

    @property
    def moves(self) -> bool:
        """Return whether the value approaches the written one in steps, so that a change may take any time."""
        return self.late * _FEW > self.prompt

    def longest(self, text: str) -> float:
        """Return for how long another value was kept, s."""
        return max((age for other, age in self.kept.items() if other != text), default=0.0)

    def twice(self, name: str, exchange: Exchange, expected: str, got: str, cause: str) -> Iterator[Case]:
        """Yield a case of a requirement, by ``got`` if that is not empty: a failure counts from the second one on."""
        self.misses += bool(got)
        if not got or self.misses >= _SEEN:
            yield case(f"soap/{name}", not got, exchange, expected, got, cause)

    def overdue_cases(self, age_s: float, text: str) -> Iterator[Case]:
        """Yield the values that should have lasted as long as another one did, once that one was read again."""
        waiting, self.pending = self.pending, []
        for one in waiting:
            if one[0] > age_s or one[1] == text:
                self.pending.append(one)
                continue
            self.misses += 1
            if self.misses >= _SEEN:
                yield one[2]


class SoapMemory:
    """Judges the responses of reading operations by the effects of other operations.

    Args:
        found: what the WSDL describes.
    """

    def __init__(self, found: Wsdl) -> None:
        self._types, self._paths = found.types, {urlsplit(port.url).path for port in found.ports}
        acts = acts_of(found)
        self._acts = {(urlsplit(act.port.url).path, act.operation.request): act for act in acts}
        shown = {act.label: [one for one in acts if act.shows(one)] for act in acts}
        self._writers = {label: [one for one in some if one.role is Role.WRITES] for label, some in shown.items()}
        # Names of the elements by which a write identifies its thing.
        self._keys = {
            writer.label: {name for act in acts if act.shows(writer) for name in act.sent.keys() & writer.names.keys()}
            for writer in acts
        }
        # Those by which others identify what an operation reads.
        self._identifying = {label: [self._keys[one.label] for one in some] for label, some in shown.items()}
        self._written: dict[str, list[_Write]] = defaultdict(list)
        self._past: dict[tuple[str, str, str], _Past] = defaultdict(_Past)
        # What identified a thing in a response, by name.
        self._given: set[tuple[str, str]] = set()
        self._changes = 0

    def __call__(self, attempt: Attempt) -> Iterator[Case]:
        """Yield the cases of one exchange."""
        request = attempt.request
        path = urlsplit(request.url).path
        if request.method != "POST" or path not in self._paths:
            return
        payload = payload_of(request.body)
        act = self._acts.get((path, str(payload.tag))) if payload is not None else None
        if payload is None or act is None or not isinstance(attempt, Exchange):
            if not isinstance(attempt, Exchange) and not (act and act.role is Role.READS):
                self._written.clear()
            return
        response, sent = attempt.response, texts_of(payload)
        answer = payload_of(response.body, response.header("content-type") or "")
        is_fault = answer is not None and local(str(answer.tag)) == "Fault"
        told = texts_of(answer) if answer is not None and not is_fault else {}
        if (act.role is not Role.READS or not sent) and len(self._given) < _MOST:
            self._given.update((name, text) for name, texts in told.items() if REFERS.search(name) for text in texts)
        if act.role is Role.READS:
            if response.ok and answer is not None and not is_fault:
                yield from self._judge_id(act, attempt, sent, told)
                yield from self._values(act, attempt, sent, told)
            return
        self._changes += 1
        if is_fault:
            self._keep_refused(act, sent)
        elif not response.ok or self._types.invalid(payload):
            self._written.clear()
        else:
            nil = {local(str(one.tag)).lower() for one in payload.iter(etree.Element) if one.get(_NIL) in {"true", "1"}}
            self._keep_done(act, attempt, sent, told, nil - act.emptied)

    def _keep_refused(self, act: Act, sent: _Texts) -> None:
        for write in self._written[act.label]:
            for name, texts in sent.items():
                write.refused[name].update(texts)

    def _keep_done(self, act: Act, exchange: Exchange, sent: _Texts, told: _Texts, unsaid: set[str]) -> None:
        """Keep what a successful request wrote.

        A device may leave the values of ``unsaid`` as they were, or not.
        """
        at_s, keys = exchange.response.received_s, self._keys[act.label]
        others: list[_Write] = []
        if act.role is Role.WRITES:
            key = {name: texts[0] for name, texts in sent.items() if name in keys and len(texts) == 1}
            before = [write for write in self._written[act.label] if write.key == key and act.keeps]
            values = {name: _join(told.get(name, sent[name])) for name in sent.keys() & act.sent.keys() - keys - unsaid}
            earlier = {name: text for write in before for name, text in write.values.items() if name not in unsaid}
            others = [write for write in self._written[act.label] if write.key != key][-_MOST:]
            others.append(_Write(key, {**earlier, **values}, at_s))
        self._written.clear()
        self._written[act.label] = others

    def _values(self, act: Act, exchange: Exchange, sent: _Texts, told: _Texts) -> Iterator[Case]:
        """Judge what was written before by a response."""
        for writer in self._writers[act.label]:
            if not sent.keys() <= self._keys[writer.label]:
                continue
            for write in self._written[writer.label]:
                if any(sent.get(name, told.get(name)) != [text] for name, text in write.key.items()):
                    continue
                for name, text in write.values.items():
                    # A program may leave out 0 and false.
                    has_it = text not in _NOTHING and name in act.told
                    if texts := told.get(name) or ([act.told[name].default] if has_it else []):
                        yield from self._judge_value(act, writer, write, name, exchange, _join(texts), text)
                for name in writer.sent.keys() & told.keys() - write.values.keys() - write.key.keys():
                    # If a device has stored several texts, "None" for a left-out member comes from its program.
                    is_none = writer.sent[name].builtin in STRINGS and _NO_TEXTS.intersection(told[name])
                    if is_none and len(self._past[writer.noun, act.label, name].kept) >= _KEPT:
                        expected = f"no {name}, since {writer.operation.name} wrote none, or an older one"
                        got, cause = f"{name} {told[name][0]!r}", f"{writer.label} {name}"
                        yield case("soap/written-is-read", False, exchange, expected, got, cause)  # noqa: FBT003 - see Case

    def _judge_value(
        self, act: Act, writer: Act, write: _Write, name: str, exchange: Exchange, got: str, text: str
    ) -> Iterator[Case]:
        """Judge one value."""
        past, simple = self._past[writer.noun, act.label, name], writer.sent[name]
        age_s = exchange.response.received_s - write.at_s
        expected = f"{name} {text!r}, which {writer.operation.name} wrote"
        if _is_same(simple, text, got):
            if name not in write.shown:
                write.shown.add(name)
                is_late = name in write.late and age_s > SETTLES_S / 2
                past.prompt += not is_late
                past.late += is_late
            past.kept[text] = max(past.kept.get(text, 0.0), age_s)
            if len(past.kept) >= _KEPT:
                yield case("soap/written-is-read", True, exchange, expected)  # noqa: FBT003 - see Case
            yield from past.overdue_cases(age_s, text)
            return
        if _is_near(simple, text, got):
            return  # a measured value is noisy
        is_shown = name in write.shown
        if not is_shown:
            write.late.add(name)
        is_refused = is_shown and any(is_alike(simple, one, got) for one in write.refused.get(name, ()))
        if age_s < SETTLES_S and not is_shown:
            return
        past.lost = [*past.lost, got][-_LOST:]
        others = [other for other in past.kept if other != text]
        items, extra = set(text.split(_BETWEEN)), set(got.split(_BETWEEN)) - set(text.split(_BETWEEN))
        # A list that was written is added to what was written before.
        is_merged = act.noun == writer.noun and len(items) > 1 and items < set(got.split(_BETWEEN))
        is_merged = is_merged and not extra.isdisjoint(past.items)
        past.items |= items if len(past.items) < _MOST else set()
        has_to = (
            not past.moves
            and len(others) + is_shown >= _KEPT
            and (is_shown or text in past.kept or _is_usual(simple, text, others) or _is_cut(simple, text, got))
        )
        is_ignored = self._is_ignored(act, writer, past, name)
        if has_to or is_ignored or is_merged:
            requirement = "soap/refused-keeps" if is_refused else "soap/written-is-read"
            expected += ": what was written later was refused" if is_refused else ""
            cause = f"{writer.label} {name}"
            found = case(requirement, False, exchange, expected, f"{name} {got!r}", cause)  # noqa: FBT003 - see Case
            past.pending = [*past.pending, (0.0 if is_ignored or is_merged else age_s, got, found)][-_MOST:]
            yield from past.overdue_cases(past.longest(got), _BETWEEN)

    def _is_ignored(self, act: Act, writer: Act, past: _Past, name: str) -> bool:
        """Return whether a device stores the values beside one, and never that value."""
        beside = [
            self._past[writer.noun, act.label, name] for name in writer.sent.keys() & act.told.keys() - act.sent.keys()
        ]
        return (
            len(past.lost) >= (_LOST if any(past.lost) else _KEPT)
            and not any(_BETWEEN in text for text in past.lost)
            and len({*past.lost, *past.kept}) == 1
            and act.noun == writer.noun
            and (bool(KEEPS.search(act.noun)) if any(past.lost) else name in writer.inherited)
            and any(len(other.kept) >= _KEPT and not other.moves for other in beside)
        )

    def _judge_id(self, act: Act, exchange: Exchange, sent: _Texts, told: _Texts) -> Iterator[Case]:
        """Judge whether a response is about the thing whose id, as the device gave it, was sent."""
        for name in sent.keys() & told.keys() & act.sent.keys():
            if len(sent[name]) != 1 or len(told[name]) != 1:
                continue
            past, expected = self._past[act.label, "", name], f"{name} {sent[name][0]!r}, which was asked for"
            holds = is_alike(act.sent[name], sent[name][0], told[name][0])
            got = "" if holds else f"{name} {told[name][0]!r}"
            # It was told before, for the same message, and so was what is told now, for another one.
            is_another = all(past.kept.get(texts[name][0]) == self._changes for texts in (sent, told))
            stem = REFERS.sub("", name)
            is_its = bool(stem) and (stem == act.noun or any(name in keys for keys in self._identifying[act.label]))
            is_its = is_its and len(sent) == 1 and (name, sent[name][0]) in self._given
            if holds:
                past.kept[sent[name][0]] = float(self._changes)
            if not is_its and not is_another:
                continue
            yield from past.twice("written-is-read", exchange, expected, got, f"{act.label} {name}")


def _join(texts: list[str]) -> str:
    """Return the values of one name as one text, in any order."""
    return _BETWEEN.join(sorted(texts))


def _is_same(simple: Simple, text: str, got: str) -> bool:
    """Return whether a read text has the written value."""
    pairs = list(zip_longest(text.split(_BETWEEN), got.split(_BETWEEN)))
    return all(one is not None is not two and is_alike(simple, one, two) for one, two in pairs)


def _is_near(simple: Simple, text: str, got: str) -> bool:
    """Return whether two numbers with fractions differ by 2 % at most, or two moments by less than a second."""
    if simple.builtin == "dateTime":
        return is_alike(simple, *(re.sub(r"\.\d+", "", one) for one in (text, got)))
    first, second = number_in(text), number_in(got)
    if simple.builtin in INTEGERS or first is None or second is None:
        return False
    return isclose(first, second, rel_tol=0.02)


def _is_cut(simple: Simple, text: str, got: str) -> bool:
    """Return whether an integer has lost its sign, or all but its lower 8, 16 or 32 bits: no limit makes that of it."""
    if simple.builtin not in INTEGERS or not (_WHOLE.fullmatch(text) and _WHOLE.fullmatch(got)):
        return False
    lost = int(text) - int(got)
    if int(got) in {0, -int(text)}:
        return int(got) != 0
    return any(lost and lost % 2**bits == 0 and abs(int(got)) < 2**bits for bits in (8, 16, 32))


def _is_usual(simple: Simple, text: str, kept: list[str]) -> bool:
    """Return whether a device that keeps some values has to keep this one: it lies between them, or has to be taken."""
    if simple.enumeration or simple.builtin == "boolean" or any(text in type_.enumeration for type_ in simple.others):
        return True
    if simple.many or _BETWEEN in text or not text:
        return True
    if simple.builtin in NUMBERS:
        number, numbers = number_in(text), [decimal for decimal in map(number_in, kept) if decimal is not None]
        if number is not None and number.is_nan():
            return True  # no limit makes a number of it
        numbers = [decimal for decimal in numbers if decimal.is_finite()]
        return False if number is None or not numbers else min(numbers) <= number <= max(numbers)
    longest = max(*map(len, kept), simple.max_length or 0)
    return len(text) <= longest or not _WORDS.fullmatch(text)


# Requirements of SOAP by what REST calls them.
_AS_SOAP: Final = {
    "created-is-there": "created-is-there", "deleted-is-gone": "deleted-is-gone", "written-is-read": "written-is-read",
    "refused-keeps": "refused-keeps", "own-identifier": "created-is-there", "states": "states", "list-filter": "lists",
    "list-order": "lists", "list-pages": "lists", "list-limit": "lists", "list-total": "lists",
}  # fmt: skip
# End of what is expected of a state that no operation has changed.
_BY_ITSELF: Final = "as it was read before"


class SoapThings:
    """Judges SOAP operations as the checkers of REST judge resources.

    Args:
        resources: the operations as resources.
    """

    def __init__(self, resources: Resources) -> None:
        self._resources, self._histories = resources, Histories(resources.contract)
        # By list: identifiers of the things that it had.
        self._known: dict[str, set[str]] = defaultdict(set)

    def __call__(self, attempt: Attempt) -> Iterator[Case]:
        """Yield the cases of one exchange."""
        seen = self._resources.as_rest(attempt)
        context = RequestContext.of(self._resources.contract, BASE, seen.request) if seen is not None else None
        if seen is None or context is None:
            return
        if not isinstance(seen, Exchange) or seen.response.status >= _FAILED:
            self._histories.forget(deletes=True)
            return
        shown = self._resources.items_in(seen, self._known[context.target]) if isinstance(seen, SoapExchange) else ()
        for one in (seen, *shown):
            yield from self._cases(one)

    def _cases(self, seen: Exchange) -> Iterator[Case]:
        context = RequestContext.of(self._resources.contract, BASE, seen.request)
        for found in self._histories(Occasion(self._resources.contract, seen, context)) if context is not None else ():
            name = _AS_SOAP.get(found.requirement.partition("/")[2], "")
            if name:
                case = self._resources.in_soap(found)
                # An axis, which always exists, may leave any state by itself.
                is_alone = name == "states" and found.expected.endswith(_BY_ITSELF) and not self._is_created(seen)
                doubt = case.doubt or ("it may have left the state by itself" if is_alone else "")
                yield replace(case, requirement=f"soap/{name}", doubt=doubt)

    def _is_created(self, seen: Exchange) -> bool:
        """Return whether an operation creates things where one was read."""
        above = seen.request.url.removeprefix(BASE).rpartition("/")[0]
        return matching(self._resources.contract, "POST", above) is not None
