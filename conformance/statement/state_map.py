"""The state map: in which states a device accepts an operation, and which state follows (tables ``[states]``)."""

from __future__ import annotations

import re
from typing import Annotated, Any, Literal

import msgspec
from msgspec import Meta

from conformance.contract.toml_file import Positive
from conformance.statement.motion_map import Call, Failed, Pointer

State = Annotated[str, Meta(min_length=1)]
Status = Annotated[int, Meta(ge=400, le=599)]


class Operation(msgspec.Struct, frozen=True, forbid_unknown_fields=True, rename={"taken_in": "from"}):
    """One operation.

    Attributes:
        send: the operation of the description, where the map calls it by another name; empty if the name is it.
        taken_in: the states in which it is taken (``from``); in all others it must be refused. Empty: those of a table
            ``to``, or all.
        not_in: the states in which it is not sent: nobody says what comes of it there.
        to: the state to which it leads, or a table of them by the state before; empty if the state stays.
        via: states that may be shown on the way there, in this order.
        within_s: time for that, s; None means that of the map.
        body: the body of the request; None if it has none, or the usual message of a WSDL.
        refusal: the statuses of a refusal; empty means any that is no success.
    """

    send: Call | Literal[""] = ""
    taken_in: tuple[State, ...] = ()
    not_in: tuple[State, ...] = ()
    to: str | dict[State, State] = ""
    via: tuple[State, ...] = ()
    within_s: Positive | None = None
    body: Any = None
    refusal: tuple[Status, ...] = ()

    @property
    def states(self) -> tuple[str, ...]:
        """The states that it names, in their order."""
        leads = {"": self.to} if isinstance(self.to, str) else self.to
        return (*self.taken_in, *self.not_in, *leads, *self.via, *leads.values())

    def is_taken_in(self, state: str) -> bool:
        """Return whether it is taken in a state."""
        named = self.taken_in or (() if isinstance(self.to, str) else tuple(self.to))
        return not named or state in named

    def leads(self, state: str) -> str:
        """Return the state to which it leads from another one."""
        return (self.to if isinstance(self.to, str) else self.to.get(state, "")) or state


class Change(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A change of state without an operation.

    Attributes:
        to: the states that may follow.
        within_s: time in which one of them does, s; None if it may never.
    """

    to: tuple[State, ...]
    within_s: Positive | None = None


class StateMap(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The states of a device.

    Attributes:
        read: the operation that tells the state.
        at: where the state is in its response, whatever its status.
        pattern: a regular expression that finds the state in that text, as its only group; empty if the text is it.
        operations: by "METHOD PATH" or "POST /PORT/OPERATION" of a WSDL, or by another name if they have ``send``.
        changes: what the device does by itself, by the state before it.
        within_s: time for an operation without a time of its own, s.
        failed: how a 2xx says that its request failed, or None.
        at_rest: the states in which the device does not move, by the axes of its motion map.
    """

    read: Call
    at: Pointer
    operations: dict[str, Operation]
    pattern: str = ""
    changes: dict[str, Change] = {}
    within_s: Positive = 5.0
    failed: Failed | None = None
    at_rest: tuple[State, ...] = ()

    def __post_init__(self) -> None:
        """Check that there is something to judge, that each operation can be sent, and that the state can be found.

        Raises:
            ValueError: there are fewer than two states, or a name is no operation, or the pattern has not one group.
        """
        for name, one in self.operations.items():
            if not (one.send or re.match(r"[A-Z]+ /\S*$", name)):
                raise ValueError(f'{name!r} is no "METHOD PATH", so it needs send = "METHOD PATH"')
        try:
            groups = re.compile(self.pattern).groups if self.pattern else 1
        except re.error as error:
            raise ValueError(f"pattern = {self.pattern!r} is no regular expression: {error}") from error
        if groups != 1:
            raise ValueError(f"pattern = {self.pattern!r} must have one group, which is the state")
        if len(self.states) < 2:  # noqa: PLR2004 - a state, and another one
            raise ValueError("operations name fewer than two states in from, to and via")
        if strange := set(self.at_rest) - set(self.states):
            raise ValueError(f"at_rest names {min(strange)!r}, which is no state of operations or changes")

    @property
    def states(self) -> tuple[str, ...]:
        """All states that the map names, in the order in which it does."""
        named = [state for each in self.operations.values() for state in each.states if state]
        changing = [text for name, each in self.changes.items() for text in (name, *each.to)]
        return tuple(dict.fromkeys((*named, *changing)))

    @property
    def calls(self) -> tuple[str, ...]:
        """The operations that the map names, that which reads first."""
        return (self.read, *(one.send or name for name, one in self.operations.items()))

    def state_in(self, text: str) -> str:
        """Return the state that a text names; empty if there is none."""
        found = re.search(self.pattern, text) if self.pattern else None
        return found[1] or "" if found else "" if self.pattern else text

    def following(self, state: str) -> frozenset[str]:
        """Return a state and those that it may change to by itself, in order."""
        found, left = {state}, [state]
        while left:
            change = self.changes.get(left.pop())
            new = [text for text in (change.to if change else ()) if text not in found]
            found.update(new)
            left += new
        return frozenset(found)
