"""Invalid deliveries, and valid paths with other methods: crawlers and link previews send GET."""

from dataclasses import dataclass
from typing import Final

from conformance.api.rest.interface import RestInterface
from conformance.api.soap.callable_services import SoapServices
from conformance.api.soap.calls import call
from conformance.api.soap.service import SoapService
from conformance.packs.table1.robot.deliveries_seen import DeliveryObserver, NoObserverError, observer_of
from conformance.packs.table1.robot.delivery import Delivery, path_of, put_delivery
from conformance.packs.table1.robot.delivery_messages import request
from conformance.packs.table1.robot.probe.client import ProbeError, RosProbe
from conformance.packs.table1.robot.soap_services import send_delivery
from conformance.scenarios.scenario import scenario
from conformance.scenarios.stage import Leaves, Need, Stage
from conformance.transport.exchange import Exchange

CORRECT: Final = ("3", "1.5", "2.5", "3.5", "4.5", "5.5", "6.5")
_OTHER_METHODS: Final = ("GET", "HEAD", "OPTIONS", "POST", "DELETE", "PATCH")
_BAD_PARTS: Final = (
    *((0, text) for text in ("0", "5", "abc", "", "3.5", "2147483648")),
    *((place, text) for place in (1, 4, 6) for text in ("abc", "", "NaN", "Infinity", "-Infinity", "1e400")),
)
_NO_FORMAT: Final = Delivery(3, 21.0, 22.0, 23.0, 24.0, 25.0, 26.0)
_LAST: Final = Delivery(3, 11.0, 12.0, 13.0, 14.0, 15.0, 16.0)


@dataclass(frozen=True)
class ByMethod:
    """A valid delivery's path, requested with another method than PUT."""

    method: str
    delivery: Delivery
    exchange: Exchange


@dataclass(frozen=True)
class InvalidDeliveries:
    """All requests, and the deliveries that arrived.

    Attributes:
        invalid: exchanges of invalid deliveries, over REST and SOAP.
        by_method: valid paths with other methods.
        no_format: the valid delivery whose Accept header excludes all formats.
        answer: its exchange, or None if no observer shows arrivals.
        last: the valid delivery at the end, which must arrive.
        seen: the deliveries that arrived; None: no observer shows them.
        unseen: why no observer shows them, or empty.
    """

    invalid: tuple[Exchange, ...]
    by_method: tuple[ByMethod, ...]
    no_format: Delivery = _NO_FORMAT
    answer: Exchange | None = None
    last: Delivery = _LAST
    seen: tuple[Delivery, ...] | None = None
    unseen: str = ""


@scenario(needs={Need.REST, Need.MOTION}, leaves=Leaves.UNTOUCHED, stage=Stage.EFFECT)
def invalid_deliveries(api: RestInterface, soap: SoapServices, probe: RosProbe) -> InvalidDeliveries:
    """Send invalid deliveries, valid paths with other methods, and at last two valid deliveries."""
    rest = api.client
    observer: DeliveryObserver | None = None
    unseen = ""
    try:
        observer = observer_of(api, probe)
        observer.mark()
    except (NoObserverError, ProbeError) as error:
        observer, unseen = None, str(error)
    invalid = []
    for place, text in api.run.effort.subsample(_BAD_PARTS, 8):
        values = [*CORRECT[:place], text, *CORRECT[place + 1 :]]
        invalid.append(rest.send("PUT", path_of(*values), fresh=True))
    by_method = []
    for number, method in enumerate(api.run.effort.subsample(_OTHER_METHODS, 3)):
        delivery = Delivery(3, *(30.0 + 10 * number + place for place in range(6)))
        by_method.append(ByMethod(method, delivery, rest.send(method, delivery.rest_path, fresh=True)))
    if soap.publishers is not None:
        invalid += _invalid_soap(soap.publishers)
    trace = InvalidDeliveries(tuple(invalid), tuple(by_method), unseen=unseen)
    if observer is None:
        return trace
    answer = rest.send("PUT", _NO_FORMAT.rest_path, headers=(("Accept", "image/png"),), fresh=True)
    put_delivery(api, _LAST.rest_path, fresh=True)
    try:
        seen = tuple(one.delivery for one in observer.collect(1 + answer.response.ok))
    except (NoObserverError, ProbeError) as error:
        return InvalidDeliveries(tuple(invalid), tuple(by_method), unseen=str(error))
    return InvalidDeliveries(tuple(invalid), tuple(by_method), answer=answer, seen=seen)


def _invalid_soap(publishers: SoapService) -> list[Exchange]:
    """Send messages with a bad code, a non-finite value, a missing and a doubled element; return the exchanges."""
    values = dict(zip(Delivery._fields, CORRECT, strict=True))
    changes: list[dict[str, str | None]] = [
        {"message_code": "5"},
        {"message_code": "abc"},
        {"depot_x": "INF"},
        {"source_y": "NaN"},
        {"destination_x": None},
        {"source_y": "x"},
    ]
    exchanges = [send_delivery(publishers, Delivery(0, 1.5, 2.5, 3.5, 4.5, 5.5, 6.5))]
    for change in changes:
        given = {**values, **change}
        message = request("ExecuteDeliveryRequest", **{name: text for name, text in given.items() if text is not None})
        exchanges.append(call(publishers, message, fresh=True).exchange)
    return exchanges
