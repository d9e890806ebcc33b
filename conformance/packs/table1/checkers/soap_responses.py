"""Judge every successful SOAP response of a run by the XSD, whichever check asked for it.

A response that is invalid now and then is found only if all are looked at.
"""

from collections.abc import Iterable, Iterator
from http import HTTPStatus
from typing import Final

from conformance.api.soap.service import SoapService
from conformance.documents.xml import NotXmlError, elements, parse
from conformance.documents.xml_names import clark, local
from conformance.packs.table1.robot.delivery_messages import NAMESPACE
from conformance.transport.exchange import Attempt, Exchange
from conformance.verdict.case import Case, case

_IDS: Final = {"publishers": "soap-delivery/response-valid", "subscribers": "soap-subscribers/response-valid"}
# A longer path of a plan is judged where it is asked for.
_LARGE: Final = 100_000
_SUFFIX: Final = "Response"


class SoapResponses:
    """Judges the SOAP responses of one run.

    Args:
        services: the robot's SOAP services.
    """

    def __init__(self, services: Iterable[SoapService]) -> None:
        self._services = {service.endpoint: service for service in services}

    def __call__(self, attempt: Attempt) -> Iterator[Case]:
        """Judge one exchange, if it is a successful call of one of the services."""
        service = self._services.get(attempt.request.url)
        if service is None or attempt.request.method != "POST" or not isinstance(attempt, Exchange):
            return
        exchange, response = attempt, attempt.response
        # With 202 a service says that it sends its response elsewhere, as WS-Addressing allows.
        if response.ok and response.status != HTTPStatus.ACCEPTED and not response.body:
            yield case(_IDS[service.name], False, exchange, "a SOAP response", found="nothing")  # noqa: FBT003
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
        # What the robot says of itself is fetched by the checks, and not while an exchange is judged.
        own = vars(service).get("described", service.contract)
        described = own if own.shape(wanted) is not None else service.contract
        if str(inside[0].tag) != wanted or described.shape(wanted) is None:
            return
        reason = described.types.invalid(inside[0])
        expected = f"{name} as the description says it is"
        yield case(_IDS[service.name], not reason, exchange, expected, found=reason)
