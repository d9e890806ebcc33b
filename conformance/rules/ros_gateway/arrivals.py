"""What became of requests that are to be one ROS message each: how many came, and in which order.

The rules on any gateway's topics and services judge by it, and so do those on the deliveries of the paper's robot.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Hashable, Iterator, Sequence
from dataclasses import dataclass
from typing import Generic, NamedTuple, TypeVar

_Sent = TypeVar("_Sent")


@dataclass(frozen=True)
class Request(Generic[_Sent]):
    """A request that asks for one message.

    Attributes:
        sent: the request as its trace has it.
        key: the key of the message; equal for messages that cannot be told apart.
        accepted: whether it was accepted; None if the response does not show it, so its message may come.
        client: who sent it: the requests of one client have an order.
    """

    sent: _Sent
    key: Hashable
    accepted: bool | None
    client: Hashable = None


class Count(NamedTuple, Generic[_Sent]):
    """The messages equal to that of a request: how many came, and how few and how many may for all equal requests."""

    request: Request[_Sent]
    came: int
    least: int
    most: int


def counts(requests: Sequence[Request[_Sent]], heard: Sequence[Hashable]) -> Iterator[Count[_Sent]]:
    """Yield the count of each request; ``heard`` are the keys of the messages that came."""
    came = Counter(heard)
    least = Counter(one.key for one in requests if one.accepted)
    most = Counter(one.key for one in requests if one.accepted is not False)
    for one in requests:
        yield Count(one, came[one.key], least[one.key], most[one.key])


def in_order(requests: Sequence[Request[_Sent]], heard: Sequence[Hashable]) -> Iterator[tuple[Request[_Sent], bool]]:
    """Yield each request with whether its message came after that of the same client's request before.

    Requests with equal messages have no order, and neither has one whose message did not come.
    """
    places: dict[Hashable, int] = {}
    for place, key in enumerate(heard):
        places.setdefault(key, place)
    equal = Counter(one.key for one in requests)
    before: dict[Hashable, int] = {}
    for one in requests:
        if equal[one.key] == 1 and one.key in places:
            if one.client in before:
                yield one, before[one.client] < places[one.key]
            before[one.client] = places[one.key]


def come_though_refused(
    requests: Sequence[Request[_Sent]], heard: Sequence[Hashable]
) -> Iterator[tuple[Request[_Sent], int]]:
    """Yield each refused request, with how many of its messages came that no other request asked for."""
    for one, came, _, most in counts(requests, heard):
        if one.accepted is False:
            yield one, max(0, came - most)
