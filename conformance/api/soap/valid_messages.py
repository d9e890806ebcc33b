"""Messages that a robot accepts: mutations start from them, and they show that it still responds.

A contract may limit values beyond its schema. So a message counts as accepted only after the robot has accepted it.
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import Final

from conformance.api.soap.calls import SoapResponse, call
from conformance.api.soap.envelope import NotSoapError, read_root
from conformance.api.soap.messages import ordinary, simple_leaves, with_text
from conformance.api.soap.service import SoapService
from conformance.documents.wsdl import SoapOperation
from conformance.documents.xml import XSD, XSI, Node, NotXmlError, clark, namespace, parse
from conformance.documents.xsd_shapes import FLOATS, INTEGERS, Element, bounds
from conformance.verdict.evidence import HarnessError

# Whole numbers to try where a device accepts only some, such as codes.
_NUMBERS: Final = (0, 1, 2, 3, 4, 5)


def require_valid_message(service: SoapService, message: Node) -> Node:
    """Check that the contract allows a message which the suite sends as valid, and return it.

    Raises:
        HarnessError: it is not; the message says why.
        DescriptionError: the contract cannot be used.
    """
    fault = service.contract.types.invalid(parse(message.serialize()))
    if fault:
        raise HarnessError(f"{message.name} was made as a valid message, and is none: {fault}")
    return message


def require_valid_document(service: SoapService, document: bytes | str) -> bytes:
    """Check that the contract allows bytes which the suite sends as a valid message, and return them.

    Raises:
        HarnessError: they are not; the message says why.
        DescriptionError: the contract cannot be used.
    """
    octets = document.encode() if isinstance(document, str) else document
    try:
        # Drop comments, because a comment splits a value into two text nodes.
        message = read_root(parse(octets, comments=False))
    except (NotXmlError, NotSoapError) as error:
        raise HarnessError(f"a document was made as a valid message, and is none: {error}") from error
    faults = [f"{len(message.payload)} children of Body"] if len(message.payload) != 1 else []
    faults += filter(None, map(service.contract.types.invalid, message.payload))
    if faults:
        raise HarnessError(f"a document was made as a valid message, and is none: {faults[0]}")
    return octets


def call_valid(service: SoapService, payload: Node, *, headers: tuple[Node, ...] | None = None) -> SoapResponse:
    """Call a service by a message that is valid by the contract.

    Raises:
        HarnessError: it is not.
        NoAnswerError: no HTTP response came.
    """
    return call(service, require_valid_message(service, payload), headers=headers)


def example(service: SoapService, operation: SoapOperation) -> Node | None:
    """Return a message that the robot accepts for the operation; the first call tries several, and sends them.

    Raises:
        NoAnswerError: no HTTP response came.
        DescriptionError: the contract cannot be used.
        HarnessError: none of those made is valid by the contract.
    """
    if operation.name not in service.examples:
        service.examples[operation.name] = _find_valid(service, operation)
    return service.examples[operation.name]


def _find_valid(service: SoapService, operation: SoapOperation) -> Node | None:
    declared = service.contract.shape(operation.request) if operation.request else None
    if declared is None:
        return None
    tried: set[bytes] = set()
    faults: list[str] = []
    for candidate in candidates(service, operation, declared):
        document = candidate.serialize()
        if document in tried:
            continue
        tried.add(document)
        fault = service.contract.types.invalid(parse(document))
        if fault:
            faults.append(fault)
        elif call(service, candidate).is_taken:
            return candidate
    if len(faults) == len(tried):
        raise HarnessError(f"no message made for {operation.name} is valid: {faults[-1]}")
    return None


def candidates(service: SoapService, operation: SoapOperation, declared: Element) -> Iterator[Node]:
    """Yield messages of an operation to try, likeliest first, at least one.

    Raises:
        NoAnswerError: no HTTP response came.
    """
    yield from service.known_messages(service, operation)
    for optional in (False, True):
        yield ordinary(declared, optional=optional)
    full = ordinary(declared, optional=True)
    for number in _NUMBERS:
        made = full
        for path, simple in simple_leaves(declared, full):
            if simple.builtin in FLOATS and not simple.enumeration:
                made = with_text(made, path, f"{number}.0")
            elif simple.builtin in INTEGERS and not simple.enumeration:
                low, high = bounds(simple)
                made = with_text(made, path, str(min(max(number, low), high)))
        yield made


def quiet_example(service: SoapService) -> tuple[SoapOperation, Node] | None:
    """Return the first operation with an accepted message, or None.

    Raises:
        NoAnswerError: no HTTP response came.
        DescriptionError: the contract cannot be used.
    """
    # Try the smallest message first: it is the least likely to be refused.
    for operation in sorted(service.contract.operations, key=lambda item: _size(service, item)):
        message = example(service, operation)
        if message is not None:
            return operation, message
    return None


def _size(service: SoapService, operation: SoapOperation) -> int:
    declared = service.contract.shape(operation.request) if operation.request else None
    return len(ordinary(declared, optional=True).paths()) if declared is not None else 1000


def with_xsi_types(message: Node, declared: Element, payload: Node) -> bytes:
    """Return a message in which each value of the payload has xsi:type, as in RPC-encoded SOAP."""
    made = payload
    for path, simple in simple_leaves(declared, payload):
        if path:
            attribute = (clark(XSI, "type"), f"xs:{simple.builtin}")
            made = made.replaced(path, replace(made.at(path), attributes=(attribute,)))
    if made == payload:
        made = replace(payload, attributes=((clark(XSI, "type"), f"tns:{payload.name}"),))
    body = message.children[-1]
    whole = replace(message, children=(*message.children[:-1], replace(body, children=(made,))))
    bindings = f' xmlns:xs="{XSD}" xmlns:tns="{namespace(payload.tag)}" xmlns:'.encode()
    return whole.serialize().replace(b" xmlns:", bindings, 1)
