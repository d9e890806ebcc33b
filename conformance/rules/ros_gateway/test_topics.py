"""Rules on topics of a gateway: the web shows what ROS shows (statement, table ``[ros]``)."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from dataclasses import replace
from statistics import median_low
from typing import Final

from conformance.rules.ros_gateway.arrivals import Request, come_though_refused, counts, in_order
from conformance.rules.ros_gateway.judging import judge_retry
from conformance.scenarios.ros.retries import Retry
from conformance.scenarios.ros.robot import Heard
from conformance.scenarios.ros.samples import Kind
from conformance.scenarios.ros.topics import (
    Burst,
    Sent,
    Shown,
    Topics,
    topic_bursts,
    topic_reads,
    topic_refusals,
    topic_retries,
    topic_writes,
)
from conformance.scenarios.ros.web import Difference, changes, differences, document_of, equal, fields_in, is_success
from conformance.scenarios.rule import NotClaimed, Note, NotTested, Outcome, rule
from conformance.statement.ros_map import Publishes, Reads, RosMap
from conformance.transport.exchange import Exchange
from conformance.verdict.evidence import Case

# Differing fields that a finding shows.
_ROWS: Final = 4
# Characters of a message that a finding shows.
_SHOWN: Final = 200
#: Time for the link and for a busy machine, added to the times of the map, s.
SLACK_S: Final = 1.0


def reads_of(ros: RosMap, call: str) -> Reads:
    """Return the map's operation on a topic."""
    found = ros.operations[call]
    assert isinstance(found, Reads)
    return found


def rows(found: list[Difference]) -> tuple[str, str]:
    """Return ROS's value and the web's value, field by field."""
    more = f", and {len(found) - _ROWS} other fields" if len(found) > _ROWS else ""
    shown = found[:_ROWS]
    own = (f"{field.at} = {field.ros}" + f" ({field.declared})" * bool(field.declared) for field in shown)
    return "; ".join(own) + more, "; ".join(f"{field.at} = {field.web}" for field in shown) + more


@rule("ros-gateway/read-exact", on=(topic_reads,))
def read_exact(trace: Topics, ros: RosMap) -> Iterator[Outcome]:
    """Judge whether each field of a message is returned as published; the age of messages is judged elsewhere."""
    for one, older in _with_older(trace):
        if one.kind is Kind.NON_FINITE and ros.non_finite == "refused":
            expected = f"an error status for {one.what} on {one.topic}, as the map says (non_finite)"
            yield Case(one.was_shown, one.exchange, expected, cause=f"{one.operation} non-finite")
        else:
            for exchange in (one.exchange, *one.later):
                if exchange.response.cut:
                    yield Note(f"Of {one.what} on {one.topic}, the suite got {exchange.response.cut}: not compared.")
                elif is_success(exchange, reads_of(ros, one.operation)) and not any(
                    _is_in(each, exchange, trace, ros) for each in older
                ):
                    yield _of_content(one, exchange, trace, ros)


def _with_older(trace: Topics) -> Iterator[tuple[Shown, list[Shown]]]:
    """Yield each message with those that were published on its topic before it, and that are not equal to it."""
    before: dict[str, list[Shown]] = {}
    for answer in trace.probes:
        older = before.setdefault(answer.topic, [])
        other = (replace(each, operation=answer.operation) for each in reversed(older) if each.value != answer.value)
        yield answer, list(other)
        older.append(answer)


def _differences(one: Shown, exchange: Exchange, trace: Topics, ros: RosMap) -> list[Difference]:
    document, body = document_of(exchange.response.body), reads_of(ros, one.operation)
    return differences(document, json.loads(one.value), trace.definitions[one.operation], body, ros)


def _is_in(one: Shown, exchange: Exchange, trace: Topics, ros: RosMap) -> bool:
    return is_success(exchange, reads_of(ros, one.operation)) and not _differences(one, exchange, trace, ros)


def _of_content(one: Shown, exchange: Exchange, trace: Topics, ros: RosMap) -> Case:
    found = _differences(one, exchange, trace, ros)
    kinds = sorted({each.declared for each in found})
    own, web = rows(found)
    expected = f"{one.what} as ROS has it on {one.topic}: {own}" if found else f"{one.what} on {one.topic}"
    return Case(not found, exchange, expected, observed=web, cause=f"{one.operation} {' '.join(kinds[:2])}")


@rule("ros-gateway/read-fresh", on=(topic_reads,))
def read_fresh(trace: Topics, ros: RosMap) -> Iterator[Outcome]:
    """Judge whether new messages are returned in time: all eventually, half of them soon."""
    took: dict[str, list[tuple[float, Case]]] = {}
    for one, older in _with_older(trace):
        reads, took_s = reads_of(ros, one.operation), one.sent - one.published if one.earlier else 0.0
        within_s = reads.max_age_s or reads.within_s
        expected = f"{one.what} on {one.topic} within {within_s:g} s of its publication"
        if one.was_shown:
            case = Case(False, one.exchange, expected, f"an older one until {took_s:.1f} s after it", one.operation)
            took.setdefault(one.operation, []).append((took_s - within_s - SLACK_S, case))
        elif not one.reliably:
            yield Note(f"The gateway subscribes to {one.topic} with best effort, and did not get {one.what}.")
        elif not is_success(one.exchange, reads):
            if one.kind is not Kind.NON_FINITE:
                yield Case(False, one.exchange, expected, cause=f"{one.operation} {one.exchange.response.status}")
        elif back := next((each for each in older if _is_in(each, one.exchange, trace, ros)), None):
            yield Case(False, one.exchange, expected, f"{back.what} from before it", one.operation)
    for times in took.values():
        is_late = median_low(late_s for late_s, _ in times) > 0
        yield from (replace(case, holds=not is_late or late_s <= 0) for late_s, case in times)


@rule("ros-gateway/read-newest", on=(topic_reads,))
def read_newest(trace: Topics, ros: RosMap) -> Iterator[Outcome]:
    """Judge whether a message that was shown is followed by no older one."""
    for one, older in _with_older(trace):
        for later in one.later if one.was_shown and one.kind is not Kind.NON_FINITE else ():
            is_right = _is_in(one, later, trace, ros)
            back = None if is_right else next((each for each in older if _is_in(each, later, trace, ros)), None)
            expected = f"{one.what} on {one.topic}, which was returned just before, or a newer one"
            yield Case(back is None, later, expected, f"{back.what} from before it" if back else "", one.operation)


@rule("ros-gateway/write-exact", on=(topic_writes, topic_refusals))
def write_exact(trace: tuple[Burst, ...], ros: RosMap) -> Iterator[Outcome]:
    """Judge whether each published field equals the request's."""
    for burst in trace:
        for message in burst.sent:
            if message.is_wrong and message.accepted and burst.heard:
                came = f"{message.exchange.came}, and the message {burst.heard[0].value[:_SHOWN]}"
                expected, cause = f"an error status for {message.what}", f"{message.operation} {message.what}"
                yield Case(False, message.exchange, expected, came, cause)
            if not message.accepted or not message.value:
                continue
            wanted = json.loads(message.value)
            heard = [each.content for each in burst.heard]
            if not heard:
                continue  # whether one comes, another requirement says
            fits = any(equal(each, wanted) for each in heard)
            changed = changes(_fields_in(heard[-1], message, ros), _fields_in(wanted, message, ros))
            found = [] if fits else [Difference(at, "", sent, came) for at, came, sent in changed]
            own, web = rows(found)
            yield Case(
                not found,
                message.exchange,
                f"{message.what} on {message.topic} as the web sent it" + (f": {web}" if found else ""),
                observed=f"on {message.topic}: {own}",
                cause=message.operation,
            )


def _fields_in(message: dict[str, object], one: Sent, ros: RosMap) -> dict[str, object]:
    body = ros.operations[one.operation]
    assert isinstance(body, Publishes)
    return fields_in(message, body)


@rule("ros-gateway/once", on=(topic_writes, topic_bursts, topic_refusals))
def once(trace: tuple[Burst, ...], ros: RosMap) -> Iterator[Outcome]:
    """Judge whether each accepted request is exactly one message. Messages without a request are other publishers'."""
    for number, burst in enumerate(trace):
        requests, wanted = _requests_in((one for one in trace if one.operation == burst.operation), ros)
        after = (each for one in trace[number:] if one.operation == burst.operation for each in one.heard)
        is_strange, own = None in _keys(burst.heard, wanted), set(map(id, burst.sent))
        for request, came, least, _ in counts(requests, _keys(after, wanted)):
            message = request.sent
            if id(message) not in own or not message.accepted or least > 1:
                continue
            expected = f"one message on {message.topic} for an accepted request ({burst.how})"
            if came == 1 or (came > 1 and _is_blank(_fields_in(json.loads(message.value), message, ros))):
                yield Case(True, message.exchange, expected)
            elif came:
                yield Case(False, message.exchange, expected, f"{came} equal messages", f"{message.operation} several")
            elif not burst.reliable:
                yield NotTested(f"of {burst.how}, some of {message.topic} may be lost on the way")
            elif not is_strange:  # else it came, and was changed
                yield Case(False, message.exchange, expected, f"none on {message.topic}", f"{message.operation} none")


@rule("ros-gateway/once", on=(topic_retries,))
def topic_repeats(trace: tuple[Retry, ...]) -> Iterator[Outcome]:
    """Judge whether of equal requests each is one message, and a retry with its key none."""
    yield from map(judge_retry, trace)


def _requests_in(bursts: Iterable[Burst], ros: RosMap) -> tuple[list[Request[Sent]], list[dict[str, object]]]:
    """Return the messages that were asked for, and their different contents, whose indexes are the keys."""
    requests: list[Request[Sent]] = []
    wanted: list[dict[str, object]] = []
    for message in (message for burst in bursts for message in burst.sent if message.value):
        content = _fields_in(json.loads(message.value), message, ros)
        key = next((key for key, one in enumerate(wanted) if equal(one, content)), len(wanted))
        wanted += [content] * (key == len(wanted))
        requests.append(Request(message, key, message.accepted, message.client))
    return requests, wanted


def _keys(heard: Iterable[Heard], wanted: list[dict[str, object]]) -> list[int | None]:
    """Return the key of each message that came; None if no request names it."""
    contents = [each.content for each in heard]
    return [next((key for key, one in enumerate(wanted) if equal(each, one)), None) for each in contents]


def _is_blank(value: object) -> bool:
    """Return whether a message has nothing but zeros and the like: a watchdog sends that as well."""
    if isinstance(value, dict):
        return all(map(_is_blank, value.values()))
    return all(map(_is_blank, value)) if isinstance(value, list) else not value


@rule("ros-gateway/order", on=(topic_bursts,))
def order(trace: tuple[Burst, ...], ros: RosMap) -> Iterator[Outcome]:
    """Judge whether the messages of one client are published in the order of its requests."""
    for burst in trace:
        requests, wanted = _requests_in([burst], ros)
        for request, holds in in_order(requests, _keys(burst.heard, wanted)):
            one = request.sent
            expected = f"the messages on {one.topic} in the order of the requests ({burst.how})"
            yield Case(holds, one.exchange, expected, "one before that of an earlier request", one.operation)


@rule("ros-gateway/refused-nothing", on=(topic_refusals, topic_writes))
def refused_nothing(trace: tuple[Burst, ...], ros: RosMap) -> Iterator[Outcome]:
    """Judge whether a refused request publishes nothing."""
    if all(message.accepted for burst in trace for message in burst.sent):
        yield NotClaimed("the gateway refused no request")
    for burst in trace:
        requests, wanted = _requests_in([burst], ros)
        came = {id(one.sent): count for one, count in come_though_refused(requests, _keys(burst.heard, wanted))}
        for message in (message for message in burst.sent if not message.accepted):
            holds = not (came[id(message)] if message.value else burst.heard)
            expected = f"no message on {message.topic}, as the request was refused ({message.what})"
            found = f"the message {(message.value or burst.heard[0].value)[:_SHOWN]}" if not holds else ""
            yield Case(holds, message.exchange, expected, found, cause=message.operation)
