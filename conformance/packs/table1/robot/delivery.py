"""The values of a delivery, and the notations in which a client may write them."""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping
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
