"""An operation of a device with a description: its requests as bytes, built before the measurement."""

from dataclasses import dataclass

from conformance.transport.credentials import Credentials
from loadtests.clients.failures import Declared, Reply
from loadtests.clients.wire import Request

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
            credentials: those that are the same in each request; answers to challenges are added when it is sent.
            number: how many.
        """
        good = Declared(self.responses) if self.interface == "rest" else Reply(self.reply)
        made = [Request(credentials.revealed(each), good) for each in self.octets]
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
