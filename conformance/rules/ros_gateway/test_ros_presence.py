"""Rules on absent messages, on discovery, and on lists of the graph."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Final

from conformance.rules.ros_gateway.judging import fails_as, statuses
from conformance.scenarios.ros.presence import (
    Absence,
    Grown,
    Growth,
    Listed,
    Presence,
    Publishers,
    Strangers,
    graph_grows,
    graph_lists,
    lists_beside_graph,
    many_reads,
    publishers_end,
    publishers_of_each_quality,
    topics_at_first,
)
from conformance.scenarios.ros.services import Services, service_calls
from conformance.scenarios.ros.topics import Burst, topic_bursts
from conformance.scenarios.ros.web import is_success
from conformance.scenarios.rule import NotClaimed, NotTested, Outcome, rule
from conformance.verdict.evidence import Case

# Names that a finding shows.
_NAMES: Final = 5
_ALL: Final = "all topics at once"


@rule("ros-gateway/absent", on=(topics_at_first,))
def absent(trace: tuple[Absence, ...]) -> Iterator[Outcome]:
    """Judge whether an operation reports that there was no message yet."""
    for absence in trace:
        if not absence.body.absent and absence.body.failure is None:
            yield NotClaimed("the map does not say what a topic without a message returns: `absent`")
        elif is_success(absence.exchange, absence.body) and absence.body.max_age_s is None:
            yield NotTested("the gateway may have a message from before this run, and keeps it as long as it likes")
        else:
            yield _absence(absence)


@rule("ros-gateway/stale", on=(publishers_end,))
def stale(trace: Publishers) -> Iterator[Outcome]:
    """Judge whether an operation reports that its last message is too old."""
    if not trace.absences:
        yield NotClaimed("the map says of no topic how old a message may be: `max_age_s`")
    for absence in trace.absences:
        if absence.first is not None and not is_success(absence.first, absence.body):
            yield NotTested("there was no message that could become too old")
        else:
            yield _absence(absence)


def _absence(one: Absence) -> Case:
    holds = fails_as(one.exchange, one.body, one.body.absent)
    expected = f"{statuses(one.body.absent)} for {one.body.topic}, {one.when}"
    if one.first is not None:
        expected += f" over {one.body.max_age_s:g} s ago"
    status = one.exchange.response.status
    return Case(holds, one.exchange, expected, cause=f"{one.when} {'2xx' if one.exchange.response.ok else status}")


@rule("ros-gateway/own-topic", on=(publishers_end,))
def own(trace: Publishers) -> Iterator[Outcome]:
    """Judge whether an operation returns the messages of its topic while others have as new ones."""
    every = (presence for presence in trace.presences if presence.publisher == _ALL)
    yield from _judge_heard(every, "the message of its own topic, while all topics have one")


@rule("ros-gateway/recovers", on=(publishers_end,))
def recovers(trace: Publishers) -> Iterator[Outcome]:
    """Judge whether messages are returned again after their publisher was away."""
    yield from _judge_heard(presence for presence in trace.presences if presence.publisher != _ALL)


@rule("ros-gateway/qualities", on=(publishers_of_each_quality,))
def qualities(trace: tuple[Presence, ...]) -> Iterator[Outcome]:
    """Judge whether publishers of each reliability and durability are heard."""
    yield from _judge_heard(trace)


def _judge_heard(presences: Iterable[Presence], expected: str = "") -> Iterator[Case]:
    """Judge whether the message of each publisher is returned."""
    for presence in presences:
        found = "an older message" if presence.exchange.response.ok else ""
        found = f"the message of {presence.instead}" if presence.instead else found
        cause = "another" if presence.instead else presence.publisher
        text = expected or f"the message of {presence.publisher}"
        yield Case(presence.shown, presence.exchange, text, found, cause)


@rule("ros-gateway/lists", on=(graph_lists,))
def lists(trace: tuple[Listed, ...]) -> Iterator[Outcome]:
    """Judge whether lists have exactly the names on the graph, with their types."""
    for listing in trace:
        wanted = f"{listing.name} ({listing.kind})" if listing.there else f"no {listing.name}"
        when = "it came to" if listing.there else "it left"
        expected = f"{wanted} within {listing.body.timeout_s:g} s after {when} the graph"
        if "/_" in listing.name and not listing.there:
            expected = f"no {listing.name}, a hidden name"
        cause = f"{listing.there} {bool(listing.found)}"
        yield Case(listing.right, listing.exchange, expected, listing.found or "no such name", cause)


@rule("ros-gateway/lists", on=(graph_grows,))
def lists_grow(trace: Grown) -> Iterator[Outcome]:
    """Judge whether lists have many new topics, and none of them after they have gone."""
    for wrong, exchange in trace.lacking:
        expected, found = f"all of {trace.count} new topics", f"{trace.count - wrong} of them"
        yield Case(not wrong, exchange, expected, found, "lacks many")
    for wrong, exchange in trace.left:
        yield Case(
            not wrong, exchange, f"none of {trace.count} topics that have gone", f"{wrong} of them", "keeps many"
        )


@rule("ros-gateway/lists", on=(lists_beside_graph,))
def lists_nothing_else(trace: tuple[Strangers, ...]) -> Iterator[Outcome]:
    """Judge whether every name in a list is on the graph."""
    for listed in trace:
        expected = "only names that are on the graph"
        yield Case(not listed.names, listed.exchange, expected, ", ".join(listed.names[:_NAMES]), "not on the graph")


@rule("ros-gateway/recovers", on=(graph_grows,))
def serves_beside(trace: Grown) -> Iterator[Outcome]:
    """Judge whether topics are read while the graph has many others."""
    yield from _judge_heard(trace.presences)


@rule("ros-gateway/subscriptions", on=(service_calls,))
def clients(trace: Services) -> Iterator[Outcome]:
    """Judge whether calls leave no clients of their service behind."""
    for one in trace.clients:
        expected = f"at most {one.count // 2} more clients of {one.body.service} after {one.count} calls in a row"
        yield Case(one.more <= one.count // 2, one.attempt, expected, f"{one.more} more", "clients")


@rule("ros-gateway/subscriptions", on=(many_reads,))
def subscriptions(trace: tuple[Growth, ...]) -> Iterator[Outcome]:
    """Judge whether reads leave no subscriptions behind."""
    for growth in trace:
        most, topic = growth.count // 2, growth.body.topic
        what = "clients of the stream came and went" if growth.body.stream else "reads"
        expected = f"at most {most} more subscriptions to {topic} after {growth.count} {what}"
        yield Case(growth.more <= most, growth.exchange, expected, f"{growth.more} more", "more")


@rule("ros-gateway/subscriptions", on=(topic_bursts,))
def publishers(trace: tuple[Burst, ...]) -> Iterator[Outcome]:
    """Judge whether requests to publish leave no publishers behind."""
    for operation in dict.fromkeys(burst.operation for burst in trace):
        bursts = [one for one in trace if one.operation == operation and one.sent]
        count, worst = sum(len(one.sent) for one in bursts), max(bursts, key=lambda one: one.more)
        expected = f"at most {count // 2} more publishers on {worst.sent[0].topic} after {count} requests"
        yield Case(worst.more <= count // 2, worst.sent[-1].exchange, expected, f"{worst.more} more", "publishers")
