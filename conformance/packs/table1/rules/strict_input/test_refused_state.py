"""Rules on requests that the robot must reject: they change neither the velocity nor the goal, and none reaches ROS."""

from collections.abc import Callable, Iterator
from http import HTTPStatus

from conformance.packs.table1.robot.delivery import Delivery, key_of
from conformance.packs.table1.robot.goal import CANCELED, NEW, outcome_fault
from conformance.packs.table1.robot.robot import GOAL_PATH
from conformance.packs.table1.scenarios.attempts import GOAL
from conformance.packs.table1.scenarios.deliveries import (
    CORRECT,
    NO_CREDENTIALS,
    CountedDeliveries,
    Rejected,
    counted_deliveries,
)
from conformance.packs.table1.scenarios.refused_again import DuringGoal, RefusedAgain, refused_again
from conformance.scenarios.rule import Note, Outcome, rule
from conformance.transport.exchange import SAFE_METHODS
from conformance.verdict.evidence import Case


@rule("strict-input/velocity-refused", on=(refused_again,))
def refused_again_at_rest(trace: RefusedAgain) -> Iterator[Outcome]:
    """Judge that the robot stays at rest, without a goal, when refused requests are sent again."""
    yield from trace.rests


@rule("strict-input/goal-refused", on=(refused_again,))
def goal_refused_again(trace: RefusedAgain) -> Iterator[Outcome]:
    """Judge that the robot sets, keeps or loses no goal by goals and cancels that it has refused, sent again."""
    yield from (rest for rest in trace.rests if rest.observed in {"", GOAL})
    yield from (_judge_kept(refusal) for refusal in trace.during if _about_goal(refusal))


@rule("rest-resources/goal-get", on=(refused_again,))
def goal_kept(trace: RefusedAgain) -> Iterator[Outcome]:
    """Judge that the robot keeps its goal when anything else that it has refused is sent again."""
    return (_judge_kept(refusal) for refusal in trace.during if not _about_goal(refusal))


def _judge_kept(one: DuringGoal) -> Case:
    expected = f"the goal that was active before {one.exchange.request.method} with {one.what}"
    return Case(not one.differs, one.exchange, expected, one.differs, cause=one.what)


def _about_goal(one: DuringGoal) -> bool:
    return GOAL_PATH.rstrip("/") in one.exchange.request.url and one.exchange.request.method not in SAFE_METHODS


@rule("rest-resources/goal-drives", on=(refused_again,))
def drives_on(trace: RefusedAgain) -> Iterator[Outcome]:
    """Judge that the robot drives on to its goal while it refuses requests."""
    held_up = len(trace.stands) > 1
    if trace.drives or held_up:
        exchange = trace.stands[-1] if held_up else trace.during[-1].exchange
        found = f"a robot that stands still while it refuses requests, {len(trace.stands)} times" if held_up else ""
        yield Case(not held_up, exchange, "a robot that drives to its goal", found, "held up by refused requests")


@rule("rest-resources/goal-preempt", on=(refused_again,))
def same_pose_other_id(trace: RefusedAgain) -> Iterator[Outcome]:
    """Judge that the active goal's pose under another id is another goal."""
    put = trace.renamed
    if put is not None and not put.ended:
        problem = "" if put.exchange.response.status in NEW else put.exchange.came
        expected = "201 or 202 for the active goal's pose under another id, which is then the active goal"
        yield Case(not (problem or put.differs), put.exchange, expected, problem or put.differs, "same pose")


@rule("rest-resources/goal-conflict", on=(refused_again,))
def conflict(trace: RefusedAgain) -> Iterator[Outcome]:
    """Judge that another pose or heading under the active goal's id is refused in either format, without effect."""
    for put in trace.conflicts:
        problem = "" if put.exchange.response.status == HTTPStatus.CONFLICT else put.exchange.came
        expected = "409 for another pose under the active goal's id, and the goal as it was"
        yield Case(not (problem or put.differs), put.exchange, expected, problem or put.differs)


@rule("rest-resources/goal-outcome", on=(refused_again,))
def outcome(trace: RefusedAgain) -> Iterator[Outcome]:
    """Judge that the 404 after a cancelled goal describes that goal, not the one before."""
    if trace.cancelled is not None:
        read, id_ = trace.cancelled
        fault = outcome_fault(read, CANCELED, id_) if read.response.status == HTTPStatus.NOT_FOUND else read.came
        yield Case(not fault, read, f"a 404 with last_goal {{goal_id, status}} of the goal {id_!r}, code 5", fault)


@rule("strict-input/delivery-refused", on=(refused_again,))
def no_delivery(trace: RefusedAgain) -> Iterator[Outcome]:
    """Judge that refused requests sent again order no delivery."""
    if trace.unseen:
        yield Note(f"deliveries are not seen: {trace.unseen}")
    if trace.ordered:
        last, always = trace.ordered[-1], all(one.unknown for one in trace.ordered)
        found = f"{len(last.unknown)} messages more, among them {last.unknown[0]}" if always else ""
        yield Case(not always, last.refused, "no message for requests that are refused", found, "sent again")


@rule("equivalence/delivery-rest", on=(refused_again,))
def rest_orders(trace: RefusedAgain) -> Iterator[Outcome]:
    """Judge that a delivery over REST directly after a refused request arrives once."""
    return _once(trace, "PUT")


@rule("equivalence/delivery-soap", on=(refused_again,))
def soap_orders(trace: RefusedAgain) -> Iterator[Outcome]:
    """Judge that a delivery over SOAP directly after a refused request arrives once."""
    return _once(trace, "POST")


def _once(trace: RefusedAgain, method: str) -> Iterator[Outcome]:
    for ordered in trace.ordered:
        arrived = [key_of(delivery, exact=ordered.exact) for delivery in ordered.seen]
        for delivery, exchange in ordered.orders:
            if exchange.request.method == method:
                count = arrived.count(key_of(delivery, exact=ordered.exact))
                expected = f"exactly one message for {delivery}, directly after a refused request"
                yield Case(count == 1, exchange, expected, f"{count} messages", "after a refused request")


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
