"""Equal requests one after the other, and retries with an Idempotency-Key, by what arrives of them in ROS.

What a key does: draft-ietf-httpapi-idempotency-key-header 2.6. Without one, a request is another one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from http import HTTPStatus
from typing import Any, Final

from conformance.observe.clock import WALL_CLOCK
from conformance.scenarios.reaching import new_key
from conformance.scenarios.ros.gateway import PACE_S, Gateway, with_header
from conformance.scenarios.ros.robot import Heard
from conformance.scenarios.ros.web import equal, fields_in, is_success
from conformance.statement.ros_map import Acts, Body, Calls, Publishes
from conformance.transport.exchange import Attempt, Exchange
from conformance.transport.parallel import crowd

#: Time after which the client of a request that is retried goes, s, and how long what it asks for takes.
_GOES_S, _SLOW_S = 0.3, 1.0
# How long the suite waits for surplus messages, s.
_MORE_S: Final = 0.15
_ARRIVALS: Final = {"message", "request", "goal"}
#: Statuses by which a request was not performed; 409 may mean that its first sending still is (2.7 of the draft).
_REFUSALS: Final = frozenset(range(400, 500)) - {HTTPStatus.CONFLICT, HTTPStatus.REQUEST_TIMEOUT}


@dataclass(frozen=True)
class Retry:
    """Equal requests, and how many messages of them arrived.

    Attributes:
        operation: the operation.
        end: the topic, service or action that gets the messages.
        how: the requests, as a noun phrase.
        accepted: by key whether the request was accepted; None if its responses do not show it.
        last: the last attempt.
        came: how many messages arrived.
        reliable: whether no message is lost on the way.
    """

    operation: str
    end: str
    how: str
    accepted: dict[str, bool | None]
    last: Attempt
    came: int
    reliable: bool = True


def retries(
    gateway: Gateway,
    call: str,
    body: Publishes | Calls | Acts,
    *,
    reliable: bool = True,
    prepare: Callable[[float], object] = lambda _: None,
) -> Iterator[Retry]:
    """Yield equal requests: without a key, with one key, with two, and one whose first client goes.

    Args:
        gateway: the gateway.
        call: an operation that sends to ROS; the suite hears what arrives.
        body: its map.
        reliable: whether no message is lost on the way.
        prepare: has the server take so long for the next request, s.
    """
    end = body.publishes if isinstance(body, Publishes) else body.service if isinstance(body, Calls) else body.action
    key = gateway.key_of(call)
    again, first, second, cut = [new_key(key) for _ in range(4)] if key else [""] * 4
    rows = [] if key and key.required else [("two equal requests", ("", ""))]
    if key and again:
        rows += [
            (f"a request and its retry with the same {key.name}", (again, again)),
            (f"two equal requests, each with a {key.name} of its own", (first, second)),
            (f"a request whose client went, and its retry with the same {key.name}", (cut, cut)),
        ]
    for how, keys in rows:
        made, value = gateway.usual_request(call, body)
        every = [with_header(made, key.name, one) if key and one else made for one in keys]
        goes_s = _GOES_S if keys[0] and keys[0] == cut else 0.0
        prepare(_SLOW_S if goes_s else 0.0)
        gateway.robot.take_heard(end)
        # A client that closes its connection without a response, or one that awaits it.
        goes = goes_s and crowd(gateway.api.client, [[every[0]]], goes_s)[0][0]
        sent = [(keys[0] or "first", goes or gateway.attempt(every[0], body.response_s))]
        until = WALL_CLOCK.now() + body.within_s
        while True:
            sent.append((keys[1] or "second", gateway.attempt(every[1], body.response_s)))
            if not (keys[1] and _waits(sent[-1][1])) or WALL_CLOCK.now() > until:
                break
            WALL_CLOCK.sleep(PACE_S)
        if any(_is_failure(attempt, body) for _, attempt in sent):
            continue
        accepted = {name: _is_accepted([one for other, one in sent if other == name], body) for name, _ in sent}
        came = _count_heard(gateway, body, end, value, sum(map(bool, accepted.values())))
        yield Retry(call, end, how, accepted, sent[-1][1], came, reliable)


def _is_accepted(attempts: Sequence[Attempt], body: Body) -> bool | None:
    """Return whether a request was accepted by its responses; None if they do not show it."""
    refused = (isinstance(one, Exchange) and one.response.status in _REFUSALS for one in attempts)
    return any(is_success(one, body) for one in attempts) or (False if all(refused) else None)


def _waits(attempt: Attempt) -> bool:
    """Return whether a retry is refused while the first request is being performed."""
    return isinstance(attempt, Exchange) and attempt.response.status == HTTPStatus.CONFLICT


def _is_failure(attempt: Attempt, body: Body) -> bool:
    """Return whether a request failed, so that it may have been performed, and a retry may rightly be again."""
    known = isinstance(attempt, Exchange) and (attempt.response.status in _REFUSALS or is_success(attempt, body))
    return isinstance(attempt, Exchange) and not (known or _waits(attempt))


def _count_heard(gateway: Gateway, body: Body, name: str, value: dict[str, Any], wanted: int) -> int:
    """Wait until so many messages with this value have come, and a moment longer; return how many have."""
    content, came = fields_in(value, body), 0

    def is_own(heard: Heard) -> bool:
        return heard.what in _ARRIVALS and equal(fields_in(heard.content, body), content)

    until = WALL_CLOCK.now() + body.within_s
    while came < wanted and (left_s := until - WALL_CLOCK.now()) > 0:
        came += sum(map(is_own, gateway.robot.take_heard(name, 1, left_s)))
    until = WALL_CLOCK.now() + _MORE_S
    while (left_s := until - WALL_CLOCK.now()) > 0:
        came += sum(map(is_own, gateway.robot.take_heard(name, 1, left_s)))
    return came
