"""Judge the effects of SOAP operations that write, create and remove by others that read: SetGain by GetGain.

Names alone blame nobody. A value has to be read as it was written only where two other values were, for as long, and
only within what was kept so far: a device may limit a number, reach a target slowly, or let a command expire.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import zip_longest
from math import isclose
from typing import Final
from urllib.parse import urlsplit

from lxml import etree

from conformance.api.soap.roles import KEEPS, MAKERS, REFERS, SETTLES_S, Act, Role, acts_of, payload_of, texts_of
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
# Things of a list that are compared one by one, and reads of a list that show whether it changes by itself.
_ITEMS: Final = 50
_STEADY: Final = 3
# What programs write in place of a text that is not there.
_NO_TEXTS: Final = frozenset({"None", "null", "nil", "undefined", "NULL"})
# Values that are as good as none.
_NOTHING: Final = frozenset({"", "0", "0.0", "false"})
# Values that may say that a thing is removed, though it is still told.
_STATES: Final = re.compile(r"stat(?:e|us)|delet|remov|activ|enabl|valid|archiv|exist")
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
class _Thing:
    """A thing that one request created, with the value by which the device identifies it."""

    creator: Act
    name: str
    id: str
    at_s: float
    values: frozenset[tuple[str, str]] = frozenset()
    gone: bool = False


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
        self._writers = {act.label: [one for one in acts if act.shows(one)] for act in acts}
        # Names of the elements by which a write identifies its thing.
        self._keys = {
            writer.label: {name for act in acts if act.shows(writer) for name in act.sent.keys() & writer.names.keys()}
            for writer in acts
        }
        self._written: dict[str, list[_Write]] = defaultdict(list)
        self._things: list[_Thing] = []
        self._past: dict[tuple[str, str, str], _Past] = defaultdict(_Past)
        # What identified a thing in a response, by name; of each list its ids, how many requests may have changed the
        # device before it was read, and how often it was the same without any. The last such request: who, values,
        # and whether it was refused.
        self._given: set[tuple[str, str]] = set()
        self._lists: dict[str, tuple[set[str], int, int]] = {}
        self._done_last: tuple[Act, set[str], bool] | None = None
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
                self._forget()
            return
        response, sent = attempt.response, texts_of(payload)
        answer = payload_of(response.body, response.header("content-type") or "")
        is_fault = answer is not None and local(str(answer.tag)) == "Fault"
        told = texts_of(answer) if answer is not None and not is_fault else {}
        if (act.role is not Role.READS or not sent) and len(self._given) < _MOST:
            self._given.update((name, text) for name, texts in told.items() if REFERS.search(name) for text in texts)
        if act.role is Role.READS:
            yield from self._judge_removed(act, attempt, sent, told)
            if response.ok and answer is not None and not is_fault:
                yield from self._judge_list(act, attempt, told)
                yield from self._judge_id(act, attempt, sent, told)
                yield from self._values(act, attempt, sent, told)
                # The items of a list tell what was written to each.
                items = list(map(texts_of, answer.iterdescendants(etree.Element))) if not sent else []
                for item in items if len(items) <= _ITEMS else ():
                    yield from self._values(act, attempt, item, item)
            return
        self._changes += 1
        self._done_last = act, {text for texts in sent.values() for text in texts}, is_fault
        if is_fault:
            self._keep_refused(act, sent)
        elif not response.ok or self._types.invalid(payload):
            self._forget()
        else:
            nil = {local(str(one.tag)).lower() for one in payload.iter(etree.Element) if one.get(_NIL) in {"true", "1"}}
            yield from self._keep_done(act, attempt, sent, told, nil - act.emptied)

    def _forget(self) -> None:
        self._written.clear()
        self._things.clear()
        self._done_last = None

    def _keep_refused(self, act: Act, sent: _Texts) -> None:
        for write in self._written[act.label]:
            for name, texts in sent.items():
                write.refused[name].update(texts)

    def _keep_done(self, act: Act, exchange: Exchange, sent: _Texts, told: _Texts, unsaid: set[str]) -> Iterator[Case]:
        """Keep what a successful request did; judge whether what it created is a thing of its own.

        A device may leave the values of ``unsaid`` as they were, or not.
        """
        at_s, keys = exchange.response.received_s, self._keys[act.label]
        others: list[_Write] = []
        if act.role is Role.WRITES or act.role in MAKERS:
            named = sent if act.role is Role.WRITES else told
            key = {name: texts[0] for name, texts in named.items() if name in keys and len(texts) == 1}
            before = [write for write in self._written[act.label] if write.key == key and act.keeps]
            names = sent.keys() & act.sent.keys() - keys - unsaid
            if act.role is Role.OTHER:
                names = {name for name in names if REFERS.search(name)}  # what it does may change all else
            values = {name: _join(told.get(name, sent[name])) for name in names}
            earlier = {name: text for write in before for name, text in write.values.items() if name not in unsaid}
            values = {**earlier, **values}
            others = [write for write in self._written[act.label] if write.key != key][-_MOST:]
            others += [_Write(key, values, at_s)] if key or act.role is Role.WRITES else []
        self._written.clear()
        self._written[act.label] = others
        if act.role is Role.WRITES:
            return
        if act.role is Role.CREATES:
            new = [(name, texts[0]) for name, texts in told.items() if len(texts) == 1 and name not in sent]
            new = [pair for pair in new if REFERS.search(pair[0])] or (new if len(new) == 1 else [])
            for name, text in new[:1]:
                yield from self._keep_thing(_Thing(act, name, text, at_s, _texts(sent)), exchange)
            del self._things[:-_MOST]
        elif act.role is Role.REMOVES:
            for thing in self._things:
                if thing.creator.noun == act.noun and any(thing.id in texts for texts in sent.values()):
                    thing.gone, thing.at_s = True, at_s
        else:
            self._things.clear()

    def _keep_thing(self, thing: _Thing, exchange: Exchange) -> Iterator[Case]:
        """Keep a thing; judge whether its id is its own."""
        own = [one for one in self._things if one.creator is thing.creator and not one.gone]
        self._things.append(thing)
        # With no value in common, no key by which a device may take them for one thing; with one id for all, it has
        # one thing at a time.
        is_other = bool(own) and bool(thing.values) and own[-1].id == thing.id and not own[-1].values & thing.values
        if is_other and any(one.id != thing.id for one in own):
            expected, got = f"{thing.name} of a new thing", f"{thing.name} {thing.id!r}, which the thing before has"
            cause = f"{thing.creator.label} {thing.name}"
            yield case("soap/created-is-there", False, exchange, expected, got, cause)  # noqa: FBT003 - see Case

    def _values(self, act: Act, exchange: Exchange, sent: _Texts, told: _Texts) -> Iterator[Case]:
        """Judge what was written before by a response, or by one item of a list in place of request and response."""
        for writer in self._writers[act.label]:
            if sent is not told and not sent.keys() <= self._keys[writer.label]:
                continue
            for write in self._written[writer.label]:
                is_other = any(sent.get(name, told.get(name)) != [text] for name, text in write.key.items())
                if is_other or (sent is told and not write.key):
                    continue
                for name, text in write.values.items():
                    # A part of a list may lack what the other parts have, and a program may leave out 0 and false.
                    has_it = text not in _NOTHING and name in act.told and sent is not told
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
        is_begun = writer.role is Role.OTHER
        if age_s < SETTLES_S and not is_shown and not is_begun:
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
        if is_begun:  # what was begun for one thing is not about another one
            has_to = not is_shown and got in others
        is_ignored = self._is_ignored(act, writer, past, name)
        if has_to or is_ignored or is_merged:
            requirement = "soap/refused-keeps" if is_refused else "soap/written-is-read"
            expected += ": what was written later was refused" if is_refused else ""
            cause = f"{writer.label} {name}"
            found = case(requirement, False, exchange, expected, f"{name} {got!r}", cause)  # noqa: FBT003 - see Case
            past.pending = [*past.pending, (0.0 if is_ignored or is_begun or is_merged else age_s, got, found)][-_MOST:]
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
            is_its = bool(stem) and (
                stem == act.noun or any(name in self._keys[one.label] for one in self._writers[act.label])
            )
            is_its = is_its and len(sent) == 1 and (name, sent[name][0]) in self._given
            if holds:
                past.kept[sent[name][0]] = float(self._changes)
            if not is_its and not is_another:
                continue
            yield from past.twice("written-is-read", exchange, expected, got, f"{act.label} {name}")

    def _judge_removed(self, act: Act, exchange: Exchange, sent: _Texts, told: _Texts) -> Iterator[Case]:
        """Judge whether a thing that was removed can still be read; a value of its own may say that it is removed."""
        for thing in self._things:
            age_s = exchange.response.received_s - thing.at_s
            is_asked = sent.keys() == act.needs and [thing.id] in sent.values() and act.shows(thing.creator)
            if not thing.gone or not is_asked or age_s < SETTLES_S or any(map(_STATES.search, told)):
                continue
            past, expected = self._past[thing.creator.label, act.label, "gone"], f"a fault for {thing.id!r}"
            expected += f", which was removed {age_s:.1f} s before"
            got = "its values" if [thing.id] in told.values() else ""
            yield from past.twice("deleted-is-gone", exchange, expected, got, f"{thing.creator.label} {act.label}")

    def _judge_steady(self, act: Act, exchange: Exchange, told: _Texts) -> Iterator[Case]:
        """Judge whether a list is as it was, but for what the one request did that came since."""
        names = {thing.name for thing in self._things if act.lists(thing.creator)}
        ids = {text for name in names for text in told.get(name, ())}
        before, changes, steady = self._lists.get(act.label, (ids, self._changes, 0))
        since = self._changes - changes
        steady += (ids == before or -_MOST) if not since else 0
        self._lists[act.label] = ids, self._changes, steady
        if since != 1 or self._done_last is None or steady < _STEADY:
            return
        doer, values, is_refused = self._done_last
        if is_refused and doer.role is Role.CREATES and act.lists(doer):
            name, odd, what = "refused-keeps", ids - before, "a list as before, since the message was refused"
        elif not is_refused and doer.role is Role.REMOVES and act.lists(doer):
            # What a list counts is counted anew.
            odd = {text for text in before - ids - values if not text.isdigit()}
            name, what = "created-is-there", f"a list without what {doer.operation.name} removed, and with all else"
        else:
            return
        past = self._past[doer.label, act.label, name]
        got = f"a list with or without {', '.join(sorted(odd))}" if odd else ""
        yield from past.twice(name, exchange, what, got, f"{doer.label} {act.label}")

    def _judge_list(self, act: Act, exchange: Exchange, told: _Texts) -> Iterator[Case]:
        """Judge whether a list contains created things, and no removed ones."""
        yield from self._judge_steady(act, exchange, told)
        ids = {text for name, texts in told.items() if REFERS.search(name) for text in texts}
        for thing in self._things:
            if not act.lists(thing.creator):
                continue
            past = self._past[thing.creator.label, act.label, ""]
            is_there, age_s = thing.id in ids, exchange.response.received_s - thing.at_s
            name = "deleted-is-gone" if thing.gone else "created-is-there"
            expected = f"{thing.name} {thing.id!r}, which {thing.creator.operation.name} created"
            if thing.gone:
                expected = f"a list without {thing.id!r}, which was removed {age_s:.1f} s before"
            if is_there is not thing.gone:
                if is_there:
                    past.kept[thing.id] = max(past.kept.get(thing.id, 0.0), age_s)
                if len(past.kept) >= _KEPT:
                    yield case(f"soap/{name}", True, exchange, expected)  # noqa: FBT003 - see Case
            elif age_s >= SETTLES_S and len(past.kept) >= _KEPT and (thing.gone or age_s <= past.longest(thing.id)):
                got = f"a list with {thing.id!r}" if thing.gone else f"a list without {thing.id!r}"
                yield from past.twice(name, exchange, expected, got, f"{thing.creator.label} {act.label}")


def _texts(sent: _Texts) -> frozenset[tuple[str, str]]:
    """Return the values of a request that may identify a thing, with their names."""
    return frozenset((name, text) for name, texts in sent.items() for text in texts if len(text) > _FEW)


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
