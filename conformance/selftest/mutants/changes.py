"""The parts that faults are made of: which exchanges, and what becomes of them."""

from __future__ import annotations

import json
import re
from typing import TYPE_CHECKING, Any

from lxml import etree

from conformance.selftest.wire import Answer

if TYPE_CHECKING:
    from collections.abc import Callable

    from conformance.selftest.proxy import Change
    from conformance.selftest.wire import Ask

    Where = Callable[[Ask], bool]
    When = Callable[[Answer], bool]
    Make = Callable[[], Change]
    Forward = Callable[[Ask], Answer]

POSE, VELOCITY, LINEAR = "/robot/pose/", "/robot/velocity/", "/robot/velocity/linear/"
SENSORS, SERVICES = "/robot/sensors/", "/robot/navigation/services/"
GOAL, PLAN, DELIVERIES = "/robot/navigation/action/goal/", "/robot/navigation/service/plan", "/robot/app/delivery/"
RESOURCES = (POSE, VELOCITY, LINEAR, SENSORS, SERVICES, GOAL, PLAN)
JSON = "application/json"
SOAP = "http://schemas.xmlsoap.org/soap/envelope/"
TNS = "http://soap.turtlebot.mybot.org/"
_SUCCESS = range(200, 300)


def rest(method: str = "", *paths: str) -> Where:
    """REST requests with one of these methods (any, when empty) to one of these paths (likewise)."""
    methods = method.split()

    def where(ask: Ask) -> bool:
        return ask.side == "rest" and (not methods or ask.method in methods) and (not paths or ask.path in paths)

    return where


def deliveries(ask: Ask) -> bool:
    """Delivery PUTs."""
    return (
        ask.side == "rest"
        and ask.method == "PUT"
        and ask.path.startswith(DELIVERIES)
        and len(ask.path) > len(DELIVERIES)
    )


def soap(*operations: str) -> Where:
    """SOAP requests whose body speaks of one of these operations (of any, when there are none)."""
    names = "|".join(operations) or r"[\w.-]+"
    pattern = re.compile(rb"<(?:[\w.-]+:)?(?:%s)[\s/>]" % names.encode())

    def where(ask: Ask) -> bool:
        return ask.side == "soap" and ask.method == "POST" and bool(pattern.search(ask.body))

    return where


def wsdls(ask: Ask) -> bool:
    """Requests for a WSDL, or for a document that it imports."""
    return ask.side == "soap" and ask.method in {"GET", "HEAD"} and bool(ask.query)


def success(answer: Answer) -> bool:
    """Answers with 2xx."""
    return answer.status in _SUCCESS


def status(*values: int) -> When:
    """Answers with one of these."""
    return lambda answer: answer.status in values


def refusal(answer: Answer) -> bool:
    """Answers with 4xx."""
    return 400 <= answer.status < 500


def anything(_answer: Answer) -> bool:
    """Every answer."""
    return True


def altered(where: Where, edit: Callable[[Answer], object], when: When = success, *, nth: int = 1) -> Make:
    """Alter answers; with ``nth`` only each nth of those that it concerns."""

    def make() -> Change:
        seen = 0

        def change(ask: Ask, forward: Forward) -> Answer:
            nonlocal seen
            answer = forward(ask)
            if where(ask) and when(answer):
                seen += 1
                if seen % nth == 0:
                    answer = answer.copy()
                    edit(answer)
            return answer

        return change

    return make


def rewritten(where: Where, edit: Callable[[Ask], object]) -> Make:
    """Alter requests on their way to the robot."""

    def make() -> Change:
        def change(ask: Ask, forward: Forward) -> Answer:
            if where(ask):
                ask = ask.copy()
                edit(ask)
            return forward(ask)

        return change

    return make


def secretly(where: Where, edit: Callable[[Ask], object]) -> Make:
    """Alter requests on their way to the robot, and answer 204, so that no answer tells."""

    def make() -> Change:
        def change(ask: Ask, forward: Forward) -> Answer:
            if not where(ask):
                return forward(ask)
            altered_ask = ask.copy()
            edit(altered_ask)
            answer = forward(altered_ask)
            return Answer(204, asked=ask.method) if success(answer) else answer

        return change

    return make


def instead(where: Where, answer: Callable[[Ask], Answer]) -> Make:
    """Answer requests without asking the robot."""

    def make() -> Change:
        def change(ask: Ask, forward: Forward) -> Answer:
            return answer(ask) if where(ask) else forward(ask)

        return change

    return make


def remembering(kind: Callable[[], Change]) -> Make:
    """A change with a memory of its own in each run; ``kind`` is its class or maker."""
    return kind


def plain(status_: int, body: bytes = b"", media_type: str = "", *fields: tuple[str, str]) -> Callable[[Ask], Answer]:
    """An answer of one's own."""
    said = [("Content-Type", media_type)] if media_type else []
    return lambda ask: Answer(status_, [*said, *fields], body, asked=ask.method)


def problem(status_: int, detail: str, *fields: tuple[str, str]) -> Callable[[Ask], Answer]:
    """A problem as RFC 9457 has it."""
    body = json.dumps({"status": status_, "detail": detail}).encode()
    return plain(status_, body, "application/problem+json", *fields)


def becomes(status_: int) -> Callable[[Answer], object]:
    """Another status, in the problem too."""

    def edit(answer: Answer) -> None:
        answer.status, answer.reason = status_, ""
        if answer.media_type.endswith("problem+json"):
            value = parsed(answer.body)
            if isinstance(value, dict):
                answer.body = json.dumps({**value, "status": status_}).encode()

    return edit


def parsed(body: bytes) -> Any:
    """JSON, or None."""
    try:
        return json.loads(body)
    except (ValueError, RecursionError):
        return None


def values(edit: Callable[[Any], Any]) -> Callable[[Answer], object]:
    """Alter the value of a JSON answer: ``edit`` changes it in place, or returns another one."""

    def apply(answer: Answer) -> None:
        value = parsed(answer.body)
        if value is not None and answer.media_type.endswith("json"):
            made = edit(value)
            answer.body = json.dumps(value if made is None else made).encode()

    return apply


def inputs(edit: Callable[[Any], Any]) -> Callable[[Ask], object]:
    """Alter the value of a JSON request, as values() does."""

    def apply(ask: Ask) -> None:
        value = parsed(ask.body)
        if value is not None:
            made = edit(value)
            ask.body = json.dumps(value if made is None else made).encode()

    return apply


def text(pattern: str, by: str, count: int = 0) -> Callable[[Answer], object]:
    """Replace a regular expression in an answer's body."""
    compiled = re.compile(pattern.encode(), re.DOTALL)

    def edit(answer: Answer) -> None:
        answer.body = compiled.sub(by.encode(), answer.body, count=count)

    return edit


def tree(edit: Callable[[Any], object]) -> Callable[[Answer], object]:
    """Alter the XML tree of an answer's body; what is no XML stays as it is."""

    def apply(answer: Answer) -> None:
        root = xml(answer.body)
        if root is not None:
            edit(root)
            answer.body = etree.tostring(root, xml_declaration=True, encoding="UTF-8")

    return apply


def xml(body: bytes) -> Any:
    """The root of an XML document without its comments and CDATA, or None."""
    parser = etree.XMLParser(resolve_entities=False, no_network=True, remove_comments=True, huge_tree=True)
    try:
        return etree.fromstring(body, parser)
    except (etree.XMLSyntaxError, ValueError):
        return None


def named(root: Any, name: str) -> list[Any]:
    """Elements with a local name, in document order."""
    return [node for node in root.iter() if isinstance(node.tag, str) and etree.QName(node).localname == name]


def header(name: str, value: str | None) -> Callable[[Answer], object]:
    """Set a header field, or remove it."""
    return lambda answer: answer.drop(name) if value is None else answer.put(name, value)


def set_fields(**fields: object) -> Callable[[Any], None]:
    """Set members of a JSON object."""
    return lambda value: value.update(fields)
