"""Call each operation of a WSDL that may be called: rightly, with one thing wrong, and rightly again."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from enum import StrEnum
from functools import partial
from typing import TYPE_CHECKING, Final

from conformance.api.rest.interface import RestInterface
from conformance.api.soap.messages import simple_leaves, with_text
from conformance.api.soap.mutations import STRANGE, facets, invalid_ones, mutations
from conformance.api.soap.roles import LAST, REFERS, Act, Role, acts_of, in_order, texts_of
from conformance.commandline.device_options import advice
from conformance.documents.multipart import root_of
from conformance.documents.openapi import operations_of
from conformance.documents.wsdl import SoapOperation, SoapPort
from conformance.documents.wsdl_pack import each, label_of, services_of
from conformance.documents.xml import Node, NotXmlError, clark, elements, has_doctype, has_instruction
from conformance.documents.xsd_shapes import STRINGS, Element, Simple
from conformance.scenarios.described_messages import DescribedMessages, fields_of, target_of, values_in
from conformance.scenarios.scenario import NotPossibleError, PartialTraceError, scenario
from conformance.scenarios.stage import Leaves, Need, Stage
from conformance.transport.exchange import Exchange, NoAnswerError, Unanswered
from conformance.transport.reach import is_same
from conformance.verdict.effort import Effort
from conformance.verdict.run import Run
from conformance.verdict.time_limit import TimeIsOverError

if TYPE_CHECKING:
    from lxml import etree

# Faults of invalid messages that are sent: services disagree about others, such as order and namespaces.
_FORBIDDEN: Final = ("missing", "unknown", "lexical", "range")
_MOST: Final = 4  # invalid messages of each kind of an operation at standard
_USUAL: Final = 6  # usual messages of each operation
_REPEATED: Final = 2
#: Begins what is special about a message with the SOAPAction of another operation.
OTHER_ACTION: Final = "a message with the SOAPAction of"
# Longest time for one operation, s.
_BUDGET_S: Final = 20.0
_SURVEY_SHARE: Final = 0.85  # with a time limit, only usual messages are sent after this share of it
_MANY: Final = 1000  # more than the messages of any operation: send all
# Values from the device that are tried for one operation.
_TRIED: Final = 3
# Wrong messages for any operation, and at quick, after those operations that get them all; invalid messages that a
# schema of usual size yields.
_WRONG: Final = 6
_WRONG_QUICK: Final = 2
_WHOLLY: Final = 2
_USUALLY_INVALID: Final = 4


def requests_of(effort: Effort) -> int:
    """Return about how many messages an operation is sent."""
    usual = 1 if effort.name == "quick" else _USUAL
    # A usual message follows each wrong one.
    wrong = _WRONG_QUICK if effort.name == "quick" else _WRONG
    return usual + min(_USUALLY_INVALID, len(_FORBIDDEN) * effort.cases(_MOST)) + 2 * wrong


class NotSoapError(ValueError):
    """Raised for content that is no message of the port's SOAP version; the message explains why."""


class Kind(StrEnum):
    """Kind of a message, by what its response shows."""

    USUAL = "usual"
    TRIED = "tried"
    AGAIN = "again"
    VARIED = "varied"
    INVALID = "invalid"
    UNREADABLE = "unreadable"
    VERSION = "version"
    UNDERSTAND = "understand"
    DOCTYPE = "doctype"
    EMPTY = "empty"


@dataclass(frozen=True)
class SoapProbe:
    """One message and its outcome.

    Attributes:
        operation: label.
        kind: what it shows.
        says: what is special about it, as a noun phrase.
        envelope: namespace of the port's SOAP version.
        response: tag of the element that a success has in its Body; None means one-way.
        exchange: request and response, or None.
        unanswered: the request without a response, or None.
    """

    operation: str
    kind: Kind
    says: str
    envelope: str
    response: str | None
    exchange: Exchange | None = None
    unanswered: Unanswered | None = None

    def inside(self) -> list[etree._Element]:
        """Return the children of the response's Body.

        Raises:
            NotSoapError: the response is no message of the port's SOAP version; the message says why.
        """
        if self.exchange is None:
            return []
        answer = self.exchange.response
        try:
            root = root_of(answer.header("content-type") or "", answer.body)
        except (NotXmlError, ValueError) as error:
            raise NotSoapError(f"content that cannot be read: {error}") from error
        if root.tag != clark(self.envelope, "Envelope"):
            raise NotSoapError(f"the root element {root.tag}")
        if has_doctype(root) or has_instruction(root):
            raise NotSoapError("a DOCTYPE or a processing instruction, which SOAP forbids")
        body = [element for element in elements(root) if element.tag == clark(self.envelope, "Body")]
        if len(body) != 1:
            raise NotSoapError(f"an Envelope with {len(body)} Body elements")
        return elements(body[0])

    @property
    def fault(self) -> etree._Element | None:
        """The fault in the response, or None."""
        try:
            return next((element for element in self.inside() if element.tag == clark(self.envelope, "Fault")), None)
        except NotSoapError:
            return None

    @property
    def is_success(self) -> bool:
        """Whether the response is a success: 2xx without a fault."""
        return self.exchange is not None and self.exchange.response.ok and self.fault is None


@dataclass
class Caller:
    """Sends messages and records them; ``left_out`` are operations with the reason why they are not called.

    ``acts`` are the operations that may be called, by label. ``given`` are values that the device gave, by what they
    are called or by their type; ``made`` those of what the suite created, the last first. ``current`` are those that an
    operation that reads told once, so that what writes them first leaves the device as it is. ``accepted`` are messages
    that succeeded, by label.
    """

    api: RestInterface
    messages: DescribedMessages
    acts: dict[str, Act] = field(default_factory=dict)
    probes: list[SoapProbe] = field(default_factory=list)
    left_out: list[tuple[str, str]] = field(default_factory=list)
    lost: set[str] = field(default_factory=set)
    given: dict[str | Simple, list[str]] = field(default_factory=dict)
    made: dict[str | Simple, list[str]] = field(default_factory=dict)
    current: dict[str, str] = field(default_factory=dict)
    accepted: dict[str, Node | None] = field(default_factory=dict)

    @classmethod
    def of(cls, api: RestInterface) -> Caller:
        """Return one for the operations that may be called.

        Raises:
            NotPossibleError: the device has no WSDL.
        """
        messages = DescribedMessages.of(api)
        if messages is None:
            raise NotPossibleError("the device has no WSDL")
        found, left_out = messages.found, dict[str, str]()
        described = {item.label: api.call_rules.decide(item) for item in operations_of(api.run.contract)}
        for port, operation in each(found.ports):
            label = label_of(port, operation)
            why = found.remark(operation) or ("" if described[label].may else str(described[label]))
            why = why or ("" if is_same(port.url, found.base) else f"its port is at another server, {port.url}")
            left_out |= {label: why} if why else {}
        acts = {act.label: act for act in acts_of(found) if act.label not in left_out}
        return cls(api, messages, acts, left_out=list(left_out.items()))

    def is_repeated(self, act: Act) -> bool:
        """Return whether, at quick, another version of SOAP leads to the same operation, which was called by that."""
        first = next(one for one in self.acts.values() if one.operation.name == act.operation.name)
        return self.api.run.effort.name == "quick" and first.port.is_12 != act.port.is_12

    def asks(self, operation: SoapOperation) -> int:
        """Return how many values the message of an operation has that only the device can know."""
        try:
            declared, node = self.messages.usual(operation)
        except NotPossibleError:
            return _MANY
        return len(self.messages.invented_names(declared, node)) if declared and node else 0

    def learn(self, probe: SoapProbe, node: Node | None) -> None:
        """Keep the values in a message's successful response; other content has none."""
        act = self.acts[probe.operation]
        self.accepted[probe.operation] = node
        with contextlib.suppress(NotSoapError):
            for element in probe.inside():
                told = texts_of(element)
                for given, values in values_in(element).items():
                    self.given.setdefault(given, []).extend(values)
                for name, simple in act.told.items():
                    if simple.patterns:
                        self.given.setdefault(simple, []).extend(told.get(name, ()))
                for name, simple in act.makes.items():
                    for key in act.keys(name, simple):
                        self.made[key] = [*told.get(name, ()), *self.made.get(key, ())]
                if node and act.role is Role.REMOVES:
                    gone = {node.at(path).text for path in node.paths()}
                    self.made = {key: [text for text in texts if text not in gone] for key, texts in self.made.items()}
                if act.role is Role.READS:
                    self.current |= {name: texts[0] for name, texts in told.items() if len(texts) == 1}

    def known_values(self, act: Act) -> dict[str, list[str]]:
        """Return values by name, first those of things that the suite created; for ending operations no others."""
        found: dict[str, list[str]] = {}
        for name, simple in act.sent.items():
            own = [text for key in act.keys(name, simple) for text in self.made.get(key, ())]
            others = [text for key in (name, simple) for text in self.given.get(key, ()) if act.role not in LAST]
            found[name] = list(dict.fromkeys([*own, *others]))
        return found

    def renew(self, act: Act) -> bool:
        """Create the things that an operation needs; return whether there is a new one."""
        needed = {key for name, simple in act.sent.items() for key in act.keys(name, simple)}
        for label, node in list(self.accepted.items()):
            maker = self.acts[label]
            keys = {key for name, simple in maker.makes.items() for key in maker.keys(name, simple)}
            if keys & needed and label not in self.lost and maker is not act:
                probe = self.ask(maker, node, "a message that creates")
                if probe.is_success:
                    self.learn(probe, node)
                    return True
        return False

    def ask(
        self, act: Act, node: Node | None, says: str, kind: Kind = Kind.TRIED, *blocks: Node, action: Act | None = None
    ) -> SoapProbe:
        """Send a message to an operation, with further header blocks; see `send`."""
        octets = self.messages.message(act.port, act.operation, node, *blocks)
        return self.send(act, kind, says, octets, action=action)

    def send(
        self, act: Act, kind: Kind, says: str, octets: bytes, charset: str = "utf-8", action: Act | None = None
    ) -> SoapProbe:
        """Send octets to an operation, with the SOAPAction of another one if that is given.

        Raises:
            PartialTraceError: the device does not respond any more, or the time is over.
        """
        path, operation = target_of(act.port), act.operation
        fields = fields_of(act.port, (action or act).operation)
        fields = tuple((name, text.replace("utf-8", charset)) for name, text in fields)
        probe = SoapProbe(act.label, kind, says, act.port.envelope, operation.response)
        losses = self.api.run.losses
        try:
            probe = replace(probe, exchange=self.api.client.send("POST", path, headers=fields, body=octets))
        except TimeIsOverError as none:
            raise PartialTraceError(tuple(self.probes)) from none
        except NoAnswerError as none:
            goes_on = self.api.alive()
            probe = replace(probe, unanswered=none.unanswered)
            if self.api.run.losses == losses:
                self.probes.append(probe)
            else:
                # The loss is a finding of its own, and a message that caused one is not sent again.
                self.lost.add(probe.operation)
            if not goes_on:
                raise PartialTraceError(tuple(self.probes)) from none
            return probe
        self.probes.append(probe)
        return probe


@scenario(needs={Need.REST}, leaves=Leaves.UNTOUCHED, stage=Stage.READING)
def wsdl_faults(run: Run) -> tuple[str, ...]:
    """Return the faults of the WSDL itself; nothing is called."""
    found = services_of(run.contract)
    if found is None:
        raise NotPossibleError("the device has no WSDL")
    return found.faults


@scenario(needs={Need.REST}, leaves=Leaves.UNTOUCHED, stage=Stage.READING)
def soap_survey(api: RestInterface) -> tuple[SoapProbe, ...]:
    """Call each operation that may be called, with valid messages and with wrong ones."""
    caller = Caller.of(api)
    # Operations with fewer unknown inputs come first, because their responses contain inputs of others.
    order = in_order(caller.acts.values(), caller.asks)
    api.run.limit.in_turns({act.label: _explore(caller, act) for act in order}, _SURVEY_SHARE)
    if not caller.probes:
        told = "; ".join(f"{label.rpartition('/')[2]}: {why}" for label, why in caller.left_out)
        raise NotPossibleError(f"no operation could be called. {told or 'The WSDL describes none'}")
    return tuple(caller.probes)


def _explore(caller: Caller, act: Act) -> Iterator[None]:
    """Send the messages of one operation; yield after the usual message and after each group of others."""
    try:
        yield from _groups(caller, act)
    except NotPossibleError as error:
        caller.left_out.append((act.label, str(error)))


def _groups(caller: Caller, act: Act) -> Iterator[None]:
    declared, node, kind = usual_message(caller, act)
    if act.role is not Role.READS and act.role is not Role.REMOVES:
        node = full_message(caller, act, declared, node) or node
    works = caller.probes[-1].is_success
    _read_what_it_did(caller, act, node)
    if works:
        _about_others(caller, act, node)
    yield
    effort = caller.api.run.effort
    # A created thing may be allowed only once, and a removed thing is gone.
    is_once = act.role in {Role.CREATES, Role.REMOVES}
    # At quick, send it again even if it is not repeatable: only then do effects of wrong messages show.
    quick = _REPEATED if act.role in {Role.OTHER, Role.ENDS} else 0
    for _ in range(0 if is_once else quick if effort.name == "quick" else _USUAL - 1):
        if act.label not in caller.lost:
            caller.ask(act, node, "a valid message", kind)
    yield
    until = time.monotonic() + _BUDGET_S
    tried = list(mutations(declared, node)) if declared and node else []
    drawn = [
        mutation
        for kind in _FORBIDDEN
        for mutation in effort.draw(
            [each for each in tried if each.kind == kind], _MOST, f"{caller.api.run.seed}/{kind}"
        )
    ]
    types = caller.messages.found.types
    near = (
        list(invalid_ones(facets(declared, node), types)) if declared and node and not caller.is_repeated(act) else []
    )
    for wrong in (*invalid_ones(drawn, types), *effort.subsample(near, _MOST)):
        if time.monotonic() < until and act.label not in caller.lost:
            caller.ask(act, wrong.made[0], wrong.what, Kind.INVALID)
    _ask_for_nothing(caller, act, declared, node)
    yield
    for kind, says, octets in _some_odd(caller, act, node):
        if time.monotonic() < until and act.label not in caller.lost:
            caller.send(act, kind, says, octets)
            if not is_once:
                caller.ask(act, node, f"a valid message after {says}", Kind.AGAIN)


def usual_message(caller: Caller, act: Act) -> tuple[Element | None, Node | None, Kind]:
    """Send valid messages until one is accepted; return the declaration, the last message and its kind.

    Where the device refuses a value that the suite invented, or that [values] has, it is asked with values that it
    gave, and last with one of a thing that is created for it. That it refuses one that it gave or that was invented is
    no fault: the message is recorded as tried. What ends or removes a thing gets what the suite created, and only
    without that a value of [values].

    Raises:
        NotPossibleError: no message can be made; it says what is needed.
    """
    messages, tried = caller.messages, list[Node | None]()
    current = caller.current if act.role is Role.WRITES else {}
    declared, node = messages.usual(act.operation, current=current)
    invented = messages.invented_names(declared, node) if declared and node else []
    unsure = messages.invented_names(declared, node, named=True) if declared and node else []
    names = {name.lower() for name in unsure if REFERS.search(name)} or {name.lower() for name in unsure}
    kind, is_last = Kind.TRIED if invented else Kind.USUAL, bool(unsure) and act.role in LAST
    for turn in range(_TRIED + 2 if unsure else 1):
        if act.label in caller.lost:
            break
        is_new = turn > _TRIED and caller.renew(act)
        known = caller.known_values(act)
        has = any(known.get(name) for name in names)
        if (turn > _TRIED and not is_new) or (is_last and (not has if turn else has or invented)):
            continue
        if turn:
            node = messages.usual(act.operation, 0 if is_new else turn - 1, known)[1]
            kind = kind if tried and not invented else Kind.TRIED
        if node in tried:
            continue
        tried.append(node)
        probe = caller.ask(act, node, "a valid message", Kind.TRIED if turn else kind)
        if probe.is_success:
            kind, caller.probes[-1] = Kind.USUAL, replace(probe, kind=Kind.USUAL)
            caller.learn(probe, node)
            break
    else:
        node = tried[0] if tried and kind is Kind.USUAL else node
    if not tried and is_last:
        raise NotPossibleError(
            f"the suite ends and removes only what it created, and created nothing for {act.operation.name}: allow the "
            f"operation that creates it{advice(' by --call')}, or name a value in [values]"
        )
    return declared, node, kind


def full_message(caller: Caller, act: Act, declared: Element | None, node: Node | None) -> Node | None:
    """Return an accepted message with all optional parts, and the values of a message without; None if there is none.

    That it is refused is no fault: parts may exclude each other, or refer to things that the device does not have.
    """
    if declared is None or node is None:
        return None
    values = [node.at(path) for path, _ in simple_leaves(declared, node)]
    known = caller.current | {one.name.lower(): one.text for one in values}
    for form in (1, 0):
        with contextlib.suppress(NotPossibleError):
            full = caller.messages.usual(act.operation, current=known, form=form)[1]
            if full is None or len(full.serialize()) <= len(node.serialize()):
                continue
            probe = caller.ask(act, full, "a message with all optional parts")
            if probe.is_success:
                caller.learn(probe, full)
                return full
    return None


def _read_what_it_did(caller: Caller, act: Act, node: Node | None) -> None:
    """Read the thing that an operation created or concerns: its response may break the schema in one state only."""
    probe = caller.probes[-1]
    if probe.operation != act.label or not probe.is_success or act.role not in {Role.OTHER, Role.ENDS, Role.CREATES}:
        return
    texts = {node.at(path).name.lower(): node.at(path).text for path in node.paths()} if node else {}
    with contextlib.suppress(NotSoapError):
        texts |= {name: found[0] for element in probe.inside() for name, found in texts_of(element).items()}
    for reader in caller.acts.values():
        is_its = reader.role is Role.READS and reader.needs and reader.needs <= texts.keys()
        if is_its and reader.label not in caller.lost:
            with contextlib.suppress(NotPossibleError):
                asked = caller.messages.usual(reader.operation, given={name: [text] for name, text in texts.items()})[1]
                caller.ask(reader, asked, f"what {act.operation.name} concerns")


def _about_others(caller: Caller, act: Act, node: Node | None) -> None:
    """Begin something for another thing, twice; end what has just begun; and read it."""
    for turn in (1, 1) if act.role is Role.OTHER and act.makes else (0,) if act.role is Role.ENDS else ():
        with contextlib.suppress(NotPossibleError):
            is_new = turn or caller.renew(act)
            other = caller.messages.usual(act.operation, turn, caller.known_values(act))[1] if is_new else node
            if other != node:
                caller.ask(act, other, "a message about another thing")
                _read_what_it_did(caller, act, other)


def _ask_for_nothing(caller: Caller, act: Act, declared: Element | None, node: Node | None) -> None:
    """Send a message for a missing thing, to see a declared fault."""
    if not act.operation.faults or act.role not in {Role.READS, *LAST} or declared is None or node is None:
        return
    for path, simple in simple_leaves(declared, node):
        if simple.builtin in STRINGS and REFERS.search(node.at(path).name):
            caller.ask(act, with_text(node, path, f"no {node.at(path).name}"), "an id that nothing has")


def mandatory(port: SoapPort, text: str = "1", actor: str = "") -> Node:
    """Return a header block that no device knows, and that the actor must understand if ``text`` is 1."""
    name = clark(port.envelope, "role" if port.is_12 else "actor")
    named = ((name, actor),) if actor else ()
    return Node(clark(STRANGE, "Strange"), "1", (), ((clark(port.envelope, "mustUnderstand"), text), *named))


def _some_odd(caller: Caller, act: Act, node: Node | None) -> list[tuple[Kind, str, bytes]]:
    """Return the wrong messages of `_odd` for an operation: a server reads XML before it knows the operation.

    So at quick each operation gets another one of them, and that with the header block.
    """
    odd, number = list(_odd(caller, act, node)), list(caller.acts).index(act.label)
    if caller.api.run.effort.name != "quick" or number < _WHOLLY:
        return odd
    return [one for turn, one in enumerate(odd) if one[0] is Kind.UNDERSTAND or turn % _WRONG == number % _WRONG]


def _odd(caller: Caller, act: Act, node: Node | None) -> Iterator[tuple[Kind, str, bytes]]:
    """Yield messages that are wrong whatever the operation is."""
    make = partial(caller.messages.message, act.port, act.operation, node)
    whole = make()
    yield Kind.UNREADABLE, "XML that is not well-formed", whole[: len(whole) * 2 // 3]
    yield Kind.UNREADABLE, "octets that are no XML", b"roaas"
    yield Kind.EMPTY, "an empty body", b""
    yield Kind.VERSION, "an Envelope of an unknown namespace", make(space=STRANGE)
    # An xs:boolean in SOAP 1.2 (Part 1, 5.2.3); 0 or 1 in SOAP 1.1.
    for text in ("1", "true") if act.port.is_12 else ("1",):
        yield Kind.UNDERSTAND, f"a header block that must be understood ({text})", make(mandatory(act.port, text))
    head, rest = make().split(b"\n", 1)
    yield Kind.DOCTYPE, "a DOCTYPE", head + b'\n<!DOCTYPE e [<!ENTITY a "b">]>' + rest
