import math
import re
import struct
from collections import deque
from dataclasses import replace
from itertools import count

import pytest
from hypothesis import given, settings
from lxml import etree

from conformance.contract.classes import CauseKind
from conformance.documents.wsdl import read_file
from conformance.packs.table1.robot.deliveries_seen import QUIET_S, ProbeObserver
from conformance.packs.table1.robot.delivery import Delivery, Seen, deliveries, doubles, notations, path_of
from conformance.packs.table1.robot.delivery_sender import DeliverySender, Order
from conformance.packs.table1.rules.equivalence import test_equivalence_delivery as rules
from conformance.papers_robot.statement import CONTRACT_DIR
from conformance.scenarios.rule import Rule, record
from conformance.transport.client import Connection
from conformance.transport.exchange import Exchange, Request, Response
from conformance.verdict.evidence import Judge

# The contract's fine print: [+-]?(digits[.digits]|.digits)[e[+-]digits]
_NUMBER = re.compile(r"[+-]?(\d+(\.\d+)?|\.\d+)(e[+-]\d+)?")
_RULES = [one for one in vars(rules).values() if isinstance(one, Rule) and rules.counted_deliveries not in one.on]


def bits(value: float) -> bytes:
    return struct.pack(">d", value)


@settings(max_examples=300, deadline=None, database=None)
@given(doubles())
def test_every_form_of_a_number_is_the_contracts_and_loses_no_bit(value):
    for form in notations(value):
        assert _NUMBER.fullmatch(form), form
        assert bits(float(form)) == bits(value), form


def test_the_forms_are_not_all_the_same():
    assert set(notations(0.5)) >= {"0.5", ".5"}
    assert set(notations(3.0)) >= {"3", "+3", "003"}
    assert math.copysign(1, float(notations(-0.0)[0])) < 0


def test_a_path_has_its_values_in_the_papers_order():
    path = path_of("4", "68.269", "38.718", "60.633", "37.51", "76.02", "41.35")
    assert path == (
        "/robot/app/delivery/4/depot_x/68.269/depot_y/38.718/dest_x/60.633/dest_y/37.51/source_x/76.02/source_y/41.35"
    )
    assert Delivery(4, 68.269, 38.718, 60.633, 37.51, 76.02, 41.35).rest_path == path


class Robot:
    """Rest interface, publishers service and observer of a robot that has one fault, or none."""

    exact = True
    contract = read_file(CONTRACT_DIR / "publishers.wsdl")

    def __init__(self, fault, status=204):
        self._fault, self._numbers, self._seen, self._status = fault, count(1), deque(), status
        self.client, self.connection = self, Connection()

    def send(self, method, path, **_):
        parts = path.split("/")
        self._arrive("rest", Delivery(int(parts[4]), *map(float, parts[6::2])))
        return Exchange(Request(method, "http://robot" + path), Response(self._status, (), b"", 1.0))

    def post(self, body, **_):
        # In whatever style it is written: comments, CDATA and white space say nothing.
        texts = {
            etree.QName(each).localname: "".join(each.xpath("text()")) for each in etree.fromstring(body).iter("*")
        }
        named = {name: float(texts[name]) for name in Delivery._fields}
        named["message_code"] = int(named["message_code"])
        self._arrive("soap", Delivery(**named))
        return Exchange(Request("POST", "http://robot/soap", (), body), Response(200, (), b"", 1.0))

    def _arrive(self, interface, delivery):
        self._seen.extend(self._fault(next(self._numbers), Seen(delivery, interface)))

    def mark(self):
        self._seen.clear()

    def collect(self, _count, _then_s=0.0):
        seen = list(self._seen)
        self._seen.clear()
        return seen


def sender_of(fault, status=204) -> DeliverySender:
    robot = Robot(fault, status)
    return DeliverySender(robot, robot, robot)


def order(number, how) -> Order:
    delivery = Delivery(3, *(1 / 3 + number + place for place in range(6)))
    return Order(how, delivery, ("3", *map(repr, delivery[1:])))


def judged(sender, first=0) -> Judge:
    judge = Judge([rule.requirement for rule in _RULES])
    trace = replace(sender.trace(), first=first)
    for rule in _RULES:
        record(judge, rule.requirement, rule.outcomes(trace, {}))
    return judge


def found(fault) -> set[str]:
    sender = sender_of(fault)
    sender.send([order(number, how) for number, how in enumerate(("rest", "soap", "coffee", "same") * 3)])
    return {id_.split("/")[1] for id_ in judged(sender).failure_counts()}


def narrowed(seen: Seen) -> Seen:
    values = (struct.unpack(">f", struct.pack(">f", value))[0] for value in seen.delivery[1:])
    return Seen(Delivery(seen.delivery.message_code, *values), seen.interface)


@pytest.mark.parametrize(
    ("fault", "requirements"),
    [
        (lambda _, seen: [seen], set()),
        (lambda _, seen: [Seen(seen.delivery)], set()),
        (lambda number, seen: [seen, seen] if number == 1 else [seen], {"delivery-rest"}),
        (lambda number, seen: [] if number == 2 else [seen], {"delivery-soap"}),
        (lambda number, seen: [narrowed(seen)] if number == 3 else [seen], {"coffee-soap"}),
        (lambda number, seen: [] if number == 5 else [seen], {"delivery-same"}),
        (lambda _, seen: [Seen(seen.delivery, "rest")], {"delivery-soap", "coffee-soap", "delivery-same"}),
        (lambda _, seen: [Seen(seen.delivery._replace(message_code=3), seen.interface)], {"coffee-soap"}),
    ],
)
def test_what_does_not_arrive_as_it_was_sent_is_found(fault, requirements):
    assert found(fault) == requirements


def test_another_order_is_found():
    kept: list[Seen] = []

    def overtaken(number, seen):
        if number == 1:
            kept.append(seen)
            return []
        return [seen, *kept] if number == 6 else [seen]

    assert found(overtaken) == {"delivery-order"}


@pytest.mark.parametrize("late", [3, 5])
def test_a_second_message_is_found_whenever_it_comes(late):
    first: list[Seen] = []

    def again(number, seen):
        first.append(seen)
        return [seen, first[0]] if number == late else [seen]

    sender = sender_of(again)
    sender.send([order(number, "rest") for number in range(2)])
    assert not judged(sender).failure_counts()
    for turn in (1, 2):
        sender.send([order(number, "soap") for number in (2 * turn, 2 * turn + 1)])
    sender.watch(0.0)
    assert set(judged(sender, 1).failure_counts()) == {"equivalence/delivery-rest", "equivalence/delivery-only"}


@pytest.mark.parametrize(("batches", "requirements"), [(1, set()), (2, {"delivery-only"})])
def test_messages_that_the_suite_did_not_cause_fail_only_when_they_come_repeatedly(batches, requirements):
    sender = sender_of(lambda number, seen: [seen, Seen(order(900 + number, "rest").delivery)])
    for number in range(batches):
        sender.send([order(number, "rest")])
    assert {id_.split("/")[1] for id_ in judged(sender).failure_counts()} == requirements


@pytest.mark.parametrize(("status", "arrives", "found"), [(500, True, True), (500, False, False), (504, True, False)])
def test_a_delivery_that_is_not_accepted_and_arrives_is_told_as_that(status, arrives, found):
    sender = sender_of(lambda _, seen: [seen] if arrives else [], status)
    sender.send([order(1, "rest"), order(2, "rest")])
    findings = judged(sender).evidence["equivalence/delivery-only"].findings
    assert len(findings) == found
    for finding in findings.values():
        assert finding.observed.startswith("500: the message of a request that was not accepted: ")
        assert finding.cause is CauseKind.RULE  # its effect, which is no other requirement's
        assert finding.exchange.request.url.endswith(order(1, "rest").delivery.rest_path)


@settings(max_examples=50, deadline=None, database=None)
@given(deliveries())
def test_a_delivery_survives_its_path(delivery):
    parts = delivery.rest_path.split("/")
    assert Delivery(int(parts[4]), *map(float, parts[6::2])).bits == delivery.bits


class DeafProbe:
    heard_at = -math.inf

    def deliveries(self) -> list[Delivery]:
        return []


def test_a_probe_waits_for_what_may_still_be_on_its_way_and_not_for_what_was_only_read():
    probe, connection = DeafProbe(), Connection()
    observer = ProbeObserver(probe, connection)
    connection.note("GET")
    observer.mark()
    assert probe.heard_at == -math.inf
    connection.note("PUT")
    observer.mark()
    assert probe.heard_at >= connection.acted_at + QUIET_S
    heard = probe.heard_at
    observer.mark()
    assert probe.heard_at == heard
