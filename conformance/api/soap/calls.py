"""Call a service, and classify its response: accepted, refused, or neither."""

from dataclasses import dataclass
from typing import Any

from lxml import etree

from conformance.api.expectation import Expectation
from conformance.api.soap.envelope import Envelope, Fault, NotSoapError, envelope, read
from conformance.api.soap.service import SoapService
from conformance.documents.xml import Node
from conformance.transport.exchange import Exchange
from conformance.transport.parallel import until_taken
from conformance.verdict.evidence import Judge

_SHOWN = 200


@dataclass(frozen=True)
class SoapResponse:
    """A service's response, with its SOAP message if it has one.

    Attributes:
        exchange: request and response.
        envelope: the message in the response, or None.
        problem: why there is no message; empty where there is one.
    """

    exchange: Exchange
    envelope: Envelope | None
    problem: str

    @property
    def status(self) -> int:
        """HTTP status."""
        return self.exchange.response.status

    @property
    def fault(self) -> Fault | None:
        """The fault, or None."""
        return self.envelope.fault if self.envelope else None

    @property
    def code(self) -> str:
        """The standard code of the fault (SOAP 1.1, 4.4.1); empty without a fault, or with a code of another kind."""
        return self.fault.standard if self.fault else ""

    @property
    def is_success(self) -> bool:
        """Return whether the response is 2xx and no fault."""
        return self.exchange.response.ok and self.fault is None

    @property
    def is_taken(self) -> bool:
        """Return whether a SOAP message reports success. An HTML page reports nothing."""
        return self.is_success and self.envelope is not None

    @property
    def is_refused(self) -> bool:
        """Whether the request was refused: by a fault, or by 4xx."""
        return self.fault is not None or 400 <= self.status < 500  # noqa: PLR2004 - RFC 9110 15.5

    @property
    def first(self) -> etree._Element | None:
        """The first child of the response's Body, or None."""
        return self.envelope.first if self.envelope else None

    @property
    def payload(self) -> str | None:
        """The tag of the first child of the response's Body, or None."""
        return None if self.first is None else str(self.first.tag)

    def describe(self) -> str:
        """Return the response in words for a finding."""
        came = f"status {self.status}"
        if self.fault is not None:
            return f"{came}, fault {self.fault.code or '(no code)'}: {self.fault.string[:_SHOWN]!r}"
        if self.envelope is None:
            return f"{came}, {self.problem}"
        return f"{came}, {self.payload or 'an empty Body'}"


def read_exchange(exchange: Exchange) -> SoapResponse:
    """Return the SOAP message in an exchange, or the reason why there is none."""
    if not exchange.response.body:
        return SoapResponse(exchange, None, "an empty body")
    try:
        return SoapResponse(exchange, read(exchange.response.body), "")
    except NotSoapError as error:
        return SoapResponse(exchange, None, str(error))


def send(service: SoapService, message: Node | bytes | str, **how: Any) -> SoapResponse:
    """Send a message to a SOAP service and return the response; ``how`` has the options of SoapService.post().

    A Node is an Envelope and is written as XML; bytes and text are sent unchanged. While the service puts the message
    off by Retry-After, it is sent again.

    Raises:
        NoAnswerError: no HTTP response came.
    """
    if isinstance(message, Node):
        message = message.serialize()
    elif isinstance(message, str):
        message = message.encode()
    octets = message
    *_, exchange = until_taken(service.client.connection, lambda: service.post(octets, **how))
    return read_exchange(exchange)


def call(service: SoapService, *payload: Node, headers: tuple[Node, ...] | None = None, **how: Any) -> SoapResponse:
    """Send an envelope of the given children of Body and Header.

    Raises:
        NoAnswerError: no HTTP response came.
    """
    return send(service, envelope(payload, headers), **how)


@dataclass(frozen=True)
class SoapExpectation(Expectation):
    """An expectation of a SOAP response; a finding describes the message in it.

    Attributes:
        answer: what the service answered.
    """

    answer: SoapResponse | None = None

    def succeeds(self, when: str) -> bool:
        """Judge that the request was accepted: 2xx and a message without a fault."""
        holds = self.answer is not None and self.answer.is_taken
        return self.that(holds, f"status 2xx with a SOAP message when {when}")

    def fault(self, code: str, when: str, *, cause: str = "") -> bool:
        """Judge that the response is a fault with a standard code."""
        holds = self.answer is not None and self.answer.code == code
        return self.that(holds, f"a fault with the code {code} when {when}", cause=cause)


def expect_answer(judge: Judge, requirement: str, answer: SoapResponse) -> SoapExpectation:
    """Return an Expectation for one SOAP response; its methods judge."""
    return SoapExpectation(judge, requirement, answer.exchange, answer.describe(), answer)


def judge_answer(
    judge: Judge,
    requirement: str,
    holds: bool,  # noqa: FBT001 - as Judge.check()
    answer: SoapResponse,
    expected: str,
    *,
    cause: str = "",
) -> bool:
    """Judge one case by a service's response, which a finding then describes; see Judge.check()."""
    return expect_answer(judge, requirement, answer).that(holds, expected, cause=cause)
