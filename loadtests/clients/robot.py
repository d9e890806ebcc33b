"""The robot under load, as far as the generator knows it: addresses, credentials, deadline."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from loadtests.clients.endpoint import Endpoint, tls_context
from loadtests.clients.payloads import BUILDERS, CATALOGUE, variants

if TYPE_CHECKING:
    from loadtests.clients.wire import Request


@dataclass(frozen=True)
class Robot:
    """Addresses are URLs; None where the robot offers no such service.

    Attributes:
        publishers, subscribers: the SOAP services' addresses.
        publishers_wsdl, subscribers_wsdl: URL or file of their descriptions, for the zeep client.
        token: bearer token.
    """

    rest: str | None
    publishers: str | None
    subscribers: str | None
    publishers_wsdl: str | None = None
    subscribers_wsdl: str | None = None
    ca_file: str | None = None
    token: str | None = None
    timeout_s: float = 10.0

    @cached_property
    def tls(self) -> Any:
        """The TLS context, where an address needs one."""
        addresses = (self.rest, self.publishers, self.subscribers)
        if not any(address and address.startswith("https") for address in addresses):
            return None
        return tls_context(Path(self.ca_file) if self.ca_file else None)

    def address(self, interface: str, operation: str) -> str | None:
        """Where an operation is called over an interface; None where it cannot be."""
        if interface == "rest":
            return self.rest
        return self.publishers if CATALOGUE[operation].service == "publishers" else self.subscribers

    def wsdl(self, operation: str) -> str | None:
        """The description of the SOAP service that has an operation."""
        return self.publishers_wsdl if CATALOGUE[operation].service == "publishers" else self.subscribers_wsdl

    def offers(self, interface: str, client: str, operation: str) -> bool:
        """Whether a client can call an operation over an interface: zeep needs the WSDL beside the address."""
        if self.address(interface, operation) is None:
            return False
        return interface == "rest" or client == "wire" or self.wsdl(operation) is not None

    def requests(self, interface: str, operation: str, seed: int) -> list[Request]:
        """The operation's variants as octets; empty where it is not offered."""
        address = self.address(interface, operation)
        if address is None:
            return []
        endpoint = Endpoint.parse(address)
        return [BUILDERS[interface](endpoint, operation, values, self.token) for values in variants(operation, seed)]
