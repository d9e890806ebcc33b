"""Values of deliveries and their notations, and records of those that were sent and of the messages that arrived."""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from http import HTTPStatus
from typing import Any, Final

from hypothesis import strategies as st

from conformance.api.rest.interface import RestInterface
from conformance.api.rest.validity import require_valid
from conformance.api.soap.forms import EXTREMES
from conformance.packs.table1.robot.robot import DELIVERIES
from conformance.papers_robot.delivery import COFFEE, COURIER, PATH_NAMES, DeliveryFields
from conformance.transport.client import Headers
from conformance.transport.exchange import Exchange
from conformance.transport.parallel import until_taken

# A gateway sends these whether or not the robot received the request (RFC 9110 15.6.3, 15.6.5).
_UNKNOWN: Final = frozenset({HTTPStatus.BAD_GATEWAY, HTTPStatus.GATEWAY_TIMEOUT})


@dataclass(frozen=True)
class Seen:
    """A delivery that arrived.

    Attributes:
        delivery: its values.
        interface: "rest" or "soap", where the observer sees that, else empty.
    """

    delivery: Delivery
    interface: str = ""


@dataclass(frozen=True)
class Sent:
    """A delivery that was sent.

    Attributes:
        how: rest, soap, coffee, same (over REST and then over SOAP), twice (the same request over REST again), or
            together (at the same moment as others).
        interface: rest or soap.
        delivery: its values.
        exchange: request and response; None if no response came.
    """

    how: str
    interface: str
    delivery: Delivery
    exchange: Exchange | None

    @property
    def is_ok(self) -> bool:
        """Return whether the robot accepted the delivery."""
        return self.exchange is not None and self.exchange.response.ok

    @property
    def may_arrive(self) -> bool:
        """Return whether the response does not show if the robot received the request."""
        return self.exchange is None or self.exchange.response.status in _UNKNOWN


@dataclass(frozen=True)
class Batch:
    """Deliveries that were sent one after another or together, and the deliveries that arrived meanwhile, in order."""

    sent: tuple[Sent, ...]
    seen: tuple[Seen, ...]


@dataclass(frozen=True)
class Deliveries:
    """All batches of a run.

    Attributes:
        batches: oldest first; a batch in which nothing was sent shows what arrived later.
        exact: whether the observer sees even the sign of a zero, which JSON may lose.
        first: index of the first batch to judge; the ones before it were judged with an earlier trace.
    """

    batches: tuple[Batch, ...] = ()
    exact: bool = True
    first: int = 0

    def key(self, delivery: Delivery) -> bytes:
        """Return a key that is equal for deliveries that the observer cannot tell apart."""
        return key_of(delivery, exact=self.exact)

    def batches_to_judge(self) -> Iterator[tuple[Batch, tuple[Batch, ...]]]:
        """Yield each batch to judge, with the batches before it."""
        for index in range(self.first, len(self.batches)):
            yield self.batches[index], self.batches[:index]


def key_of(delivery: Delivery, *, exact: bool) -> bytes:
    """Return the bytes of a delivery's values; where they are not ``exact``, -0.0 counts as 0.0."""
    if not exact:
        delivery = Delivery(delivery.message_code, *(value + 0.0 for value in delivery[1:]))
    return delivery.bits


# Greatest and least doubles, subnormals and exact integers, and the paper's own example.
_KNOWN: Final = (*EXTREMES["double"], 76.02, 41.35, 60.633, 2.2250738585072009e-308)
# Smaller numbers are written with digits alone, without an exponent.
_ONLY_DIGITS: Final = 1e15


class Delivery(DeliveryFields):
    """The values of one delivery."""

    __slots__ = ()

    @classmethod
    def of(cls, request: Mapping[str, Any]) -> Delivery:
        """Return the delivery in a JSON object with all of its fields."""
        return cls(int(request["message_code"]), *(float(request[name]) for name in cls._fields[1:]))

    @property
    def bits(self) -> bytes:
        """Return the values as bytes, which are equal only when no digit and no sign of a zero was lost."""
        return struct.pack(">q6d", *self)

    @property
    def rest_path(self) -> str:
        """Return the path of its PUT, each number in the shortest notation that parses to the same double."""
        return path_of(str(self.message_code), *(repr(value) for value in self[1:]))


def path_of(code: str, *coordinates: str) -> str:
    """Return the path of a delivery's PUT from values already written as text: code, depot, destination, source."""
    pairs = "".join(f"/{name}/{value}" for name, value in zip(PATH_NAMES, coordinates, strict=True))
    return f"{DELIVERIES}{code}{pairs}"


def put_delivery(api: RestInterface, path: str, *, fresh: bool = False, headers: Headers = ()) -> Exchange:
    """PUT a delivery that the robot must accept, and return the exchange; wait where the robot puts it off.

    Raises:
        HarnessError: the path is not valid by the contract.
        NoAnswerError: no HTTP response came.
    """
    require_valid(api.run.contract, "PUT", path)
    *_, last = until_taken(api.client.connection, lambda: api.client.send("PUT", path, headers=headers, fresh=fresh))
    return last


def notations(value: float) -> tuple[str, ...]:
    """Return the notations of a number that the contract allows: with or without sign, fraction and exponent."""
    forms = [repr(value), f"{value:.17e}", f"{value:+.20e}"]
    if abs(value) < _ONLY_DIGITS:
        plain = f"{value:.30f}"
        forms += [plain] if float(plain) == value else []
        if value.is_integer() and math.copysign(1, value) > 0:
            forms += [str(int(value)), f"+{int(value)}", f"00{int(value)}"]
        if 0 < abs(value) < 1 and "e" not in repr(value):
            forms.append(repr(value).replace("0.", ".", 1))
    return tuple(forms)


def doubles() -> st.SearchStrategy[float]:
    """Return a strategy for finite doubles over their whole range that often draws the extremes."""
    return st.one_of(st.sampled_from(_KNOWN), st.floats(allow_nan=False, allow_infinity=False))


def deliveries() -> st.SearchStrategy[Delivery]:
    """Return a strategy for deliveries with any finite coordinates."""
    return st.builds(Delivery, st.sampled_from((COURIER, COFFEE)), *[doubles()] * len(PATH_NAMES))


def lexical_deliveries() -> st.SearchStrategy[tuple[Delivery, tuple[str, ...]]]:
    """Return a strategy for deliveries, each with its values written in some allowed notation."""

    def forms(delivery: Delivery) -> st.SearchStrategy[tuple[Delivery, tuple[str, ...]]]:
        code = st.sampled_from((str(delivery.message_code), f"+{delivery.message_code}", f"0{delivery.message_code}"))
        numbers = (st.sampled_from(notations(value)) for value in delivery[1:])
        return st.tuples(st.just(delivery), st.tuples(code, *numbers))

    return deliveries().flatmap(forms)
