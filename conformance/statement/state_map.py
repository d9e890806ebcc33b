"""The state map: in which states a device accepts an operation, and which state follows (tables ``[states]``)."""

from __future__ import annotations

from typing import Annotated, Any

import msgspec
from msgspec import Meta

from conformance.contract.toml_file import Positive
from conformance.statement.motion_map import Call, Failed, Pointer

State = Annotated[str, Meta(min_length=1)]
Status = Annotated[int, Meta(ge=400, le=599)]


class Operation(msgspec.Struct, frozen=True, forbid_unknown_fields=True, rename={"taken_in": "from"}):
    """One operation.

    Attributes:
        taken_in: the states in which it is taken (``from``); in all others it must be refused. Empty: in all.
        to: the state to which it leads; empty: the state stays.
        via: states that may be shown on the way there, in this order.
        within_s: time for that, s; None: that of the map.
        body: of the request; None: it has none, or the usual message of a WSDL.
        refusal: the statuses of a refusal; empty: any that is no success.
    """

    taken_in: tuple[State, ...] = ()
    to: str = ""
    via: tuple[State, ...] = ()
    within_s: Positive | None = None
    body: Any = None
    refusal: tuple[Status, ...] = ()

    def is_taken_in(self, state: str) -> bool:
        """Return whether it is taken in a state."""
        return not self.taken_in or state in self.taken_in


class Change(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What becomes of a state by itself.

    Attributes:
        to: the states that may follow.
        within_s: time in which one of them does, s; None: it may never.
    """

    to: tuple[State, ...]
    within_s: Positive | None = None


class StateMap(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The states of a device.

    Attributes:
        read: the operation that tells the state.
        at: where the state is in its response.
        operations: by "METHOD PATH" or "POST /PORT/OPERATION" of a WSDL.
        changes: what the device does by itself, by the state before it.
        within_s: time for an operation without a time of its own, s.
        failed: how a 2xx says that its request failed, or None.
    """

    read: Call
    at: Pointer
    operations: dict[Call, Operation]
    changes: dict[str, Change] = {}
    within_s: Positive = 5.0
    failed: Failed | None = None

    def __post_init__(self) -> None:
        """Check that there is something to judge.

        Raises:
            ValueError: there are fewer than two states.
        """
        if len(self.states) < 2:  # noqa: PLR2004 - a state, and another one
            raise ValueError("operations name fewer than two states in from, to and via")

    @property
    def states(self) -> tuple[str, ...]:
        """All states that the map names, in the order in which it does."""
        named = [one for each in self.operations.values() for one in (*each.taken_in, *each.via, each.to) if one]
        changing = [one for name, each in self.changes.items() for one in (name, *each.to)]
        return tuple(dict.fromkeys((*named, *changing)))

    @property
    def calls(self) -> tuple[str, ...]:
        """The operations that the map names, that which reads first."""
        return (self.read, *self.operations)

    def following(self, state: str) -> frozenset[str]:
        """Return a state and those that it may change to by itself, in order."""
        found, left = {state}, [state]
        while left:
            change = self.changes.get(left.pop())
            new = [one for one in (change.to if change else ()) if one not in found]
            found.update(new)
            left += new
        return frozenset(found)
