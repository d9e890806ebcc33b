"""The two SOAP services, on expat."""

from email.message import Message
from pathlib import Path
from typing import Any

from conformance.packs.table1.independent_robots.body import Body
from conformance.packs.table1.independent_robots.plain import reading, rest
from conformance.packs.table1.independent_robots.plain.reading import (
    Element,
    MalformedError,
    RefusedError,
    fit_element,
    parse_xml,
)
from conformance.packs.table1.independent_robots.plain.server import Answer
from conformance.packs.table1.independent_robots.plain.writing import element

_SOAP = "http://schemas.xmlsoap.org/soap/envelope/"
_TNS = "http://soap.turtlebot.mybot.org/"
_NEXT = "http://schemas.xmlsoap.org/soap/actor/next"
_SERVICES = {"/turtlesim_publisher_ws": "publishers.wsdl", "/turtlesim_subscriber_ws": "subscribers.wsdl"}
_READ = ("GetPose", "GetVelocity", "GetSensors", "GetNavigationServices", "GetGoal")


class _FaultError(Exception):
    def __init__(self, code: str, text: str) -> None:
        super().__init__(text)
        self.code = code


class Soap:
    """The SOAP interface of one body.

    Attributes:
        base: URL of this server, for the WSDL's address.
    """

    def __init__(self, body: Body) -> None:
        self._body = body
        self.base = ""

    def answer(self, method: str, target: str, headers: Message, body: bytes) -> Answer:  # noqa: PLR0911 - one for each kind
        """Return the response to a request."""
        path, _, query = target.partition("?")
        if path not in _SERVICES:
            return Answer(404, b"not here", "text/plain")
        if method in {"GET", "HEAD"} and query.lower() == "wsdl":
            wsdl = (Path(__file__).parent / _SERVICES[path]).read_text(encoding="utf-8")
            return Answer(200, wsdl.replace("@ADDRESS@", self.base + path).encode(), "text/xml; charset=utf-8")
        if method != "POST":
            return Answer(405, fields={"Allow": "POST"})
        if headers.get_content_type() != "text/xml":
            return Answer(415)
        try:
            content = self._envelope(body, reading=path.endswith("subscriber_ws"))
        except MalformedError:
            return Answer(400)
        except RefusedError as refused:
            return _fault("Client", str(refused))
        except _FaultError as fault:
            return _fault(fault.code, str(fault))
        return _enveloped(200, content)

    def _envelope(self, body: bytes, *, reading: bool) -> str:
        """Process an envelope (SOAP 1.1 section 4), faults in the order of WS-I R2725; return the response."""
        top = parse_xml(body)
        if top.local == "Envelope" and top.namespace != _SOAP:
            raise _FaultError("VersionMismatch", f"this is SOAP 1.1, not {top.namespace!r}")
        if top.name != f"{_SOAP} Envelope":
            raise _FaultError("Client", f"{top.name!r} is no Envelope")
        parts = list(top.children)
        if parts and parts[0].name == f"{_SOAP} Header":
            for block in parts.pop(0).children:
                must = block.attributes.get(f"{_SOAP} mustUnderstand", "0")
                if must == "1" and block.attributes.get(f"{_SOAP} actor", _NEXT) in {_NEXT, ""}:
                    raise _FaultError("MustUnderstand", f"{block.name!r} is not understood")
        if [part.name for part in parts] != [f"{_SOAP} Body"]:
            raise _FaultError("Client", "an Envelope has one Body, and nothing after it")
        if len(parts[0].children) != 1:
            raise _FaultError("Client", f"a Body has one child, not {len(parts[0].children)}")
        request = parts[0].children[0]
        if request.namespace == _TNS:
            content = self._read(request) if reading else self._act(request)
            if content is not None:
                return f'<m:{request.local}Response xmlns:m="{_TNS}">{content}</m:{request.local}Response>'
        raise _FaultError("Client", f"there is no operation {request.name!r}")

    def _act(self, request: Element) -> str | None:
        if request.local not in {"ExecuteCoffeeRequest", "ExecuteDeliveryRequest"}:
            return None
        given = fit_element(request, {"arg0": reading.DELIVERY}, "", ordered=True)["arg0"]
        code = given.pop("message_code")
        rest.deliver(self._body, "soap", 4 if request.local == "ExecuteCoffeeRequest" else code, list(given.values()))
        return ""

    def _read(self, request: Element) -> str | None:
        if request.local == "GetPlan":
            given = fit_element(request, reading.PLAN, "", ordered=True)
            return element("return", rest.plan_value(self._body, given))
        if request.local not in _READ:
            return None
        fit_element(request, {}, "", ordered=True)
        value: Any
        if request.local == "GetPose":
            value = [self._body.odometry()]
        elif request.local == "GetVelocity":
            value = [self._body.velocity()]
        elif request.local == "GetGoal":
            goal = self._body.current()
            value = [rest.goal_value(goal)] if goal else []
        else:
            value = rest.SENSORS if request.local == "GetSensors" else rest.SERVICES
        return "".join(element("return", item) for item in value)


def _enveloped(status: int, content: str) -> Answer:
    text = (
        f'<?xml version="1.0" encoding="UTF-8"?><soap:Envelope xmlns:soap="{_SOAP}">'
        f"<soap:Body>{content}</soap:Body></soap:Envelope>"
    )
    return Answer(status, text.encode(), "text/xml; charset=utf-8")


def _fault(code: str, text: str) -> Answer:
    fields = element("faultcode", f"soap:{code}") + element("faultstring", text)
    return _enveloped(500, f"<soap:Fault>{fields}</soap:Fault>")
