"""Safe methods change nothing (RFC 9110 9.2.1); PUT and DELETE are idempotent (9.2.2)."""

import time

import pytest

from conformance.api.rest.applicable import applicable_operations, reads
from conformance.api.rest.calls import JSON, Call, example_call
from conformance.api.rest.effects import reader_of, settles_at
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.snapshot import changed, changes_by_itself, flatten, take_snapshots
from conformance.api.rest.statuses import is_taken, judge_status
from conformance.transport.exchange import Exchange
from conformance.verdict.evidence import Judge

pytestmark = pytest.mark.needs("rest")
_TURNS = 3
# How long a suspect is left alone to see whether it changes by itself, s: longer than an uptime's second.
_ALONE_S = 1.3
# How long what was put is watched, s: longer than a cancelled goal takes to end.
_WATCHED_S = 0.15


@pytest.mark.phase("resting")
@pytest.mark.requirement("http/safe")
def test_reading_changes_nothing(api: RestInterface, judge: Judge) -> None:
    """What was steady before GET, HEAD and OPTIONS of everything is the same after them."""
    _judge_safe(api, judge)


@pytest.mark.phase("input")
@pytest.mark.requirement("http/safe")
def test_reading_changes_nothing_after_input(api: RestInterface, judge: Judge) -> None:
    """The same when the robot has something to lose: a list that is not empty, a value that was set."""
    if api.run.allow_motion:
        api.device.bring_to_rest(api)
        _judge_safe(api, judge)


@pytest.mark.phase("input")
@pytest.mark.requirement("http/safe")
def test_reading_leaves_what_was_put(api: RestInterface, judge: Judge) -> None:
    """What a PUT has made (an active goal) is still there after HEAD and OPTIONS of everything.

    What does not last twice as long by itself is not judged: a goal ends when it is reached.
    """
    calls = [Call(call.operation, call.values) for call in reads(api)]
    others = api.run.effort.subsample(calls, 1)
    for operation in applicable_operations(api, (), lambda item: item.method == "PUT" and bool(item.bodies), "puts"):
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
        judge.check(
            "http/safe",
            kept,
            exchange,
            "what was put still there after HEAD and OPTIONS",
            found=f"{operation.template} is answered {exchange.came} after HEAD and OPTIONS, and 200 before",
        )
    api.device.halt(api)


def _put_and_watch(
    api: RestInterface, call: Call, reader: Call, asked: list[Call], seconds: float
) -> tuple[bool, Exchange, float]:
    """PUT, ask HEAD and OPTIONS of some, and look whether what was put stays there for so long.

    Returns:
        Whether it does, the last reading, and how long all of it took, s.
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
    """Compare what is steady before and after; what changes with nothing asked as well is no effect of asking.

    A robot that changes by itself changes in some turns; one whose safe methods have effects changes in every turn.
    """
    calls = api.run.effort.subsample(reads(api), 3)
    suspects: dict[tuple[str, str], Exchange] = {}
    for turn in range(_TURNS):
        before = take_snapshots(api, calls)
        for call in calls:
            for method in ("HEAD", "OPTIONS", "GET"):
                call.send(api, method=method)
        found: dict[tuple[str, str], Exchange] = {}
        told: dict[tuple[str, str], str] = {}
        for call in calls:
            id_ = call.operation.id
            exchange = call.send(api, ("Accept", JSON))
            for place, (old, new) in changed(before[id_][0], flatten(exchange)).items():
                found[id_, place] = exchange
                told[id_, place] = f"{place} of {id_} was {old!r} before, and is {new!r}"
        suspects = found if turn == 0 else {key: item for key, item in found.items() if key in suspects}
        if not suspects:
            break
    by_id = {call.operation.id: call for call in calls}
    guilty = {
        key: exchange
        for key, exchange in list(suspects.items())[:5]
        if not changes_by_itself(api, by_id[key[0]], key[1], _ALONE_S)
    }
    for key, exchange in guilty.items():
        judge.check("http/safe", False, exchange, "the same after GET, HEAD and OPTIONS of everything", found=told[key])
    if not guilty:
        judge.check("http/safe", True, None, "the same after GET, HEAD and OPTIONS of everything")


@pytest.mark.phase("input")
@pytest.mark.requirement("http/put-idempotent")
def test_put_twice(api: RestInterface, judge: Judge) -> None:
    """The same PUT twice succeeds twice, and leaves the resource as PUT once does."""
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
            # A robot with reasons of its own to refuse the contract's example is not blamed here.
            remark = f"{operation.id} with a valid request is answered {first.came}, so it was not tried"
            judge.note("http/put-idempotent", remark)
            continue
        statuses = [item.response.status for item in (first, second)]
        fine = 200 <= statuses[1] < 300 or statuses[0] == 409
        judge.check(
            "http/put-idempotent",
            fine,
            second,
            "a second PUT that succeeds as the first did",
            found=f"{statuses[0]} and then {statuses[1]} for {operation.id}",
            cause=f"{operation.id} {statuses[1]}",
        )
        # What a single PUT reaches is judged elsewhere; here, that two do not add up.
        if fine and once:
            api.device.bring_to_rest(api)
            call.send(api)
            judge.check(
                "http/put-idempotent",
                settles_at(api, call) != "",
                second,
                "the same as after one PUT",
                found=f"after the second {operation.id}, {once}",
                cause=f"{operation.id} effect",
            )
    api.device.halt(api)


def _pair(api: RestInterface, call: Call) -> tuple[Exchange, str | None, Exchange]:
    """A PUT, what the resource then shows otherwise, and the same PUT again."""
    first = call.send(api)
    second = call.send(api)
    return first, settles_at(api, call), second


@pytest.mark.phase("input")
@pytest.mark.requirement("http/delete-idempotent")
def test_delete_twice(api: RestInterface, judge: Judge) -> None:
    """After one DELETE another one is answered 2xx or 404, and the resource stays as it is."""
    wanted = applicable_operations(api, ["http/delete-idempotent"], lambda item: item.method == "DELETE", "is a DELETE")
    by_path = {call.operation.template: call for call in reads(api)}
    for operation in wanted:
        for attempt in (1, 2):
            api.device.halt(api)
            call = example_call(api, operation)
            call.send(api)
            read = by_path.get(operation.template)
            before = _after_a_while(api, read)
            exchange = call.send(api)
            status = exchange.response.status
            judge_status(
                judge,
                "http/delete-idempotent",
                200 <= status < 300 or status == 404,
                exchange,
                "2xx or 404 for a second DELETE",
            )
            after = _after_a_while(api, read)
            # A robot with a mission waiting may have begun it in between: that is no effect of the DELETE.
            if before == after or attempt == 2:
                judge.check(
                    "http/delete-idempotent",
                    before == after,
                    exchange,
                    "the same after the second DELETE as after the first",
                    found=f"GET is answered {after} after the second DELETE, and {before} after the first",
                )
                break


def _after_a_while(api: RestInterface, read: Call | None) -> int:
    """The status of GET, once it is the same three times: a cancelled goal may take a moment to end."""
    if read is None:
        return 0
    statuses: list[int] = []
    until = time.monotonic() + api.device.settle_s
    while True:
        answer = read.send(api).response
        statuses.append(answer.status)
        if (len(statuses) > 2 and len(set(statuses[-3:])) == 1) or time.monotonic() > until:
            return statuses[-1]
