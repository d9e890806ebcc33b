"""Compare two descriptions of one service by what matters to a client; layout, prefixes and type names may differ."""

from collections.abc import Iterator

from conformance.documents.wsdl import SoapOperation, Wsdl
from conformance.documents.xml import local
from conformance.documents.xsd import SchemaError
from conformance.documents.xsd_shapes import Complex, Element, Simple


def names(contract: Wsdl, robot: Wsdl) -> Iterator[str]:
    """Yield the names that differ between the robot's description and the contract's.

    Raises:
        WsdlError: the robot's has no binding or no port type.
    """
    for what, wanted, found in (
        ("target namespace", contract.target_namespace, robot.target_namespace),
        ("port type", contract.bound[0].port_type, robot.bound[0].port_type),
        ("binding", contract.bound[0].binding, robot.bound[0].binding),
    ):
        if wanted != found:
            yield f"{what} {found!r}, not {wanted!r}"
    for what in ("service", "name"):
        here, there = ({getattr(port, what) for port in wsdl.bound} for wsdl in (contract, robot))
        # A robot may have further services and ports, such as one for SOAP 1.2.
        for missing in sorted(here - there):
            kind = "port" if what == "name" else what
            yield f"{kind} {', '.join(sorted(there)) or 'none'!r}, not {missing!r}"


def operations(contract: Wsdl, robot: Wsdl) -> Iterator[str]:
    """Yield the differences between the operations of the robot's description and of the contract's.

    Raises:
        WsdlError: the robot's has no binding or no port type.
    """
    there = {operation.name: operation for operation in robot.operations}
    for wanted in contract.operations:
        found = there.get(wanted.name)
        if found is None:
            yield f"no operation {wanted.name!r}"
            continue
        for what, here, other in (
            ("input element", wanted.request, found.request),
            ("output element", wanted.response, found.response),
            ("messages", ", ".join(wanted.messages), ", ".join(found.messages)),
            ("parts", str(wanted.parts), str(found.parts)),
            ("soapAction", wanted.action, found.action),  # a missing one is an empty one (WSDL 1.1, 3.4)
        ):
            if here != other:
                yield f"{what} {other or '(none)'} of {wanted.name}, not {here or '(none)'}"


def actions(contract: Wsdl, robot: Wsdl) -> Iterator[str]:
    """Yield each wsam:Action that the contract does not allow: as printed, or with ``Request`` as JAX-WS RI has it."""
    there = {operation.name: operation for operation in robot.operations}
    for wanted in contract.operations:
        found = there.get(wanted.name)
        if found is None:
            continue
        yield from _action(wanted, "input", wanted.input_action, found.input_action, ("", "Request"))
        yield from _action(wanted, "output", wanted.output_action, found.output_action, ("",))


def _action(
    operation: SoapOperation, side: str, wanted: str | None, found: str | None, ends: tuple[str, ...]
) -> Iterator[str]:
    allowed = [f"{wanted}{end}" for end in ends]
    if wanted is not None and found not in allowed:
        yield f"wsam:Action {found!r} of the {side} of {operation.name}, not {' or '.join(map(repr, allowed))}"


def types(contract: Wsdl, robot: Wsdl) -> Iterator[str]:
    """Yield the differences between the types of the messages, element by element.

    Raises:
        WsdlError: the robot's has no binding or no port type.
    """
    _ = robot.bound
    for operation in contract.operations:
        for tag in (operation.request, operation.response):
            if not tag:
                continue
            wanted = contract.shape(tag)
            try:
                found = robot.shape(tag)
            except SchemaError as error:
                yield f"schemas that do not compile: {error}"
                return
            if wanted is None:
                continue
            if found is None:
                yield f"no element {tag} in any schema"
            else:
                yield from _element(wanted, found, local(tag))


def _element(wanted: Element, found: Element, where: str) -> Iterator[str]:
    if wanted.tag != found.tag:
        yield f"{found.tag!r} as {where}, not {wanted.tag!r}"
        return
    if (wanted.minimum, wanted.maximum) != (found.minimum, found.maximum):
        yield f"{where} that occurs {_often(found)}, not {_often(wanted)}"
    if isinstance(wanted.type, Simple) or isinstance(found.type, Simple):
        yield from _simple(wanted.type, found.type, where)
        return
    here, there = wanted.children, found.children
    if [child.tag for child in here] != [child.tag for child in there]:
        yield f"{where} with {_tags_text(there)}, not {_tags_text(here)}"
        return
    if len(here) > 1 and _model(wanted.type) != _model(found.type):
        yield f"{where} as a {_model(found.type)}, not a {_model(wanted.type)}"
    for one, other in zip(here, there, strict=True):
        yield from _element(one, other, f"{where}/{local(one.tag)}")


def _simple(wanted: Simple | Complex, found: Simple | Complex, where: str) -> Iterator[str]:
    if not isinstance(wanted, Simple) or not isinstance(found, Simple):
        yield f"{where} with {'a simple' if isinstance(found, Simple) else 'a complex'} type"
    elif wanted.builtin != found.builtin:
        yield f"{where} of type {found.builtin}, not {wanted.builtin}"
    elif wanted.enumeration and sorted(wanted.enumeration) != sorted(found.enumeration):
        yield f"{where} with the values {', '.join(found.enumeration) or '(any)'}, not {', '.join(wanted.enumeration)}"


def _model(kind: Complex | Simple) -> str:
    return kind.content.model if isinstance(kind, Complex) and kind.content is not None else "value"


def _often(element: Element) -> str:
    return f"{element.minimum} to {'any number of' if element.maximum is None else element.maximum} times"


def _tags_text(elements: tuple[Element, ...]) -> str:
    return ", ".join(child.tag for child in elements) or "nothing"
