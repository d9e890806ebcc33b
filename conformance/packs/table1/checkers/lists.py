"""Judge every list of a run, whichever check requests it; one over SOAP also by the lists over REST around it."""

import itertools
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Final

from conformance.documents.json_shape import Shape
from conformance.documents.representation import from_element
from conformance.packs.table1.robot.message_shapes import MESSAGE_TYPE, SERVICE_TYPE, read_as
from conformance.packs.table1.robot.message_shapes import SENSORS as SENSORS_SHAPE
from conformance.packs.table1.robot.message_shapes import SERVICES as SERVICES_SHAPE
from conformance.packs.table1.robot.robot import SENSORS, SERVICES
from conformance.packs.table1.robot.soap_services import returns
from conformance.packs.table1.robot.state_read import entries_of
from conformance.transport.exchange import Attempt, Exchange
from conformance.verdict.evidence import Case, case

#: By member of the SOAP response: path, shape of the list, shape of a named type, and requirement.
_LISTS: Final[Mapping[bytes, tuple[str, Shape, Shape, str]]] = {
    b"GetSensorsResponse": (SENSORS, SENSORS_SHAPE, MESSAGE_TYPE, "equivalence/sensors"),
    b"GetNavigationServicesResponse": (SERVICES, SERVICES_SHAPE, SERVICE_TYPE, "equivalence/services"),
}
# Lists over SOAP that wait for the next one over REST.
_MOST: Final = 20


@dataclass
class _Seen:
    """The readings of one list so far.

    Attributes:
        path, shape, full, requirement: as above.
        listed: the entries over REST, as read last; None: not read yet.
        received_s: when they were received, s of the monotonic clock.
        others: entries over SOAP since then, the newest.
    """

    path: str
    shape: Shape
    full: Shape
    requirement: str
    listed: list[str] | None = None
    received_s: float = 0.0
    others: list[tuple[list[str], Exchange]] = field(default_factory=list)

    @property
    def names(self) -> tuple[str, ...]:
        """Return the names of an entry's fields."""
        return tuple(self.shape.schema["items"]["properties"])


class Lists:
    """Judges the lists in all exchanges of one run.

    One over SOAP that differs counts where REST shows the same entries before and after it: a robot's graph may change.

    Args:
        url: returns the URL of a path.
    """

    def __init__(self, url: Callable[[str], str]) -> None:
        self._seen = {name: _Seen(*what) for name, what in _LISTS.items()}
        self._by_url = {url(seen.path): seen for seen in self._seen.values()}

    def __call__(self, attempt: Attempt) -> Iterator[Case]:
        """Process one exchange of the run, if it contains a list."""
        if not isinstance(attempt, Exchange):
            return
        request, response = attempt.request, attempt.response
        if request.method == "GET" and request.url in self._by_url and response.media_type == "application/json":
            yield from self._over_rest(self._by_url[request.url], attempt)
        elif request.method == "POST" and response.ok:
            for name, seen in self._seen.items():
                if name in response.body:
                    self._over_soap(seen, attempt)

    def _over_rest(self, seen: _Seen, exchange: Exchange) -> Iterator[Case]:
        value, problem = read_as(exchange.response, seen.shape)
        if problem:
            return
        yield from self._judge_entries(seen, value, exchange)
        listed, (others, seen.others) = entries_of(value, seen.names), (seen.others, [])
        for entries, other in others if listed == seen.listed else ():
            if _sent_s(exchange) < other.response.received_s:
                continue
            odd = sorted(set(entries) ^ set(listed)) or ["an entry twice"]
            yield case(
                seen.requirement,
                holds=entries == listed,
                exchange=other,
                expected=f"the entries of GET {seen.path} before and after it",
                found=f"{len(entries)} entries for {len(listed)}; in one only: {', '.join(odd[:3])}",
                cause="other entries",
            )
        seen.listed, seen.received_s = listed, exchange.response.received_s

    def _judge_entries(self, seen: _Seen, entries: list[Any], exchange: Exchange) -> Iterator[Case]:
        """Judge that no entry of a list is there twice, and that each type is named in full."""
        listed, what = entries_of(entries, seen.names), seen.requirement.rpartition("/")[2]
        twice = next((one for one, two in itertools.pairwise(listed) if one == two), "")
        yield case(
            f"rest-resources/{what}-unique",
            not twice,
            exchange,
            "no entry twice",
            found=f"twice {twice}",
            cause="twice",
        )
        short = next((entry["type"] for entry in entries if seen.full.problem(entry["type"])), "")
        yield case(
            f"rest-resources/{what}-named-in-full",
            not short,
            exchange,
            f"a type named in full, as {'sensor_msgs/msg/LaserScan' if what == 'sensors' else 'nav_msgs/srv/GetPlan'}",
            found=f"type {short!r}",
            cause="not in full",
        )

    def _over_soap(self, seen: _Seen, exchange: Exchange) -> None:
        found, problem = returns(exchange)
        if problem or seen.listed is None or _sent_s(exchange) < seen.received_s:
            return
        schema = seen.shape.schema["items"]
        entries = entries_of([from_element(element, schema) for element in found], seen.names)
        seen.others = [*seen.others[1 - _MOST :], (entries, exchange)]


def _sent_s(exchange: Exchange) -> float:
    return exchange.response.received_s - exchange.response.elapsed_ms / 1000
