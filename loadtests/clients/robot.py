"""The robot under load: addresses, credentials, deadline."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from conformance.packs.table1.statement import Ros
from loadtests.clients.endpoint import Endpoint, tls_context
from loadtests.clients.payloads import BUILDERS, CATALOGUE, variants
from loadtests.clients.rosbridge import Bridge, bridge_requests
from loadtests.clients.wire import Connection, Request


@dataclass(frozen=True)
class Robot:
    """The robot's addresses, as URLs; None for services that it does not offer.

    Attributes:
        publishers, subscribers: the SOAP services' addresses.
        publishers_wsdl, subscribers_wsdl: URL or file of their WSDLs, for zeep.
        token: bearer token.
        rosbridge: the address of a rosbridge to the robot's ROS graph (ws or wss).
        delivery_topic: where deliveries are published on that graph.
    """

    rest: str | None
    publishers: str | None
    subscribers: str | None
    publishers_wsdl: str | None = None
    subscribers_wsdl: str | None = None
    ca_file: str | None = None
    token: str | None = None
    timeout_s: float = 10.0
    rosbridge: str | None = None
    delivery_topic: str = Ros().delivery_topic

    @cached_property
    def tls(self) -> Any:
        """Return the TLS context, or None if no address needs one."""
        addresses = (self.rest, self.publishers, self.subscribers, self.rosbridge)
        if not any(address and address.startswith(("https:", "wss:")) for address in addresses):
            return None
        return tls_context(Path(self.ca_file) if self.ca_file else None)

    def address(self, interface: str, operation: str) -> str | None:
        """Return the address of an operation over an interface; None if the interface lacks the operation."""
        if interface == "rest":
            return self.rest
        if interface == "rosbridge":
            return self.rosbridge
        return self.publishers if CATALOGUE[operation].service == "publishers" else self.subscribers

    def wsdl(self, operation: str) -> str | None:
        """Return the WSDL of the SOAP service that has an operation."""
        return self.publishers_wsdl if CATALOGUE[operation].service == "publishers" else self.subscribers_wsdl

    def offers(self, interface: str, client: str, operation: str) -> bool:
        """Return whether a client can call an operation over an interface; zeep needs the WSDL as well."""
        if self.address(interface, operation) is None:
            return False
        if interface == "rosbridge":
            return client == "wire"
        return interface == "rest" or client == "wire" or self.wsdl(operation) is not None

    def http(self, interface: str, operation: str) -> Connection:
        """Return a new connection for an operation over REST or SOAP; it opens at the first call."""
        return Connection(Endpoint.parse(self.address(interface, operation) or ""), self.timeout_s, self.tls)

    def bridge(self) -> Bridge:
        """Return a new connection to the rosbridge; it opens at the first call."""
        return Bridge(self.rosbridge or "", self.timeout_s, self.tls, self.token, self.delivery_topic)

    def requests(self, interface: str, operation: str, seed: int) -> list[Request]:
        """Return the variants of an operation as bytes; empty where the robot does not offer it."""
        address = self.address(interface, operation)
        if address is None:
            return []
        if interface == "rosbridge":  # its own values: it must not take another interface's delivery for its echo
            return [*bridge_requests(variants(operation, seed + 1), self.delivery_topic)]
        endpoint = Endpoint.parse(address)
        return [BUILDERS[interface](endpoint, operation, values, self.token) for values in variants(operation, seed)]
