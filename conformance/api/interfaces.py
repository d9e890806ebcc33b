"""The interfaces of one robot, each of which may be missing."""

from dataclasses import dataclass

from conformance.api.rest.interface import RestInterface
from conformance.api.soap.callable_services import SoapServices


@dataclass(frozen=True)
class Interfaces:
    """The interfaces that have an address.

    Attributes:
        rest: the REST interface, or None.
        soap: the SOAP services, each of which may be None.
    """

    rest: RestInterface | None
    soap: SoapServices
