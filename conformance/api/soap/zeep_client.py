"""zeep as the client that a user would write, over the suite's own HTTP: with its deadlines, token and authorities.

zeep is no judge of messages (it takes a wrong response wrapper for None), but a robot that it cannot call is of no use
to those who use it.
"""

from dataclasses import dataclass
from typing import Any

from requests.structures import CaseInsensitiveDict
from zeep import Client, Settings
from zeep.exceptions import Fault as ZeepFault
from zeep.transports import Transport

from conformance.api.soap.service import SoapService
from conformance.transport.exchange import Exchange, NoAnswerError

_OK = 200


@dataclass(frozen=True)
class _Reply:
    """The parts of a response that zeep reads."""

    status_code: int
    headers: CaseInsensitiveDict[str]
    content: bytes
    encoding: str = "utf-8"


class _Transport(Transport):
    """Sends zeep's messages through the service's client, and keeps the last exchange as evidence."""

    def __init__(self, service: SoapService) -> None:
        super().__init__()  # type: ignore[no-untyped-call] # zeep is typed in part
        self._service = service
        self.last: Exchange | None = None

    def load(self, url: str) -> bytes:
        """Return a document of the description."""
        published = self._service.published
        if published.document is not None and url == published.source:
            return published.document
        return self._service.fetch(url)

    def post(self, _address: str, message: bytes, headers: dict[str, str]) -> _Reply:
        """Send a message to the service's address, whatever address its description has."""
        given = CaseInsensitiveDict(headers)
        exchange = self._service.post(
            message,
            soap_action=given.get("SOAPAction", '""'),
            content_type=given.get("Content-Type", "text/xml; charset=utf-8"),
        )
        self.last = exchange
        answer = exchange.response
        # zeep accepts status 200 only, but the profile allows any 2xx (R1124).
        status = _OK if answer.ok and answer.body else answer.status
        return _Reply(status, CaseInsensitiveDict(answer.headers), answer.body)


class ZeepCaller:
    """A zeep client of one service, made from the robot's description or, if that fails, the contract's.

    Raises:
        Exception: zeep cannot make a client from the description; of any kind, with zeep's message.
    """

    def __init__(self, service: SoapService) -> None:
        self._transport = _Transport(service)
        own = service.published.source if service.published.document is not None else None
        self.source = own or str(service.contract_wsdl_path)
        client = Client(self.source, transport=self._transport, settings=Settings(strict=True))
        described = service.own if own and service.own is not None else service.contract
        bindings = {str(key).rpartition("}")[2]: key for key in client.wsdl.bindings}
        self._proxy = client.create_service(bindings[described.bound[0].binding], service.endpoint)

    def call(self, operation: str, *arguments: Any, **named: Any) -> tuple[Any, str, Exchange | None]:
        """Call an operation.

        Returns:
            What zeep returns, what went wrong (empty when nothing did; a fault begins with "fault"), and the evidence.

        Raises:
            NoAnswerError: no HTTP response came.
        """
        self._transport.last = None
        try:
            result = self._proxy[operation](*arguments, **named)
        except NoAnswerError:
            raise
        except ZeepFault as fault:
            return None, f"fault {fault.code or ''}: {fault.message}", self._transport.last
        except Exception as error:  # noqa: BLE001 - whatever zeep makes of an answer is what its user gets
            return None, f"{type(error).__name__}: {error}"[:300], self._transport.last
        return result, "", self._transport.last
