"""Safe methods change nothing (RFC 9110 9.2.1); PUT and DELETE are idempotent (9.2.2)."""

import time

import pytest

from conformance.api.expectation import expect
from conformance.api.rest.applicable import applicable_operations, reads, usable_operations
from conformance.api.rest.calls import JSON, Call, example_call
from conformance.api.rest.effects import changes_by_itself, deltas, flatten, reader_of, settles_at, take_snapshots
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.statuses import is_taken
from conformance.transport.exchange import Exchange
from conformance.verdict.evidence import Judge

pytestmark = pytest.mark.needs("rest")
_TURNS = 3
# How long a suspect is left alone to see whether it changes by itself, s: longer than an uptime's second.
_ALONE_S = 1.3
# Suspects that are left alone, one after the other.
_SUSPECTS = 5
# How long a put value is watched, s: longer than a cancelled goal takes to end.
_WATCHED_S = 0.15


@pytest.mark.phase("resting")
@pytest.mark.requirement("http/safe")
def test_reading_changes_nothing(api: RestInterface, judge: Judge) -> None:
    """Compare the state that was steady before GET, HEAD and OPTIONS of every resource with the state after them."""
    _judge_safe(api, judge)


@pytest.mark.phase("input")
@pytest.mark.requirement("http/safe")
def test_reading_changes_nothing_after_input(api: RestInterface, judge: Judge) -> None:
    """Compare the same after input that a safe request could destroy: a list with entries, a value that was set."""
    if api.run.allow_motion:  # else nothing was put, and the check before this one has judged the same
        api.device.bring_to_rest(api)
        _judge_safe(api, judge)


@pytest.mark.phase("aside")
@pytest.mark.requirement("http/safe")
def test_reading_leaves_what_was_put(api: RestInterface, judge: Judge) -> None:
    """PUT a resource (a goal), and check that HEAD and OPTIONS of every resource do not remove it.

    A resource that does not last twice as long by itself is not judged: a goal ends when the robot reaches it.
    """
    calls = [call.bare for call in reads(api)]
    others = api.run.effort.subsample(calls, 1)
    for operation in usable_operations(api, lambda item: item.method == "PUT" and bool(item.bodies)):
        api.device.halt(api)
        call = example_call(api, operation)
        reader = reader_of(api, call)
        if reader is None or reader.send(api).response.ok:
            continue
        kept, exchange, took = _put_and_watch(api, call, reader, [reader, *others], _WATCHED_S)
        if not kept:
            # Does it last by itself, twice as long? Then once more with HEAD and OPTIONS.
            if not _put_and_watch(api, call, reader, [], 2 * took)[0]:
                continue
            kept, exchange, _ = _put_and_watch(api, call, reader, [reader, *others], _WATCHED_S)
        expected = f"status 200 for {operation.template} after HEAD and OPTIONS, as before"
        expect(judge, "http/safe", exchange).that(kept, expected)
    api.device.halt(api)


def _put_and_watch(
    api: RestInterface, call: Call, reader: Call, asked: list[Call], seconds: float
) -> tuple[bool, Exchange, float]:
    """Send PUT, then HEAD and OPTIONS to other resources, and read for ``seconds`` whether the new resource stays.

    Returns:
        Whether it stayed, the last reading, and the total time, s.
    """
    api.device.halt(api)
    call.send(api)
    started = time.monotonic()
    exchange = reader.send(api)
    for item in asked:
        for method in ("HEAD", "OPTIONS"):
            item.send(api, method=method)
    until = time.monotonic() + seconds
    while exchange.response.ok and time.monotonic() < until:
        time.sleep(0.01)
        exchange = reader.send(api)
    return exchange.response.ok, exchange, time.monotonic() - started


def _judge_safe(api: RestInterface, judge: Judge) -> None:
    """Compare the steady state before and after safe requests; state that also changes without them does not count.

    A robot that changes by itself does so in some rounds; one whose safe requests have effects changes in every round.
    """
    calls = api.run.effort.subsample(reads(api), 3)
    suspects: dict[tuple[str, str], Exchange] = {}
    for turn in range(_TURNS):
        before = take_snapshots(api, calls)
        for call in calls:
            for method in ("HEAD", "OPTIONS", "GET"):
                call.send(api, method=method)
        found: dict[tuple[str, str], Exchange] = {}
        changes: dict[tuple[str, str], str] = {}
        for call in calls:
            id_ = call.operation.id
            exchange = call.send(api, ("Accept", JSON))
            for place, (old, new) in deltas(before[id_][0], flatten(exchange)).items():
                found[id_, place] = exchange
                changes[id_, place] = f"{place} of {id_} changed from {old!r} to {new!r}"
        suspects = found if turn == 0 else {key: item for key, item in found.items() if key in suspects}
        if not suspects:
            break
    by_id = {call.operation.id: call for call in calls}
    watched = list(suspects.items())[:_SUSPECTS]
    if len(suspects) > len(watched):
        said = f"{len(suspects)} values changed; whether they change by themselves was watched for {_SUSPECTS} of them"
        judge.note("http/safe", said)
    guilty = {key: exchange for key, exchange in watched if not changes_by_itself(api, by_id[key[0]], key[1], _ALONE_S)}
    expected = "the same values after GET, HEAD and OPTIONS of everything"
    for key, exchange in guilty.items():
        expect(judge, "http/safe", exchange).that(False, expected, changes[key])
    if not guilty:
        expect(judge, "http/safe", None).that(True, expected)


@pytest.mark.phase("aside")
@pytest.mark.requirement("http/put-idempotent")
def test_put_twice(api: RestInterface, judge: Judge) -> None:
    """Send the same PUT twice: both succeed, and the resource is as after the first."""
    wanted = applicable_operations(api, ["http/put-idempotent"], lambda item: item.method == "PUT", "is a PUT")
    for operation in wanted:
        api.device.bring_to_rest(api)
        call = example_call(api, operation)
        first, once, second = _pair(api, call)
        if second.response.status == 409:
            # A goal of the robot's own may have begun in between: once more from the start.
            api.device.bring_to_rest(api)
            first, once, second = _pair(api, call)
        if not is_taken(first):
            # A robot may have reasons of its own to refuse the contract's example.
            judge.note("http/put-idempotent", f"not tried on {operation.id}: a valid request for it got {first.came}")
            continue
        statuses = [item.response.status for item in (first, second)]
        fine = 200 <= statuses[1] < 300 or statuses[0] == 409
        expect(judge, "http/put-idempotent", second).that(
            fine,
            f"status 2xx for the second PUT, as for the first ({statuses[0]})",
            cause=f"{operation.id} {statuses[1]}",
        )
        # The effect of a single PUT is judged elsewhere; here, that two do not add up.
        if fine and once:
            api.device.bring_to_rest(api)
            call.send(api)
            expect(judge, "http/put-idempotent", second).that(
                settles_at(api, call) != "",
                "the same values after two PUTs as after one",
                f"{once} after the second {operation.id}",
                cause=f"{operation.id} effect",
            )
    api.device.halt(api)


def _pair(api: RestInterface, call: Call) -> tuple[Exchange, str | None, Exchange]:
    """Send a PUT twice; return both exchanges, and where the resource differed from the request in between."""
    first = call.send(api)
    second = call.send(api)
    return first, settles_at(api, call), second


@pytest.mark.phase("aside")
@pytest.mark.requirement("http/delete-idempotent")
def test_delete_twice(api: RestInterface, judge: Judge) -> None:
    """Send DELETE twice: the second must get 2xx or 404, and leave the resource unchanged."""
    wanted = applicable_operations(api, ["http/delete-idempotent"], lambda item: item.method == "DELETE", "is a DELETE")
    by_path = {call.operation.template: call for call in reads(api)}
    for operation in wanted:
        for attempt in (1, 2):
            api.device.halt(api)
            call = example_call(api, operation)
            call.send(api)
            read = by_path.get(operation.template)
            before = _after_a_while(api, read)
            # Many clients say that it has no content, which is no other request.
            exchange = call.send(api, ("Content-Length", "0"))
            expect(judge, "http/delete-idempotent", exchange).status("2xx", 404, when="it is the second DELETE")
            after = _after_a_while(api, read)
            # A robot with a mission waiting may have begun it in between: that is no effect of the DELETE.
            if before == after or attempt == 2:
                expected = f"status {before} for GET after the second DELETE, as after the first"
                expect(judge, "http/delete-idempotent", exchange).that(
                    before == after, expected, f"status {after} for GET"
                )
                break


def _after_a_while(api: RestInterface, read: Call | None) -> int:
    """Return the status of GET once it is the same three times: a cancelled goal may take a moment to end."""
    if read is None:
        return 0
    statuses: list[int] = []
    until = time.monotonic() + api.device.settle_s
    while True:
        answer = read.send(api).response
        statuses.append(answer.status)
        if (len(statuses) > 2 and len(set(statuses[-3:])) == 1) or time.monotonic() > until:
            return statuses[-1]
