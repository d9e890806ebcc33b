"""A generated mutant, the modes and times that decide which exchanges it alters, and the changes of single fields."""

import json
import re
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final, Protocol, Self
from urllib.parse import parse_qsl, unquote

from lxml import etree

from proof.mutation.messages import Change, Forward, HangUpError, Request, Response
from proof.mutation.table import Mutant
from proof.selftest.generated.operators import Operator
from proof.selftest.generated.places import Exchange, Place
from proof.selftest.generated.slots import edit_message

RARE: Final = 20  # a rare fault strikes one exchange in this many
# Statuses from this one on are errors.
ERROR: Final = 400
SUCCESS: Final = range(200, 300)
_FROM: Final = 30
_PAUSE_S: Final = 1.0
_SPELL_S: Final = 2.0  # last seconds of each period in which a fault strikes
_OF_S: Final = 10.0  # length of each period, s
_SAFE: Final = frozenset({"GET", "HEAD", "OPTIONS"})
_LONG: Final = 40
_SMALL: Final = 0.1


@dataclass(frozen=True)
class Seen:
    """A fault's knowledge when a request arrives.

    Attributes:
        request: the request.
        number: how many requests for the fault's operation have arrived, this one included.
        pause_s: time since the request before, of any operation, s.
        since_s: time since the first request, s.
        under_way: how many other requests are in progress.
        before: method and status of the exchange that ended last, of any operation; None at first.
    """

    request: Request
    number: int
    pause_s: float
    since_s: float
    under_way: int
    before: tuple[str, int] | None


class When(Protocol):
    """Whether a fault strikes."""

    def __call__(self, seen: Seen) -> bool:
        """Return whether it does."""


def _after(of: Callable[[str, int], bool]) -> When:
    return lambda seen: seen.before is not None and of(*seen.before)


#: When a composed fault strikes, as a phrase and as a condition on an exchange, by the end of its name.
TIMES: Final[Mapping[str, tuple[str, When]]] = {
    "rarely": (f"one time in {RARE}", lambda seen: seen.number % RARE == 0),
    "first": ("the first time", lambda seen: seen.number == 1),
    "late": (f"from the {_FROM}th time on", lambda seen: seen.number >= _FROM),
    "now-and-then": (f"for {_SPELL_S:g} s in every {_OF_S:g} s", lambda seen: seen.since_s % _OF_S > _OF_S - _SPELL_S),
    "after-pause": (f"after a pause of {_PAUSE_S:g} s", lambda seen: seen.pause_s > _PAUSE_S),
    "after-error": ("after an answer with 4xx or 5xx", _after(lambda _, status: status >= ERROR)),
    "after-write": (
        "after another request that was not safe and succeeded",
        _after(lambda method, status: method not in _SAFE and status < ERROR),
    ),
    "together": ("while another request is under way", lambda seen: seen.under_way > 0),
    "new-connection": ("for the first request on a connection", lambda seen: seen.request.nth == 1),
    "kept-connection": ("from the 10th request on a connection on", lambda seen: seen.request.nth >= 10),  # noqa: PLR2004
    "second-client": ("for clients that come while another one is connected", lambda seen: seen.request.beside),
}


def _values(request: Request) -> Iterator[Any]:
    """Yield the numbers and texts that a request carries: in JSON or XML, in its query, and in its path."""
    yield from (value for _, value in parse_qsl(request.query))
    yield from map(unquote, request.path.split("/"))
    if not request.body:
        return
    try:
        if "xml" in request.media_type:
            parser = etree.XMLParser(resolve_entities=False, no_network=True)
            yield from (node.text or "" for node in etree.fromstring(request.body, parser).iter() if not len(node))
        else:
            yield from _leaves(json.loads(request.body))
    except (ValueError, etree.XMLSyntaxError, RecursionError):
        return


def _leaves(value: Any) -> Iterator[Any]:
    if isinstance(value, dict | list):
        for item in value.values() if isinstance(value, dict) else value:
            yield from _leaves(item)
    else:
        yield value


def _number(value: Any) -> float | None:
    if isinstance(value, bool):
        return None
    try:
        return float(value)
    except (TypeError, ValueError):
        return None


def _of_number(holds: Callable[[float], bool]) -> When:
    def strikes(seen: Seen) -> bool:
        numbers = (_number(value) for value in _values(seen.request))
        return any(number is not None and holds(number) for number in numbers)

    return strikes


def _of_text(holds: Callable[[str], bool]) -> When:
    return lambda seen: any(isinstance(value, str) and holds(value) for value in _values(seen.request))


def _wants_xml(seen: Seen) -> bool:
    return "xml" in (seen.request.field("Accept") or "") or "xml" in seen.request.media_type


#: The same for requests with certain numbers.
OF_NUMBERS: Final[Mapping[str, tuple[str, When]]] = {
    "negative": ("where the request has a negative number", _of_number(lambda number: number < 0)),
    "small": (
        f"where the request has a number between 0 and {_SMALL:g}",
        _of_number(lambda number: 0 < abs(number) < _SMALL),
    ),
    "exact": (
        "where the request has a number of more than six digits",
        _of_number(lambda number: number != float(f"{number:.6g}")),
    ),
}
#: The same for requests with certain texts.
OF_TEXTS: Final[Mapping[str, tuple[str, When]]] = {
    "markup": ("where the request has a text with & or <", _of_text(lambda text: bool(re.search("[&<]", text)))),
    "beyond-ascii": (
        "where the request has a text with characters beyond ASCII",
        _of_text(lambda text: not text.isascii()),
    ),
    "long": (f"where the request has a text of more than {_LONG} characters", _of_text(lambda text: len(text) > _LONG)),
}
#: The same for the format that a client sends or requests.
OF_FORMATS: Final[Mapping[str, tuple[str, When]]] = {"xml": ("for clients that send or want XML", _wants_xml)}


def striking(make: Callable[[], Change], exchange: Exchange, when: When) -> Change:
    """Return a change that works where a condition holds, and nowhere else.

    Args:
        make: makes the change for one run.
        exchange: the operation whose requests are counted.
        when: the condition.
    """
    change, lock = make(), threading.Lock()
    state: dict[str, Any] = {"number": 0, "under_way": 0, "before": None, "began": None, "last": None}

    def note_arrival(request: Request, *, concerned: bool) -> Seen:
        now = time.monotonic()
        with lock:
            state["number"] += concerned
            state["under_way"] += 1
            began, last = state["began"] or now, state["last"] or now
            state.update(began=began, last=now)
            return Seen(request, state["number"], now - last, now - began, state["under_way"] - 1, state["before"])

    def strikes(request: Request, forward: Forward) -> Response:
        concerned = exchange.concerns(request)
        seen = note_arrival(request, concerned=concerned)
        response: Response | None = None
        try:
            response = change(request, forward) if concerned and when(seen) else forward(request)
            return response
        finally:
            with lock:
                state["under_way"] -= 1
                if response is not None:
                    state["before"] = (request.method, response.status)

    return strikes


Alter = Callable[[Request, Response], Response | None]
# Words after the description of a change, for each mode.
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

    @classmethod
    def of(
        cls,
        operator: str,
        exchange: Exchange,
        place: str,
        says: str,
        make: Callable[[Tally], Change],
        classes: tuple[str, ...] = (),
    ) -> Self:
        """Return the mutant of a place of an operation; ``classes``: those of the operation if there are none."""
        return cls(f"{operator}:{exchange.name}:{place}", says, operator, exchange, classes or exchange.classes, make)

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


def in_mode(mode_name: str, alter: Alter, *, hangs_up: bool = False) -> Callable[[Tally], Change]:
    """Return a change that alters responses in a mode, or closes the connection in their place.

    ``alter`` returns None for a response that the change leaves as it is.
    """

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
                    if hangs_up:
                        raise HangUpError
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
            if not place.exchange.concerns(request) or response.status not in SUCCESS:
                return None
            altered = response.copy()
            return altered if edit_message(place, altered, edit) else None

        return in_mode(mode, alter)(tally)

    return make


def of_request(operator: Operator, place: Place) -> Callable[[Tally], Change]:
    """Return a change that alters the field in requests, counted where the robot accepts the altered request."""

    def make(tally: Tally) -> Change:
        edit = operator.make(place)

        def alter(request: Request) -> Request | None:
            altered = request.copy()
            return altered if place.exchange.concerns(request) and edit_message(place, altered, edit) else None

        return altering_requests(alter)(tally)

    return make


def altering_requests(alter: Callable[[Request], Request | None]) -> Callable[[Tally], Change]:
    """Return a change that alters requests, counted where the device accepts the altered one.

    ``alter`` returns None for a request that the change leaves as it is.
    """

    def make(tally: Tally) -> Change:
        def change(request: Request, forward: Forward) -> Response:
            altered = alter(request)
            if altered is None:
                return forward(request)
            response = forward(altered)
            if response.status in SUCCESS:
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
