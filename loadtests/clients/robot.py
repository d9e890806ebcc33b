"""The robot under load: addresses, credentials, deadline; and a described device's operations as bytes."""

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Self

from conformance.commandline.secrecy import SECRETS
from conformance.papers_robot.statement import Ros
from conformance.transport.connections import ClientCertificate
from conformance.transport.credentials import Credential, Credentials, Kind, UsernameToken
from conformance.transport.reach import Trust
from loadtests.clients.endpoint import Endpoint, tls_context
from loadtests.clients.failures import Declared, Reply
from loadtests.clients.payloads import BUILDERS, CATALOGUE, VARIANTS, Values, variants
from loadtests.clients.rosbridge import Bridge, bridge_requests
from loadtests.clients.wire import Connection, Request

VARIABLE = b"$ROAAS_"


@dataclass(frozen=True)
class Described:
    """One operation to measure.

    Attributes:
        name: what the result calls it: method and path, an operation of a WSDL, or a pair's name.
        method: HTTP method.
        base_url: where it is.
        octets: one request for each set of values; shell variables stand where credentials go (`Credentials`). None
            where a scenario makes the requests.
        responses: status and media types of each good response over REST.
        interface: `rest` or `soap`.
        reply: local name of the element in the Body of a good response over SOAP; empty if there is none.
        refused: why a scenario may not call it; empty where it may.
    """

    name: str
    method: str
    base_url: str
    octets: tuple[bytes, ...]
    responses: tuple[tuple[int, tuple[str, ...]], ...] = ()
    interface: str = "rest"
    reply: str = ""
    refused: str = ""

    def requests(self, credentials: Credentials, number: int) -> list[Request]:
        """Return `number` requests, the sets of values in rotation.

        Args:
            credentials: credentials that are the same in each request; answers to challenges are added when it is sent.
            number: how many.
        """
        good = Declared(self.responses) if self.interface == "rest" else Reply(self.reply)
        made = [Request(credentials.reveal(each), good) for each in self.octets]
        return [made[place % len(made)] for place in range(number)]


@dataclass(frozen=True)
class Stream:
    """A stream to listen to.

    Attributes:
        name: method and path of the operation, or the WebSocket's URL.
        kind: `sse`, `websocket` or `rosbridge`.
        url: where it is; that of a rosbridge has the topic as its fragment.
        octets: the request, with shell variables for credentials; empty for a WebSocket.
    """

    name: str
    kind: str
    url: str
    octets: bytes = b""


@dataclass(frozen=True)
class Secrets:
    """Credentials of a robot's requests: the bearer token, others, and WS-Security's user.

    Attributes:
        trust: the servers to which they may go; None means to those of the robot.
    """

    token: str | None = None
    credentials: tuple[Credential, ...] = ()
    username_token: UsernameToken | None = None
    trust: Trust | None = None

    def refusal(self, robot: "Robot") -> str:
        """Return why they may not go to a robot that a master names, or an empty text."""
        if self.trust is None or not (self.token or self.credentials or self.username_token):
            return ""
        named = (*robot.addresses, robot.publishers_wsdl, robot.subscribers_wsdl, robot.rosbridge)
        for address in named:
            # A WSDL may be a file.
            if address and "://" in address and (why := self.trust.refusal(as_http(address))):
                return f"the credentials of this worker do not go to {address}, which its options do not name: {why}"
        return ""

    @classmethod
    def of(cls, robot: "Robot") -> Self:
        """Return the secrets of a robot."""
        return cls(robot.token, robot.credentials, robot.username_token)


@dataclass(frozen=True)
class Robot:
    """The robot's addresses, as URLs; None for services that it does not offer.

    Attributes:
        publishers, subscribers: the SOAP services' addresses.
        publishers_wsdl, subscribers_wsdl: URL or file of their WSDLs, for zeep.
        token: bearer token.
        rosbridge: the address of a rosbridge to the robot's ROS graph (ws or wss).
        delivery_topic: where deliveries are published on that graph.
        described: the operations to measure, of a device that is called by its own description.
        credentials: what the requests of these operations carry.
        certificate: client certificate for TLS, as names of files.
        username_token: the user whose token each message of a described SOAP operation carries.
        trust_hosts: further servers to which a WSDL may lead.
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
    described: tuple[Described, ...] = ()
    credentials: tuple[Credential, ...] = ()
    certificate: ClientCertificate | None = None
    username_token: UsernameToken | None = None
    trust_hosts: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        SECRETS.keep(self.token or "", "$ROAAS_TOKEN")

    @property
    def soap(self) -> str | None:
        """Return the address of the SOAP services of a device that is called by its own WSDL, or None."""
        return next((each.base_url for each in self.described if each.interface == "soap"), None)

    @property
    def addresses_by_name(self) -> dict[str, str | None]:
        """Return the addresses of its web services by name, as results show them."""
        papers = {"rest": self.rest, "publishers": self.publishers, "subscribers": self.subscribers}
        return papers | ({"soap": self.soap} if self.soap else {})

    @property
    def addresses(self) -> list[str]:
        """Return the addresses of its web services."""
        return [each for each in self.addresses_by_name.values() if each]

    @cached_property
    def tls(self) -> Any:
        """Return the TLS context, or None if no address needs one."""
        if not any(address.startswith(("https:", "wss:")) for address in (*self.addresses, self.rosbridge or "")):
            return None
        return self.context()

    def context(self) -> Any:
        """Return a new TLS context for this robot."""
        context = tls_context(Path(self.ca_file) if self.ca_file else None)
        if self.certificate is not None:
            self.certificate.load_into(context)
        return context

    @cached_property
    def digest(self) -> Credentials | None:
        """Return the user for the robot's digest challenges, shared by all connections; None without digest."""
        found = tuple(item for item in self.credentials if item.kind is Kind.DIGEST)
        return Credentials(found) if found else None

    @cached_property
    def fixed(self) -> Credentials:
        """Return the credentials that are the same in each request."""
        return Credentials(tuple(item for item in self.credentials if item.kind is not Kind.DIGEST))

    def _find_described(self, interface: str, operation: str) -> Described | None:
        return next((each for each in self.described if (each.interface, each.name) == (interface, operation)), None)

    def method(self, operation: str) -> str:
        """Return an operation's HTTP method over REST; POST if it is only offered over SOAP."""
        if self.described:
            found = self._find_described("rest", operation)
            return found.method if found else "POST"
        return CATALOGUE[operation].method

    def values(self, operation: str, seed: int) -> list[Values]:
        """Return the values of each variant, for the library clients; empty for a described operation."""
        return [] if self.described else variants(operation, seed)

    def address(self, interface: str, operation: str) -> str | None:
        """Return the address of an operation over an interface; None if the interface lacks the operation."""
        if self.described:
            found = self._find_described(interface, operation)
            return found.base_url if found else None
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
        if interface == "rosbridge" or self.described:
            return client == "wire"
        return interface == "rest" or client == "wire" or self.wsdl(operation) is not None

    def http(self, interface: str, operation: str) -> Connection:
        """Return a new connection for an operation over REST or SOAP; it opens at the first call."""
        endpoint = Endpoint.parse(self.address(interface, operation) or "")
        return Connection(endpoint, self.timeout_s, self.tls, self.digest, self.username_token)

    def bridge(self) -> Bridge:
        """Return a new connection to the rosbridge; it opens at the first call."""
        return Bridge(self.rosbridge or "", self.timeout_s, self.tls, self.token, self.delivery_topic)

    def requests(self, interface: str, operation: str, seed: int) -> list[Request]:
        """Return the variants of an operation as bytes; empty where the robot does not offer it."""
        address = self.address(interface, operation)
        if address is None:
            return []
        described = self._find_described(interface, operation)
        if described is not None:
            return described.requests(self.fixed, VARIANTS)
        if interface == "rosbridge":  # values of its own: one interface must not take another's delivery for its echo
            return [*bridge_requests(variants(operation, seed + 1), self.delivery_topic)]
        endpoint = Endpoint.parse(address)
        return [BUILDERS[interface](endpoint, operation, values, self.token) for values in variants(operation, seed)]


def as_http(address: str) -> str:
    """Return the address of a WebSocket as that of the HTTP server that opens it (RFC 6455 4.1); others as they are."""
    return f"http{address[2:]}" if address[:2].lower() == "ws" else address


def without_secrets(robot: Robot) -> Robot:
    """Return a robot as workers get it: without secrets, because each worker has its own."""
    user = robot.username_token and replace(robot.username_token, password="")
    return replace(robot, token=None, credentials=(), username_token=user)


def with_secrets(robot: Robot, secrets: Secrets | None) -> Robot:
    """Return a robot that came without its secrets with those of this machine.

    Raises:
        ValueError: its requests need a credential that this machine does not have, or that must not go to it.
    """
    if secrets is not None and (why := secrets.refusal(robot)):
        raise ValueError(why)
    found = replace(robot, token=secrets.token, credentials=secrets.credentials) if secrets else robot
    user = found.username_token
    if user is not None and secrets is not None and secrets.username_token is not None:
        user = replace(user, password=secrets.username_token.password)  # the device's clock is known from the master
        found = replace(found, username_token=user)
    revealed = Credentials(found.credentials).reveal
    lacks_user = user is not None and not user.password
    if lacks_user or any(VARIABLE in revealed(octets) for each in found.described for octets in each.octets):
        raise ValueError("the requests need credentials that this worker lacks: start it with the master's options")
    return found
