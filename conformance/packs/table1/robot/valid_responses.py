"""Judge every successful SOAP response of a run by the XSD, whichever check asked for it.

A response that is invalid now and then is found only if all are looked at.
"""

from collections.abc import Iterable
from http import HTTPStatus
from typing import Final

from conformance.api.soap.service import SoapService
from conformance.documents.xml import NotXmlError, elements, parse
from conformance.documents.xml_names import clark, local
from conformance.packs.table1.robot.delivery_messages import NAMESPACE
from conformance.transport.exchange import Exchange, Listener
from conformance.verdict.evidence import Judge

_IDS: Final = {"publishers": "soap-delivery/response-valid", "subscribers": "soap-subscribers/response-valid"}
# A longer path of a plan is judged where it is asked for.
_LARGE: Final = 100_000
_SUFFIX: Final = "Response"


class ValidResponses(Listener):
    """Listens to all exchanges of one run.

    Args:
        judge: takes the evidence.
        services: the robot's SOAP services.
    """

    def __init__(self, judge: Judge, services: Iterable[SoapService]) -> None:
        self._judge = judge
        self._services = {service.endpoint: service for service in services}

    def answered(self, exchange: Exchange) -> None:
        """Judge one exchange, if it is a successful call of one of the services."""
        service, response = self._services.get(exchange.request.url), exchange.response
        # What the robot says of itself is fetched by the checks, and not while an exchange is judged.
        if service is None or "described" not in vars(service) or exchange.request.method != "POST":
            return
        # With 202 a service says that it sends its response elsewhere, as WS-Addressing allows.
        if response.ok and response.status != HTTPStatus.ACCEPTED and not response.body:
            self._judge.check(_IDS[service.name], False, exchange, "a SOAP response", found="nothing")  # noqa: FBT003
        if not response.ok or response.media_type != "text/xml" or len(response.body) > _LARGE:
            return
        try:
            root = parse(response.body)
        except NotXmlError:
            return  # judged as what it is
        inside = [child for part in elements(root) if local(str(part.tag)) == "Body" for child in elements(part)]
        if len(inside) != 1 or not str(inside[0].tag).endswith(_SUFFIX):
            return
        name = local(str(inside[0].tag))
        wanted = clark(NAMESPACE, name)
        described = service.described if service.described.shape(wanted) is not None else service.contract
        if str(inside[0].tag) != wanted or described.shape(wanted) is None:
            return
        reason = described.types.invalid(inside[0])
        expected = f"{name} as the description says it is"
        self._judge.check(_IDS[service.name], not reason, exchange, expected, found=reason)
