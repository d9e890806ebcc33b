"""Change values over SOAP, read them back, with refused requests in between, and restore them.

What comes of it is judged by the checkers of every exchange (`checkers.soap_memory`), and by the rules of the survey.
"""

from __future__ import annotations

import re
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field, replace
from decimal import Decimal
from functools import cached_property, partial
from itertools import islice, starmap
from typing import Final

from conformance.api.rest.interface import RestInterface
from conformance.api.rest.references import singular
from conformance.api.soap.forms import another, boundless, extreme, rewritten, shortest
from conformance.api.soap.messages import declarations, derivations, ordinary, simple_leaves, with_text
from conformance.api.soap.mutations import branches, invalid_ones, mutations
from conformance.api.soap.roles import KEEPS, REFERS, SETTLES_S, Act, Role, in_order, texts_of
from conformance.api.soap.xml_style import XmlStyle, serialize, single_changes
from conformance.documents.xml import NEXT_12, NEXT_ACTOR, XSI, Node, clark, local, parse
from conformance.documents.xsd_shapes import NUMBERS, STRINGS, Element, Simple, is_alike, plain
from conformance.scenarios.described_messages import fields_of, target_of
from conformance.scenarios.scenario import NoOccasionError, NotPossibleError, scenario
from conformance.scenarios.soap_survey import (
    OTHER_ACTION,
    Caller,
    Kind,
    NotSoapError,
    SoapProbe,
    full_message,
    mandatory,
    usual_message,
)
from conformance.scenarios.stage import Leaves, Need, Stage
from conformance.transport.exchange import Outgoing
from conformance.transport.parallel import MOST_CLIENTS, Addressed, send_together

_STEP_S = 0.1  # pause between reads while a value is awaited, s
_LATE_S = 3.2  # longest time until a read shows a write, s
# Longest time for all changes of one operation, s.
_BUDGET_S: Final = 12.0
_REFUSALS = 3  # refused messages that are sent
_THINGS = 3  # things that are written in turn
_READS: Final = (18, 60)  # successive reads of each operation, at quick and at other efforts
_FEW: Final = 5  # most calls of an operation on things that `soap_things` tests too
# Rounds of simultaneous reads, at quick and at other efforts.
_ROUNDS: Final = (6, 30)
# Encodings of messages, with their kind, what they are written in, and the number of a change whose text is beyond
# ASCII. XML 1.0, 2.2: UTF-16 is no choice; 4.1: any character may be a reference.
_ENCODED: Final = (
    ("utf-16", Kind.VARIED, "utf-16", 3),
    ("iso-8859-1", Kind.TRIED, "iso-8859-1", 3),
    ("utf-8", Kind.VARIED, "ascii", 5),
)
# Longest text that is sent because its type allows it, characters.
_LONGEST: Final = 1_000
# Header blocks that a device has to ignore (SOAP 1.1, 4.2.2 and 4.2.3; SOAP 1.2 Part 1, 2.2 to 2.4).
_BLOCKS: Final = (
    ("a header block that need not be understood", "0", ""),
    ("a header block that another node must understand", "1", "urn:example:other"),
)
_GIVES: Final = frozenset({Role.WRITES, Role.CREATES})
# Ends of built-in types, which a schema need not mean: xs:int says nothing of a device's limits.
_ENDS: Final = frozenset(
    Decimal(one) for bits in (15, 31, 63) for one in (-(2**bits), 2**bits - 1, 2 ** (bits + 1) - 1)
)
# The values of a message with their types.
_Leaves = list[tuple[tuple[int, ...], Simple]]
# An operation with the declaration of its request, and a message that it accepts.
_Message = tuple[Act, Element | None, Node | None]


@dataclass
class _Changes:
    """Sends messages to the operations that may be called, and that accept one.

    Attributes:
        caller: sends and records.
        acts: those operations, with declaration and message.
    """

    caller: Caller
    acts: list[_Message] = field(default_factory=list)

    @cached_property
    def _is_quick(self) -> bool:
        return self.caller.api.run.effort.name == "quick"

    def find(self) -> None:
        """Call each operation that reads, changes, creates or removes once, to know a message that it accepts."""
        for act in in_order(self.caller.acts.values(), self.caller.asks):
            if act.role in {Role.OTHER, Role.ENDS} or self.caller.is_repeated(act):
                continue
            with suppress(NotPossibleError):
                if act.role is Role.REMOVES:
                    # Do not call it: the thing may be the one that is read and changed.
                    self.acts.append((act, *self.caller.messages.usual(act.operation)))
                    continue
                declared, node, kind = usual_message(self.caller, act)
                has = kind is Kind.USUAL and self.caller.probes[-1].is_success
                if act.role in _GIVES and (full := full_message(self.caller, act, declared, node)):
                    if not has:
                        short = partial(self.caller.messages.message, act.port, act.operation, node)
                        self._vary(act, full, "the same message without optional parts", short)
                    has, node = True, full
                if has:
                    self.acts.append((act, declared, node))

    def by_role(self, role: Role) -> list[tuple[Act, Element, Node]]:
        """Return the operations of a role that have values in their message."""
        return [(act, declared, node) for act, declared, node in self.acts if act.role is role and declared and node]

    def write(self, act: Act, declared: Element, node: Node) -> Iterator[None]:
        """Write other values, refused ones, and values in other forms; read each, and restore the first ones."""
        readers = [one for one in self.acts if one[0].shows(act)]
        # `soap_things` compares the items of lists.
        readers = [one for one in readers if one[0].needs] or readers
        if not readers:
            return
        began, keys = self._read(readers, node), {name for one, _, _ in readers for name in one.sent}
        leaves = [leaf for leaf in simple_leaves(declared, node) if leaf[0]]
        free = [one for one in leaves if node.at(one[0]).name.lower() not in keys]
        if not self.caller.ask(act, _with_others(node, free, 0), "a message with other values").is_success:
            # Some members may not be changed: find those that may, one by one.
            tried = [(one, self.caller.ask(act, _with_others(node, [one], 0), "another value")) for one in free]
            free = [one for one, probe in tried if probe.is_success]
        self._read(readers, node)
        for turn in range(_REFUSALS if free else 0):
            self._refuse(act, declared, _with_others(node, free, turn + 1), turn)
            self._read(readers, node, times=2)
        yield
        for says, kind, other, octets, charset in self._forms(act, node, free) if free else ():
            if self.caller.ask(act, other, "a message with other values").is_success:
                self.caller.ask(act, node, "the first values")
                self._read(readers, node)
                self.caller.send(act, kind, says, octets, charset)
                self._wait(readers, other, free)
        self._others(act, node, free, readers)
        self._ends(act, node, free, readers)
        self._parts(act, declared, node, free, readers)
        self.caller.ask(act, _as_it_was(node, leaves, began), "the values that were there before")

    def _forms(self, act: Act, node: Node, free: _Leaves) -> Iterator[tuple[str, Kind, Node, bytes, str]]:
        """Yield messages in other forms: what is special, its kind, the plain message, its octets, their encoding."""
        for charset, kind, coded, turn in _ENCODED:
            made = _with_others(node, free, turn)
            whole = self.caller.messages.whole(act.port, act.operation, made).serialize().decode()
            octets = f'<?xml version="1.0" encoding="{charset}"?>{whole}'.encode(coded, "xmlcharrefreplace")
            yield f"a message in {charset}", kind, made, octets, charset
        made = _with_others(node, free, 1)
        yield "texts: cdata", Kind.VARIED, made, self._style(act, made, XmlStyle(text="cdata")), "utf-8"
        octets = self.caller.messages.message(act.port, act.operation, made)
        for text in {made.at(path).text for path, simple in free if simple.builtin in STRINGS}:
            # Only in texts: a device that reads only a part of an identifier or number refuses the message.
            if text[1:].replace(" ", "").isalnum():
                octets = octets.replace(f">{text}<".encode(), f">{text[:2]}<!-- 2 -->{text[2:]}<".encode())
        yield "comments within texts", Kind.TRIED, made, octets, "utf-8"
        for form, turn in enumerate((0, 1)):
            made = other = _with_others(node, free, turn)
            for path, simple in free:
                other = with_text(other, path, rewritten(simple, other.at(path).text, form))
            octets = self.caller.messages.message(act.port, act.operation, other)
            yield "values in another form of their types", Kind.VARIED, made, octets, "utf-8"

    def _ends(self, act: Act, node: Node, free: _Leaves, readers: list[_Message]) -> None:
        """Write the longest and the shortest values, INF and NaN, and read them back."""
        until = time.monotonic() + _BUDGET_S
        ends = [("the longest values", extreme), ("empty texts and negative numbers", shortest)]
        ends += [(f"{number} as each number", partial(boundless, number=number)) for number in ("INF", "NaN")]
        for says, texts in ends:
            tried = [node]
            for leaves in (free, *([one] for one in free)):
                made = node
                for path, simple in leaves:
                    # A large or negative number may be a speed, unless it is a setting.
                    is_free = REFERS.search(node.at(path).name) is None
                    is_free = is_free and (simple.builtin in STRINGS or KEEPS.search(act.noun) is not None)
                    made = with_text(made, path, texts(simple, node.at(path).text, is_free))
                if made in tried or time.monotonic() > until:
                    continue
                tried.append(made)
                if self.caller.ask(act, made, f"a message with {says}").is_success:
                    self._wait(readers, made, leaves)
                    if leaves is free:
                        break

    def _parts(self, act: Act, declared: Element, node: Node, free: _Leaves, readers: list[_Message]) -> None:
        """Write messages without a part, with other numbers of parts, and of derived types; read the result."""
        until = time.monotonic() + _BUDGET_S
        names = {node.at(path).name.lower() for path, _ in free} | act.inherited
        # A value that a message leaves out must stay. Use another value than the first, to which a device may return.
        node = _with_others(node, free, 1) if act.keeps else node
        if act.keeps:
            self.caller.ask(act, node, "a message with other values")
        for says, made in (*_without(declared, node), *_counted(declared, node), *_derivations(declared, node)):
            if time.monotonic() < until and not self.caller.messages.found.types.invalid(parse(made.serialize())):
                self._vary(act, node, says, partial(self.caller.messages.message, act.port, act.operation, made))
                left = [(path, kind, made.at(path)) for path, kind in simple_leaves(declared, made) if path]
                left = [one for one in left if one[2].text or one[2].name.lower() in act.emptied]
                self._wait(readers, made, [one[:2] for one in left if one[2].name.lower() in names])
                if act.keeps and says.startswith("a message without"):
                    self._wait(readers, node, free)

    def _wait(self, readers: list[_Message], made: Node, free: _Leaves) -> None:
        """Read until the written values are read, or the time for it is over."""
        until = time.monotonic() + SETTLES_S
        while True:
            is_shown = self._is_shown(self._read(readers, made), made, free)
            if is_shown or time.monotonic() > until:
                break
            time.sleep(_STEP_S)
        if not is_shown:
            self._read(readers, made, times=2)

    @staticmethod
    def _is_shown(told: dict[str, list[str]], made: Node, free: _Leaves) -> bool:
        """Return whether what was read has each value that was written, as far as it has such values."""
        texts = [(simple, made.at(path).text, told.get(made.at(path).name.lower(), [])) for path, simple in free]
        return all(is_alike(simple, text, got[0]) for simple, text, got in texts if len(got) == 1)

    def _read(self, readers: list[_Message], written: Node, times: int = 1) -> dict[str, list[str]]:
        """Read the values that a message concerns; return them by name."""
        found: dict[str, list[str]] = {}
        for _ in range(times):
            for act, _, node in readers:
                found |= _values_in(self.caller.ask(act, _with_values_of(node, written), "a valid message"))
        return found

    def _refuse(self, act: Act, declared: Element, node: Node, turn: int) -> None:
        """Send new values with one that the schema forbids."""
        kind = ("lexical", "missing", "unknown")[turn % _REFUSALS]
        tried = sorted(mutations(declared, node), key=lambda mutation: mutation.kind != kind)
        tried = [mutation for mutation in tried if mutation.kind in {"lexical", "missing", "unknown"}]
        for wrong in islice(invalid_ones(tried, self.caller.messages.found.types), 1):
            self.caller.ask(act, wrong.made[0], wrong.what, Kind.INVALID)
        if turn % 2:
            says = "a header block that must be understood"
            self.caller.ask(act, node, says, Kind.UNDERSTAND, mandatory(act.port))

    def _others(self, act: Act, node: Node, free: _Leaves, readers: list[_Message]) -> None:
        """Write to other things of the device, and read each of them afterwards."""
        keys = [
            path
            for path in node.paths()
            if node.at(path).name.lower() in {n for one, _, _ in readers for n in one.sent}
        ]
        if len(keys) != 1 or self._is_made(act):
            return
        name = node.at(keys[0]).name
        own = node.at(keys[0]).text
        known = [
            own,
            *self.caller.given.get(name.lower(), []),
            *(str(int(own) + more) for more in (1, 2) if re.fullmatch(r"\d{1,18}", own)),
        ]
        things = [with_text(node, keys[0], text) for text in list(dict.fromkeys(known))[: _THINGS + 1]]
        told = [(thing, self._read(readers, thing)) for thing in things]
        things = [thing for thing, values in told if values]
        if len(things) > 1:
            written = [_with_others(thing, free, turn) for turn, thing in enumerate(things, 1)]
            shown = list[bool]()
            for made in written:
                self.caller.ask(act, made, "a message for another thing")
                shown.append(self._is_shown(self._read(readers, made), made, free))
            # The device may write the values later.
            time.sleep(0 if all(shown) else _LATE_S)
            for made in written:
                self._read(readers, made, times=2)
            # Several clients read different things at the same moment: each must get its own.
            asked = [(one, _with_values_of(message, made)) for made in written for one, _, message in readers]
            clients = [self._address(*asked[number % len(asked)]) for number in range(MOST_CLIENTS)]
            send_together([clients] * (_ROUNDS[not self._is_quick] // 2))
            for made in written:
                self._read(readers, made, times=2)
            for thing, values in told:
                if values:
                    self.caller.ask(act, _as_it_was(thing, free, values), "the values that were there before")

    def create(self, act: Act, declared: Element, node: Node) -> Iterator[None]:
        """Create a thing of a derived type, read it, and remove it; `soap_things` creates all others."""
        remove = next((one for one in self.acts if one[0].role is Role.REMOVES and one[0].noun == act.noun), None)
        if remove is None or remove[2] is None:
            return
        told = [_values_in(probe) for probe in self._created_as_derived(act, declared, node)]
        yield
        for values in told:
            asked = Node("", "", tuple(Node(name, texts[0]) for name, texts in values.items()))
            self._read([one for one in self.acts if one[0].shows(act)], asked, times=2)
            for text in [texts[0] for name, texts in values.items() if REFERS.search(name)][:1]:
                self.remove(remove[0], remove[2], text)

    def _created_as_derived(self, act: Act, declared: Element, node: Node) -> Iterator[SoapProbe]:
        """Create a thing of a derived type, and again if that is refused; yield the success."""
        for says, made in islice(_derivations(declared, node), 1):
            for kind in (Kind.TRIED, Kind.VARIED):
                probe = self.caller.ask(act, made, says, kind)
                if probe.is_success:
                    yield probe
                    break

    def remove(self, act: Act, node: Node, id_: str) -> None:
        """Remove a thing by its id."""
        paths = [path for path in node.paths() if not node.at(path).children]
        named = [path for path in paths if REFERS.search(node.at(path).name)] or paths
        if named:
            self.caller.ask(act, with_text(node, named[0], id_), "the id of what was created")

    def _is_made(self, act: Act) -> bool:
        """Return whether an operation is for things that are created and removed, which `soap_things` does often."""
        made, gone = ({one.noun for one, _, _ in self.by_role(role)} for role in (Role.CREATES, Role.REMOVES))
        return not (made & gone).isdisjoint({singular(act.noun), act.noun})

    def _reads(self, act: Act) -> int:
        """Return how often an operation is called at most."""
        return _FEW if self._is_made(act) else _READS[not self._is_quick]

    def read_often(self) -> None:
        """Read again and again, one after another and at the same moment."""
        # Values that writes change were read as often beside them.
        written = [act for act, _, _ in self.by_role(Role.WRITES)]
        asked = list[tuple[Act, Node | None]]()
        for act, declared, node in [one for one in self.acts if one[0].role is Role.READS]:
            for says, made in _bounded(declared, node) if declared and node else ():
                self.caller.ask(act, made, says)  # there may be nothing of that number
            own = [(act, node), *((act, made) for made in self._about_another(act, declared, node))]
            for turn in range(0 if any(map(act.shows, written)) else self._reads(act)):
                self.caller.ask(act, own[turn % len(own)][1], "a valid message", Kind.USUAL)
            asked += own
        if len(asked) > 1:
            rounds = range(_ROUNDS[not self._is_quick])
            clients = [[asked[(number + turn) % len(asked)] for number in range(MOST_CLIENTS)] for turn in rounds]
            send_together([list(starmap(self._address, together)) for together in clients])

    def _about_another(self, act: Act, declared: Element | None, node: Node | None) -> Iterator[Node]:
        """Yield a message that reads something else, if the device accepts it."""
        if declared is None or node is None:
            return
        made = _with_others(node, [leaf for leaf in simple_leaves(declared, node) if leaf[0]], 1)
        known = self.caller.known_values(act)
        for path, _ in simple_leaves(declared, node):
            others = [text for text in known.get(node.at(path).name.lower(), ()) if text != node.at(path).text]
            made = with_text(made, path, others[0]) if others else made
        if made != node and self.caller.ask(act, made, "a message about another thing").is_success:
            yield made

    def _address(self, act: Act, node: Node | None) -> Addressed:
        """Return a message as one of several clients sends it."""
        octets = self.caller.messages.message(act.port, act.operation, node)
        sent = Outgoing("POST", target_of(act.port), fields_of(act.port, act.operation), octets)
        return self.caller.api.client, sent

    def vary(self) -> None:
        """Send other values that the schema allows: enumerations, other forms of booleans and of XML."""
        asked = {name for act, _, _ in self.acts if act.role is Role.READS for name in act.sent}
        for act, declared, node in self.acts:
            if act.role in {Role.CREATES, Role.REMOVES}:
                continue
            if declared and node:
                # A bound is no valid name of an existing thing.
                free = frozenset(act.sent.keys() - asked if act.role is Role.WRITES else ())
                self._vary_values(act, declared, node, free)
            if act.role is Role.WRITES:
                self.caller.ask(act, node, "the values that were there before")
        for act, _, node in [one for one in self.acts if one[0].role is Role.READS][: 1 if self._is_quick else 9]:
            # Comments are sent to no device that rejects them: client libraries write none.
            for says, style in [pair for pair in single_changes() if "comment" not in pair[0]]:
                self._vary(act, node, f"a message with {says}", partial(self._style, act, node, style))
            for says, text, actor in _BLOCKS:
                block = mandatory(act.port, text, actor)
                self._vary(act, node, says, partial(self.caller.messages.message, act.port, act.operation, node, block))
            next_ = mandatory(act.port, "1", NEXT_12 if act.port.is_12 else NEXT_ACTOR)
            self.caller.ask(act, node, "a header block that the next node must understand", Kind.UNDERSTAND, next_)
            others = [one for one, _, _ in self.acts if one.role is Role.READS and one is not act]
            other = min(others, key=lambda one: len(one.needs), default=None)
            if other is not None:
                # WS-I BP 1.1 R1127: the Body decides, or the message is refused.
                self.caller.ask(act, node, f"{OTHER_ACTION} {other.operation.name}", action=other)

    def _vary_values(self, act: Act, declared: Element, node: Node, free: frozenset[str]) -> None:
        """Send a message with other values; ``free`` as in `_alternatives`."""
        made_of = [*_alternatives(declared, node, free)]
        for says, made in _alternatives(declared, node, free, of_types=True):
            if (says, made) not in made_of:
                self.caller.ask(act, made, says)
        # Messages that write are sent without a part elsewhere, where the values are read back (_ends).
        made_of += [*_without(declared, node)] if act.role is not Role.WRITES else []
        for says, made in made_of:
            if not self.caller.messages.found.types.invalid(parse(made.serialize())):
                write = partial(self.caller.messages.message, act.port, act.operation, made)
                self._vary(act, node, says, write)

    def _style(self, act: Act, node: Node | None, style: XmlStyle) -> bytes:
        """Return a message in a style."""
        return serialize(self.caller.messages.whole(act.port, act.operation, node), style).encode()

    def _vary(self, act: Act, node: Node | None, says: str, write: Callable[[], bytes]) -> None:
        """Send a message, and again where it is refused and the usual one is not; each with a nonce of its own."""
        probe = self.caller.send(act, Kind.TRIED, says, write())
        if not probe.is_success:
            if not self.caller.ask(act, node, "a valid message").is_success:
                return
            probe = self.caller.send(act, Kind.TRIED, says, write())
        if probe.exchange is not None:
            self.caller.probes.append(replace(probe, kind=Kind.VARIED))


@scenario(needs={Need.REST}, leaves=Leaves.UNTOUCHED, stage=Stage.INPUT)
def soap_changes(api: RestInterface) -> tuple[SoapProbe, ...]:
    """Change values over SOAP, read them back, send messages to be refused in between, and restore the values."""
    changes = _Changes(Caller.of(api))
    changes.find()
    if not changes.acts:
        raise NoOccasionError("no operation that reads, writes, creates or removes by its name accepted a message")
    changes.vary()
    steps = {act.label: changes.write(act, declared, node) for act, declared, node in changes.by_role(Role.WRITES)}
    steps |= {act.label: changes.create(act, declared, node) for act, declared, node in changes.by_role(Role.CREATES)}
    api.run.limit.in_turns(steps, 1.0)
    changes.read_often()
    for act, _, node in changes.by_role(Role.REMOVES):
        for id_ in {text for texts in changes.caller.known_values(act).values() for text in texts}:
            changes.remove(act, node, id_)
    return tuple(changes.caller.probes)


def _values_in(probe: SoapProbe) -> dict[str, list[str]]:
    """Return the values in a success, by name in lower case."""
    try:
        inside = probe.inside() if probe.is_success else []
    except NotSoapError:
        return {}
    return {name: texts for element in inside for name, texts in texts_of(element).items()}


def _with_values_of(node: Node | None, written: Node) -> Node | None:
    """Return a message with the values of another one, by their names."""
    names = {written.at(path).name.lower(): written.at(path).text for path in written.paths()}
    for path in node.paths() if node else ():
        if node and (text := names.get(node.at(path).name.lower())) and not node.at(path).children:
            node = with_text(node, path, text)
    return node


def _with_others(node: Node, free: _Leaves, turn: int) -> Node:
    """Return a message with other values, by turn."""
    there = Counter[str]()
    for path, simple in free:
        name = node.at(path).name
        there[name] += 1
        # A member called name may be the thing's own; if it refers to another thing, it is refused and then left alone.
        is_free = name.lower().endswith("name") or REFERS.search(name) is None
        node = with_text(node, path, another(simple, node.at(path).text, turn + there[name] - 1, is_free))
    return node


def _as_it_was(node: Node, leaves: _Leaves, began: dict[str, list[str]]) -> Node:
    there = {name: iter(texts) for name, texts in began.items()}
    for path, _ in leaves:
        node = with_text(node, path, next(there.get(node.at(path).name.lower(), iter(())), node.at(path).text))
    return node


def _alternatives(
    declared: Element, node: Node, free: frozenset[str], *, of_types: bool = False
) -> Iterator[tuple[str, Node]]:
    """Yield further messages that may be valid, each with its description.

    The values that are called as in ``free`` get the bounds of their types too; with ``of_types``, the ends of built-in
    types, which a device may well refuse.
    """
    leaves = simple_leaves(declared, node)
    types = [simple for _, simple in leaves]
    for path, simple in leaves:
        name, text = (node.at(path).name if path else node.name), node.at(path).text
        others = [one for one in simple.enumeration if one != text]
        others += (
            {"true": ["1", "0", "false"], "false": ["1", "0", "true"]}.get(text, [])
            if simple.builtin == "boolean"
            else []
        )
        others += [plain(type_) for type_ in simple.others if name.lower() in free]
        # Two values of one type may bound each other.
        if types.count(simple) == 1 and simple.builtin in NUMBERS and name.lower() in free:
            ends = (bound for bound in (simple.minimum, simple.maximum) if bound is not None)
            others += [f"{bound:f}" for bound in ends if (bound in _ENDS) is of_types]
        if simple.builtin in STRINGS and name.lower() in free:
            others += ["\u00fc" * (simple.max_length or 0)][: (simple.max_length or _LONGEST) < _LONGEST]
        for other in others:
            yield f"{other!r} as {name}", with_text(node, path, other)
    for path, says, branch in branches(declared, node):
        yield says, node.replaced(path, ordinary(branch))
    if (turned := _reorder(node)) != node:
        yield "attributes in another order", turned


def _reorder(node: Node) -> Node:
    """Return a message whose attributes are in another order."""
    return replace(node, children=tuple(map(_reorder, node.children)), attributes=node.attributes[::-1])


def _bounded(declared: Element, node: Node) -> Iterator[tuple[str, Node]]:
    """Yield messages whose numbers are all as small or as great as their types allow, each with its description."""
    for says in ("smallest", "greatest"):
        made = node
        for path, simple in simple_leaves(declared, node):
            bound = simple.minimum if says == "smallest" else simple.maximum
            if bound is not None and simple.builtin in NUMBERS and not simple.enumeration:
                made = with_text(made, path, f"{bound:f}")
        if made != node:
            yield f"the {says} numbers", made


def _derivations(declared: Element, node: Node) -> Iterator[tuple[str, Node]]:
    """Yield messages in which a derived type takes the place of its base, each with what is special about it."""
    for made in derivations(declared, node):
        names = [text for path in made.paths() for name, text in made.at(path).attributes if name == clark(XSI, "type")]
        yield f"xsi:type {local(names[-1])}", made


def _without(declared: Element, node: Node) -> Iterator[tuple[str, Node]]:
    """Yield messages that lack a value, or have none by xsi:nil, each with what is special about it."""
    for path, part in declarations(declared, node):
        for text in ("true", "1") if part.nillable else ():
            nil = Node(part.tag, "", (), ((clark(XSI, "nil"), text),))
            yield f'xsi:nil="{text}" at {node.at(path).name}', node.replaced(path, nil)
        if not part.minimum:
            yield f"a message without {node.at(path).name}", node.replaced(path)


def _counted(declared: Element, node: Node) -> Iterator[tuple[str, Node]]:
    """Yield messages that have an element that is there twice never or once more, each with its description."""
    for path, part in declarations(declared, node):
        around, first = node.at(path[:-1]), path[-1]
        tags = [child.tag for child in around.children]
        count = tags.count(part.tag)
        for many in (0, count + 1) if count > 1 and tags.index(part.tag) == first else ():
            repeated = (around.children[first],) * many
            parts = (*around.children[:first], *repeated, *around.children[first + count :])
            yield f"{many} times {local(part.tag)}", node.replaced(path[:-1], replace(around, children=parts))
