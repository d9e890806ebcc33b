"""Mutants that repair or accept invalid SOAP input instead of refusing it."""

import re
from collections.abc import Callable
from typing import Any

from lxml import etree

from conformance.papers_robot.delivery import XSD_FIELDS
from proof.mutation.changes import SOAP, Make, rewritten, soap
from proof.mutation.messages import Request
from proof.mutation.table import Table
from proof.mutation.xml_trees import find_named, xml
from proof.table1.mutants.paths import TNS

MUTANTS = Table()
_mutant = MUTANTS.of_class("strict-input", "soap")
_ACT = soap("ExecuteCoffeeRequest", "ExecuteDeliveryRequest")
_XSI = "http://www.w3.org/2001/XMLSchema-instance"
_DOUBLE = re.compile(r"\s*([+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?|[+-]?INF|NaN)\s*", re.ASCII)
_INT = re.compile(r"\s*[+-]?\d+\s*", re.ASCII)


def _repair(edit: Callable[[Any, Any], None]) -> Callable[[Request], None]:
    """Return an edit of requests; ``edit`` takes the Body element and the deliveryRequestMessage, or None."""

    def apply(request: Request) -> None:
        root = xml(request.body)
        body = root.find(f"{{{SOAP}}}Body") if root is not None else None
        if body is None:
            return
        message = next(iter(find_named(body, "arg0")), None)
        before = etree.tostring(root)
        edit(body, message)
        if etree.tostring(root) != before:
            request.body = etree.tostring(root)

    return apply


def _repairing(edit: Callable[[Any, Any], None]) -> Make:
    return rewritten(soap("Execute[A-Z][A-Za-z]+", "Body"), _repair(edit))


def _children(message: Any) -> list[Any]:
    return [child for child in message if isinstance(child.tag, str)] if message is not None else []


def _neutral(name: str) -> str:
    return "3" if name == "message_code" else "0"


@_mutant("input-soap-missing-is-zero", "soap-missing", "A missing element counts as 0, as in JAX-WS RI.").through(
    _repairing
)
def _fill(body: Any, message: Any) -> None:
    for wrapper in body if message is None else ():
        if isinstance(wrapper.tag, str) and etree.QName(wrapper).localname.startswith("Execute") and not len(wrapper):
            message = etree.SubElement(wrapper, "arg0")
    if message is None:
        return
    there = [child.tag for child in _children(message)]
    for place, name in enumerate(XSD_FIELDS):
        if name not in there:
            made = etree.Element(name)
            made.text = _neutral(name)
            message.insert(place, made)


@_mutant("input-soap-unknown-ignored", "soap-unknown", "Unknown elements are ignored, as in JAX-WS RI.").through(
    _repairing
)
def _drop_unknown(body: Any, message: Any) -> None:
    for child in _children(message):
        if etree.QName(child).localname not in XSD_FIELDS:
            message.remove(child)
    for wrapper in body:
        for child in _children(wrapper):
            if etree.QName(child).localname != "arg0":
                wrapper.remove(child)


@_mutant("input-soap-first-wins", "soap-duplicate", "Of a duplicate element, the first one counts.").through(_repairing)
def _once(_body: Any, message: Any) -> None:
    seen: set[str] = set()
    for child in _children(message):
        if child.tag in seen:
            message.remove(child)
        seen.add(child.tag)
    parent = message.getparent() if message is not None else None
    if parent is not None:
        for twin in parent.findall("arg0")[1:]:
            parent.remove(twin)


@_mutant("input-soap-any-order", "soap-order", "Elements may come in any order.").through(_repairing)
def _order(_body: Any, message: Any) -> None:
    if message is not None:
        message[:] = sorted(
            message, key=lambda child: XSD_FIELDS.index(child.tag) if child.tag in XSD_FIELDS else len(XSD_FIELDS)
        )


@_mutant("input-soap-any-namespace", "soap-namespace", "The robot ignores namespaces.").through(_repairing)
def _drop_namespaces(body: Any, _message: Any) -> None:
    for wrapper in body:
        if isinstance(wrapper.tag, str):
            wrapper.tag = f"{{{TNS}}}{etree.QName(wrapper).localname}"
            for node in wrapper.iterdescendants():
                if isinstance(node.tag, str):
                    node.tag = etree.QName(node).localname


@_mutant("input-soap-text-is-zero", "soap-lexical", "Text in place of a number counts as 0, as in JAX-WS RI.").through(
    _repairing
)
def _lexical(_body: Any, message: Any) -> None:
    for child in _children(message):
        good = _INT if child.tag == "message_code" else _DOUBLE
        if not good.fullmatch("".join(child.itertext())) or len(child):
            child[:] = []
            child.text = _neutral(child.tag)


@_mutant("input-soap-overflow", "soap-range", "An integer beyond its type is replaced.").through(_repairing)
def _wrap_integers(_body: Any, message: Any) -> None:
    for child in _children(message):
        if child.tag == "message_code" and _INT.fullmatch(child.text or "") and abs(int(child.text)) >= 2**31:
            child.text = "3"


@_mutant("input-soap-inf-is-zero", "soap-non-finite", "INF and NaN count as 0.").through(_repairing)
def _finite(_body: Any, message: Any) -> None:
    for child in _children(message):
        text = (child.text or "").strip()
        if re.fullmatch(r"[+-]?INF|NaN", text) or re.fullmatch(r"[+-]?[\d.]+[eE]\+?\d{3,}", text):
            child.text = "0"


@_mutant("input-soap-nil-is-zero", "soap-nil", "Elements with xsi:nil count as 0.").through(_repairing)
def _not_nil(_body: Any, message: Any) -> None:
    for child in [message, *_children(message)] if message is not None else []:
        if child.attrib.pop(f"{{{_XSI}}}nil", None) and child is not message and not (child.text or "").strip():
            child.text = _neutral(child.tag)
    if message is not None and not len(message):
        _fill(None, message)


@_mutant(
    "input-soap-first-child", "soap-body", "Only the first child of Body counts, and an empty Body is a coffee."
).through(_repairing)
def _alone(body: Any, _message: Any) -> None:
    for child in list(body)[1:]:
        body.remove(child)
    if not len(body):
        wrapper = etree.SubElement(body, f"{{{TNS}}}ExecuteCoffeeRequest")
        _fill(None, etree.SubElement(wrapper, "arg0"))


@_mutant("input-soap-any-code", "soap-code", "Every code counts as 3.").through(_repairing)
def _set_code(_body: Any, message: Any) -> None:
    for child in _children(message):
        text = (child.text or "").strip()
        if child.tag == "message_code" and _INT.fullmatch(text) and int(text) not in {3, 4} and abs(int(text)) < 2**31:
            child.text = "3"
