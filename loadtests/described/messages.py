"""The messages to the operations of a WSDL: made by its schema as `roaas certify` makes them, kept where accepted."""

from collections.abc import Iterator

from conformance.documents.openapi import Operation
from conformance.documents.wsdl import SoapOperation, SoapPort
from conformance.documents.wsdl_pack import each, label_of
from conformance.documents.xml import Node, local
from conformance.scenarios.described_messages import DescribedMessages, fields_of, target_of
from conformance.scenarios.scenario import NotPossibleError
from conformance.transport.credentials import hidden
from conformance.transport.exchange import NoAnswerError, Request
from conformance.transport.reach import is_same
from loadtests.clients.failures import CallError, Reply
from loadtests.clients.payloads import VARIANTS
from loadtests.clients.robot import Described
from loadtests.described.device import Device
from loadtests.settings.settings import SettingsError

#: Messages of an acting operation that are tried until the device accepts one.
_TRIED = 4


def _found(messages: DescribedMessages, operation: Operation) -> tuple[SoapPort, SoapOperation]:
    """Return an operation of the WSDL with its port."""
    return next(found for found in each(messages.found.ports) if label_of(*found) == operation.label)


def at_hand(messages: DescribedMessages, operation: Operation) -> bool:
    """Return whether the port of an operation is at the server of the first one; others are not called."""
    return is_same(_found(messages, operation)[0].url, messages.found.base)


def described_message(device: Device, messages: DescribedMessages, operation: Operation) -> Described:
    """Return an operation with a message for each set of values that the device accepts; with one, if it acts.

    Raises:
        SettingsError: no valid message can be made.
    """
    port, own = _found(messages, operation)
    reply = Reply(local(own.response or ""))
    good, bad = list[bytes](), list[bytes]()
    for node in list(dict.fromkeys(_bodies(messages, own)))[: None if operation.safe else _TRIED]:
        try:
            message = messages.message(port, own, node)
            sent = device.api.client.send("POST", target_of(port), headers=fields_of(port, own), body=message)
            answer, request = sent.response, sent.request
            reply.require(answer.status, answer.header("location"), None, answer.body)
            good.append(hidden(bytes_of(request)))
        except NotPossibleError as error:
            raise SettingsError(str(error)) from None
        except NoAnswerError as none:
            bad.append(hidden(bytes_of(none.unanswered.request)))
            break  # each further call would wait for the same deadline
        except CallError:
            bad.append(hidden(bytes_of(request)))
        if good and not operation.safe:
            break
    return Described(
        name=device.name_of(operation),
        method="POST",
        base_url=device.api.client.base_url,
        octets=tuple(good or bad[:1]),
        interface="soap",
        reply=reply.element,
    )


def _bodies(messages: DescribedMessages, operation: SoapOperation) -> Iterator[Node | None]:
    """Yield what the Body has, with the statement's values in rotation; the same again where it names too few.

    Raises:
        SettingsError: no valid message can be made.
    """
    turns = min(VARIANTS, max(map(len, messages.values.values()), default=1))
    try:
        for turn in range(turns):
            yield messages.usual(operation, turn)[1]
    except NotPossibleError as error:
        raise SettingsError(str(error)) from None


def bytes_of(request: Request) -> bytes:
    """Return the bytes of a request that was sent, with variables in place of credentials."""
    fields = [pair for pair in request.headers if pair[0] != "Connection"]
    lines = [
        f"{request.method} {request.target}{request.query} HTTP/1.1",
        *(f"{name}: {text}" for name, text in fields),
    ]
    return "\r\n".join([*lines, "", ""]).encode() + request.body
