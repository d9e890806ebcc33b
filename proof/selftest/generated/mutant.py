"""A generated mutant, the modes that decide which exchanges it alters, and the changes of single fields."""

import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Self

from proof.mutation.messages import Change, Forward, Request, Response
from proof.mutation.table import Mutant
from proof.selftest.generated.operators import Operator
from proof.selftest.generated.places import Exchange, Place
from proof.selftest.generated.slots import edit_message
from proof.selftest.generated.whens import ERROR, RARE

Alter = Callable[[Request, Response], Response | None]
# By mode: words that follow the description of a change.
MODES = {
    "rarely": f"one time in {RARE}",
    "together": "while another request is under way",
    "after-error": "after an answer with 4xx or 5xx",
}


class Tally:
    """Counts the messages that a mutant has altered in a run."""

    def __init__(self) -> None:
        self.altered = 0

    def __call__(self) -> None:
        """Count one altered message."""
        self.altered += 1


@dataclass(frozen=True)
class GeneratedMutant:
    """A mutant made by applying an operator to a field, status, header or operation.

    Attributes:
        name: ``operator:operation:place[:form]``; stable.
        says: one sentence on the defect.
        operator: name of the operator, followed by ``@`` and the mode if there is one.
        exchange: the operation.
        classes: conformance classes whose checks can kill it, the likeliest first.
        make: makes the change for one run, which counts the messages that it alters.
        always: the same mutant without its condition, if it is composed with one.
    """

    name: str
    says: str
    operator: str
    exchange: Exchange
    classes: tuple[str, ...]
    make: Callable[[Tally], Change]
    always: Self | None = None

    @property
    def interface(self) -> str:
        """Return the interface, REST or SOAP."""
        return self.exchange.side

    def as_mutant(self) -> Mutant:
        """Return this mutant as a hand-written one that no particular requirement has to kill."""
        return Mutant(self.name, self.says, (), self.interface, lambda: self.make(Tally()))


class Mode:
    """Decides which exchanges of one run a mutant alters: all, some, or those in a given situation."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._lock = threading.Lock()
        self._under_way, self._seen = 0, 0
        self._error = False

    def begin(self) -> bool:
        """Note that a request has arrived; return whether another request is in progress."""
        with self._lock:
            self._under_way += 1
            return self._under_way > 1

    def strikes(self, *, together: bool) -> bool:
        """Return whether to alter an exchange; ``together``: another request was in progress when it arrived."""
        with self._lock:
            self._seen += 1
            if self._name == "rarely":
                return self._seen % RARE == 0
            if self._name == "together":
                return together or self._under_way > 1
            return self._error if self._name == "after-error" else True

    def end(self, response: Response | None) -> None:
        """Note that an exchange has ended with this response."""
        with self._lock:
            self._under_way -= 1
            if response is not None:
                self._error = response.status >= ERROR


def in_mode(mode_name: str, alter: Alter) -> Callable[[Tally], Change]:
    """Return a change that alters responses in a mode; ``alter`` returns None for a response it leaves unchanged."""

    def make(tally: Tally) -> Change:
        mode = Mode(mode_name)

        def change(request: Request, forward: Forward) -> Response:
            together = mode.begin()
            response: Response | None = None
            try:
                response = forward(request)
                altered = alter(request, response)
                if altered is not None and mode.strikes(together=together):
                    tally()
                    return altered
                return response
            finally:
                mode.end(response)

        return change

    return make


def of_answer(operator: Operator, place: Place, mode: str = "") -> Callable[[Tally], Change]:
    """Return a change that alters the field in successful responses."""

    def make(tally: Tally) -> Change:
        edit = operator.make(place)

        def alter(request: Request, response: Response) -> Response | None:
            if not place.exchange.concerns(request) or response.status not in range(200, 300):
                return None
            altered = response.copy()
            return altered if edit_message(place, altered, edit) else None

        return in_mode(mode, alter)(tally)

    return make


def of_request(operator: Operator, place: Place) -> Callable[[Tally], Change]:
    """Return a change that alters the field in requests, counted where the robot accepts the altered request."""

    def make(tally: Tally) -> Change:
        edit = operator.make(place)

        def change(request: Request, forward: Forward) -> Response:
            if not place.exchange.concerns(request):
                return forward(request)
            altered = request.copy()
            if not edit_message(place, altered, edit):
                return forward(request)
            response = forward(altered)
            if response.status in range(200, 300):
                tally()
            return response

        return change

    return make


def answers(exchange: Exchange, when: Callable[[Response], bool], edit: Callable[[Response], object]) -> Alter:
    """Return a function that edits an operation's responses where ``when`` holds; None for an unchanged response."""

    def alter(request: Request, response: Response) -> Response | None:
        if not exchange.concerns(request) or not when(response):
            return None
        altered = response.copy()
        edit(altered)
        same = (altered.status, altered.fields, altered.body) == (response.status, response.fields, response.body)
        return None if same else altered

    return alter


def classes_of_answers(exchange: Exchange) -> tuple[str, ...]:
    """Return the conformance classes whose checks read an operation's responses, the likeliest killer first."""
    if exchange.side == "soap":
        return (*exchange.classes, "soap-basic-profile", "strict-input", "xml-security")
    return (*exchange.classes, "http", "rest-formats", "strict-input")
