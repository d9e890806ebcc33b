"""Rules on topics of a real robot: the gateway returns the messages that the suite receives."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Final

from conformance.rules.ros_gateway.test_topics import SLACK_S, reads_of, rows
from conformance.scenarios.ros.watching import Look, Watched, topic_watches
from conformance.scenarios.ros.web import differences, differing, document_of, is_success
from conformance.scenarios.rule import Note, Outcome, rule
from conformance.statement.ros_map import RosMap
from conformance.verdict.evidence import Case

# Share of a best-effort topic's messages that the suite may miss although the gateway has them.
_MISSED: Final = 0.5


def _places(one: Watched, ros: RosMap) -> list[tuple[Look, list[int]]]:
    """Return the looks that show a message, each with the indexes of the heard messages that it may be."""
    values, reads = [each.content for each in one.heard], reads_of(ros, one.operation)
    found = []
    for look in (look for look in one.looks if is_success(look.exchange, reads)):
        # The first difference is enough: there are many messages, and most differ in their stamp.
        document = document_of(look.exchange.response.body)
        first = [next(differing(document, value, one.definition, reads, ros), None) for value in values]
        found.append((look, [index for index, difference in enumerate(first) if difference is None]))
    return found


@rule("ros-gateway/read-exact", on=(topic_watches,))
def watched_exact(trace: tuple[Watched, ...], ros: RosMap) -> Iterator[Outcome]:
    """Judge whether each message that is returned is one that was published."""
    for watch in trace:
        places = _places(watch, ros)
        missed = sum(not found for _, found in places)
        if not watch.reliable and missed <= _MISSED * len(places):
            if missed:
                yield Note(
                    f"{missed} of {len(places)} messages of {watch.topic}, which has best effort, were not heard."
                )
            places = [(look, found) for look, found in places if found]
        for look, found in places:
            if found:
                yield Case(True, look.exchange, f"a message that was published on {watch.topic}")
                continue
            near = [each for each in watch.heard if each.at < look.sent + SLACK_S] or list(watch.heard)
            document, reads = document_of(look.exchange.response.body), reads_of(ros, watch.operation)
            every = [differences(document, json.loads(each.value), watch.definition, reads, ros) for each in near]
            own, web = rows(min(every, key=len))
            expected = f"a message that was published on {watch.topic}; the most similar one has {own}"
            yield Case(False, look.exchange, expected, web, watch.operation)


@rule("ros-gateway/read-fresh", on=(topic_watches,))
def watched_fresh(trace: tuple[Watched, ...], ros: RosMap) -> Iterator[Outcome]:
    """Judge whether a message is returned no longer than declared after the next one arrived."""
    for watch in trace:
        reads = reads_of(ros, watch.operation)
        within_s = (reads.max_age_s or reads.within_s) + SLACK_S
        for look, found in _places(watch, ros):
            if not found:
                continue
            next_at = watch.heard[found[-1] + 1].at if found[-1] + 1 < len(watch.heard) else look.sent
            expected = f"a message on {watch.topic} that was the last one {within_s:g} s before, or a newer one"
            late_s = look.sent - next_at
            came = f"one {late_s:.1f} s after the next"
            yield Case(late_s <= within_s, look.exchange, expected, came, watch.operation)


@rule("ros-gateway/read-newest", on=(topic_watches,))
def watched_newest(trace: tuple[Watched, ...], ros: RosMap) -> Iterator[Outcome]:
    """Judge whether no message is returned after a newer one."""
    for watch in trace:
        last = -1
        for look, found in _places(watch, ros):
            later = [index for index in found if index >= last]
            if found:
                expected = f"a message on {watch.topic} that is no older than the one before"
                yield Case(bool(later), look.exchange, expected, "an older one", watch.operation)
            last = later[0] if later else last
