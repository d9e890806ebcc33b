"""Rules on deliveries that the robot must reject: none of them may reach ROS."""

from collections.abc import Callable, Iterator
from http import HTTPStatus

from conformance.packs.table1.robot.delivery import Delivery
from conformance.packs.table1.scenarios.counted_deliveries import (
    CORRECT,
    NO_CREDENTIALS,
    CountedDeliveries,
    Rejected,
    counted_deliveries,
)
from conformance.scenarios.rule import Note, Outcome, rule
from conformance.transport.exchange import SAFE_METHODS
from conformance.verdict.evidence import Case


@rule("strict-input/delivery-refused", on=(counted_deliveries,))
def delivery_refused(trace: CountedDeliveries) -> Iterator[Outcome]:
    """Judge that the robot rejects invalid deliveries, and that neither they nor other methods make a message."""
    for exchange in trace.invalid:
        holds = exchange.response.status >= HTTPStatus.BAD_REQUEST
        yield Case(holds, exchange, "a status of 400 or above for an invalid delivery")
    if not _was_observed(trace):
        reason = trace.unseen or "no valid delivery was seen to arrive"
        yield Note(f"judged by the responses alone: {reason}")
        return
    seen = trace.seen or ()
    for count in trace.by_method:
        accepted = count.exchange.response.ok and count.method not in SAFE_METHODS
        expected = "no DeliveryRequestMsg on ROS: only a PUT to the path that the contract has starts a delivery"
        yield Case(count.delivery not in seen or accepted, count.exchange, expected, "a message", count.method)
    yield from _without_effect(trace, lambda _: True)
    unknown = [delivery for delivery in seen if delivery not in trace.valid_deliveries]
    # A single delivery that resembles none of the suite's may be another client's.
    found = [delivery for delivery in unknown if _resembles(delivery)] or (unknown if len(unknown) > 1 else [])
    accepted_first = next((one for one in trace.invalid if one.response.ok), trace.invalid[-1])
    observed = f"{len(found)} messages, among them {found[0]}" if found else ""
    yield Case(not found, accepted_first, "no message for an invalid delivery", observed)


@rule("soap-basic-profile/authentication", on=(counted_deliveries,))
def unauthorized_delivery(trace: CountedDeliveries) -> Iterator[Outcome]:
    """Judge that a SOAP delivery without credentials makes no message."""
    return _without_effect(trace, lambda rejection: rejection.what == NO_CREDENTIALS)


def _without_effect(trace: CountedDeliveries, which: Callable[[Rejected], bool]) -> Iterator[Outcome]:
    """Judge that messages with valid values that the robot rejected for another reason are not published."""
    for rejection in trace.rejected if _was_observed(trace) else ():
        if which(rejection) and rejection.is_rejected:
            arrived = rejection.delivery in (trace.seen or ())
            expected = f"no DeliveryRequestMsg for a rejected SOAP message with {rejection.what}"
            yield Case(not arrived, rejection.exchange, expected, "a message", rejection.what)


@rule("http/not-acceptable-undone", on=(counted_deliveries,))
def not_acceptable_delivery(trace: CountedDeliveries) -> Iterator[Outcome]:
    """Judge that a delivery that the robot answered 406 makes no message."""
    if _was_observed(trace) and trace.answer is not None and trace.answer.response.status == HTTPStatus.NOT_ACCEPTABLE:
        arrived = trace.no_format in (trace.seen or ())
        yield Case(not arrived, trace.answer, "no message for a delivery that is answered 406", "a message")


@rule("equivalence/delivery-rest", on=(counted_deliveries,))
def rest_after_refusals(trace: CountedDeliveries) -> Iterator[Outcome]:
    """Judge that a valid delivery directly after invalid ones arrives unchanged."""
    yield from _judge_arrivals(trace, soap=False)


@rule("equivalence/delivery-soap", on=(counted_deliveries,))
def soap_after_refusals(trace: CountedDeliveries) -> Iterator[Outcome]:
    """Judge that a valid delivery directly after invalid messages arrives unchanged."""
    yield from _judge_arrivals(trace, soap=True)


def _judge_arrivals(trace: CountedDeliveries, *, soap: bool) -> Iterator[Outcome]:
    for delivery, exchange in trace.after if _was_observed(trace) else ():
        if exchange.response.ok and (exchange.request.method == "POST") is soap:
            found = f"{delivery} is not among {len(trace.seen or ())} messages"
            yield Case(delivery in (trace.seen or ()), exchange, f"a message for {delivery}", found)


@rule("equivalence/delivery-rest", on=(counted_deliveries,))
def accepted_delivery(trace: CountedDeliveries) -> Iterator[Outcome]:
    """Judge that a delivery whose Accept header excludes all formats arrives if the robot accepts it."""
    if _was_observed(trace) and trace.answer is not None and trace.answer.response.ok:
        arrived = trace.no_format in (trace.seen or ())
        yield Case(arrived, trace.answer, "a message for a delivery that is accepted", "no message")


def _was_observed(trace: CountedDeliveries) -> bool:
    """Return whether arrivals were observed, which the last valid delivery proves."""
    return trace.seen is not None and trace.last in trace.seen


def _resembles(delivery: Delivery) -> bool:
    """Return whether a delivery may come from an invalid request with one wrong value."""
    same = sum(value == float(sent) for value, sent in zip(delivery[1:], CORRECT[1:], strict=True))
    return same >= len(CORRECT) // 2
