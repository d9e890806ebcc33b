"""Judge the robot's list of deliveries, where it has one, by every delivery of a run that it has accepted.

A fault in one delivery of many, such as the first one or the one after an error, is found only if all are looked at,
whichever check has sent them.
"""

import json
import math
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Final
from urllib.parse import unquote

from conformance.documents.openapi import is_json
from conformance.documents.representation import UnreadableError, flattened, read
from conformance.documents.xml import NotXmlError, clark, elements, local, parse, text_of
from conformance.packs.table1.robot.delivery import Delivery
from conformance.packs.table1.robot.message_shapes import DELIVERIES as LIST
from conformance.packs.table1.robot.probe import ARRIVES_S
from conformance.packs.table1.robot.robot import DELIVERIES
from conformance.packs.table1.robot.soap_services import NAMESPACE
from conformance.papers_robot.delivery import COFFEE, COORDINATES, MESSAGE_FIELDS, PATH_NAMES
from conformance.transport.exchange import Attempt, Exchange, Request
from conformance.verdict.evidence import Case, case

_MANY: Final = 10  # accepted deliveries that may wait until the list is read
_WAITS_S: Final = 1.0  # longest wait of the oldest, s
# Fewest deliveries that the list has to hold.
_HELD: Final = 50
# Earlier lists that are remembered, because several clients may read the list at once.
_LISTS: Final = 8
_LARGE: Final = 100_000  # longer messages are not read, bytes
# SOAP operations that deliver.
_OPERATIONS: Final = {clark(NAMESPACE, f"Execute{name}Request"): name == "Coffee" for name in ("Coffee", "Delivery")}


@dataclass(frozen=True)
class _Accepted:
    """A delivery that the robot has accepted."""

    delivery: Delivery
    interface: str
    exchange: Exchange

    @property
    def entry(self) -> tuple[Delivery, str]:
        """Return the facts in an entry of the list."""
        return self.delivery, self.interface

    def age_s(self, now_s: float) -> float:
        """Return for how long it has been accepted, s."""
        return now_s - self.exchange.response.received_s


class Deliveries:
    """Keeps the accepted deliveries of one run, and looks for them in each list that is read.

    Args:
        url: returns the URL of a path.
        has_probe: whether the robot's own topic is watched, which alone shows what was published.

    Attributes:
        has_list: whether the robot has a list, as far as it was read.
    """

    def __init__(self, url: Callable[[str], str], *, has_probe: bool) -> None:
        self._url, self._has_probe = url(DELIVERIES), has_probe
        self._waiting: list[_Accepted] = []
        # Entries of the last list, with how often each occurs; None: no list was read yet.
        self._before: Counter[str] | None = None
        # New entries without an accepted delivery: its response may still arrive.
        self._new: Counter[tuple[Delivery, str]] = Counter()
        self.has_list = True
        # Earlier lists with their times, s: a later list must contain their entries.
        self._lists: list[tuple[float, Sequence[str]]] = []

    def __call__(self, attempt: Attempt) -> Iterator[Case]:
        """Judge one exchange of the run: a delivery, or a read of the list."""
        if not isinstance(attempt, Exchange):
            return
        exchange, request = attempt, attempt.request
        if request.method == "GET" and request.url == self._url:
            yield from self._look(exchange)
            return
        if not exchange.response.ok or not self.has_list:
            return
        values = self._of_path(request) or _of_message(request)
        if values is not None:
            self._waiting.append(_Accepted(values, "rest" if request.method == "PUT" else "soap", exchange))

    def awaits(self, now_s: float) -> bool:
        """Return whether the list should be read, because many deliveries wait for it, or one waits long."""
        if not self.has_list:
            return False
        if self._before is None or len(self._waiting) >= _MANY:
            return True
        return self.is_waiting and self._waiting[0].age_s(now_s) > _WAITS_S

    @property
    def is_waiting(self) -> bool:
        """Whether a delivery waits to be looked for in a list."""
        return self.has_list and bool(self._waiting)

    def _of_path(self, request: Request) -> Delivery | None:
        """Return the values of a delivery PUT; None for any other request."""
        if request.method != "PUT" or not request.url.startswith(self._url) or _is_repeatable(request):
            return None
        code, *rest = map(unquote, request.url.removeprefix(self._url).split("/"))
        return _delivery(code, rest[1::2]) if tuple(rest[::2]) == PATH_NAMES else None

    def _look(self, exchange: Exchange) -> Iterator[Case]:
        """Judge a list in any format by the list before; as JSON, also by the deliveries accepted before it."""
        response = exchange.response
        value, shown = _read_list(response.media_type, response.body) if response.ok else (None, ())
        if value is None:
            return
        is_default = is_json(response.media_type)
        yield self._judge_kept(exchange, shown, "rest-delivery/list" if is_default else "rest-formats/same-values")
        if not is_default:
            return
        entries = Counter(shown)
        listed = Counter((Delivery.of(entry["request"]), str(entry["interface"])) for entry in value)
        first = self._before is None and not self._waiting
        before = entries if first else self._before or Counter()
        for entry in (entries - before).elements():
            request, _, interface = json.loads(entry)
            self._new[Delivery.of(request), interface] += 1
        # Equal deliveries accepted within one tick of the robot's clock cannot be told apart.
        there = self._new if max(entries.values(), default=1) == 1 else self._new | listed
        # If older entries are still in the list, newer ones cannot have been pushed out.
        whole = len(value) < _HELD or bool(entries & before)
        asked_s = exchange.response.received_s - exchange.response.elapsed_ms / 1000
        waiting, self._waiting, self._before = self._waiting, [], entries
        found = [self._take(accepted, there) for accepted in waiting]
        for number, one in enumerate(waiting):
            later = zip(waiting[number + 1 :], found[number + 1 :], strict=True)
            overtaken = any(listed for other, listed in later if other.interface == one.interface)
            if found[number]:
                yield from self._judge(one, there=True)
            elif whole and one.age_s(asked_s) < (_WAITS_S if overtaken else ARRIVES_S):
                self._waiting.append(one)
            elif whole:
                yield from self._judge(one, there=False)

    def _judge_kept(self, exchange: Exchange, entries: Sequence[str], requirement: str) -> Case:
        """Judge whether a list still has all earlier entries unchanged; a full list may drop the oldest."""
        received_s = exchange.response.received_s
        asked_s = received_s - exchange.response.elapsed_ms / 1000
        before = next((one for at, one in reversed(self._lists) if at < asked_s), ())
        left = Counter(entries)
        kept: list[bool] = []
        for entry in before:
            kept.append(left[entry] > 0)
            left[entry] -= 1
        if len(entries) >= _HELD:
            # The oldest ones may have been pushed out.
            while kept and not kept[-1]:
                kept.pop()
        wrong = [entry for entry, there in zip(before, kept, strict=False) if not there][:1]
        expected, found = "the entries of the list that was read before", "".join(wrong)
        if not wrong:
            self._lists = [*self._lists[-_LISTS:], (received_s, entries)]
        return case(requirement, not wrong, exchange, expected, found=found and f"none with {found}", cause="changed")

    def _take(self, one: _Accepted, there: Counter[tuple[Delivery, str]]) -> bool:
        """Return whether a free entry matches a delivery, and assign it to that delivery."""
        if there[one.entry] < 1:
            return False
        self._new[one.entry] -= 1
        return True

    def _judge(self, one: _Accepted, *, there: bool) -> Iterator[Case]:
        published = () if self._has_probe else (f"equivalence/delivery-{one.interface}",)
        for id_ in ("rest-delivery/list-values", *published):
            yield case(
                id_,
                there,
                one.exchange,
                f"an entry for the delivery in GET {DELIVERIES}",
                found="" if there else f"no entry by {one.interface} with {one.delivery}",
                cause="" if there else f"missing after {one.interface}",
            )


@lru_cache(maxsize=8)
def _read_list(media_type: str, body: bytes) -> tuple[Any, tuple[str, ...]]:
    """Return a list with numbers as doubles, and its entries as text; None if it is no list, which others judge."""
    try:
        value = read(media_type, body, LIST.schema)
    except UnreadableError:
        return None, ()
    if LIST.problem(value):
        return None, ()
    listed = [{**entry, **{name: flattened(entry[name]) for name in ("request", "accepted")}} for entry in value]
    return listed, tuple(
        json.dumps([entry["request"], entry["accepted"], entry["interface"]], sort_keys=True) for entry in listed
    )


def _is_repeatable(request: Request) -> bool:
    return any(name.lower() == "idempotency-key" for name, _ in request.headers)


def _of_message(request: Request) -> Delivery | None:
    """Return the values of a SOAP delivery in which each occurs once; None for any other request."""
    if request.method != "POST" or b"Execute" not in request.body or len(request.body) > _LARGE:
        return None
    try:
        root = parse(request.body)
    except NotXmlError:
        return None
    wrappers = [child for part in elements(root) if local(str(part.tag)) == "Body" for child in elements(part)]
    if len(wrappers) != 1 or str(wrappers[0].tag) not in _OPERATIONS:
        return None
    arguments = elements(wrappers[0])
    texts = [(local(str(leaf.tag)), text_of(leaf).strip()) for argument in arguments for leaf in elements(argument)]
    coffee, values = _OPERATIONS[str(wrappers[0].tag)], dict(texts)
    if coffee:
        values["message_code"] = str(COFFEE)
    if len(arguments) != 1 or len(dict(texts)) != len(texts) or values.keys() != set(MESSAGE_FIELDS):
        return None
    return _delivery(values["message_code"], [values[name] for name in COORDINATES])


def _delivery(code: str, coordinates: list[str]) -> Delivery | None:
    try:
        delivery = Delivery(int(code), *map(float, coordinates))
    except (TypeError, ValueError):
        return None
    return delivery if all(map(math.isfinite, delivery[1:])) else None
