"""The two SOAP services, on expat."""

from email.message import Message
from pathlib import Path
from typing import Any

from proof.table1.independent_robots.body import Body
from proof.table1.independent_robots.plain import reading, rest
from proof.table1.independent_robots.plain.reading import (
    Element,
    MalformedError,
    RefusedError,
    element,
    fit_element,
    parse_xml,
)
from proof.table1.independent_robots.plain.server import Answer

SOAP = "http://schemas.xmlsoap.org/soap/envelope/"
TNS = "http://soap.turtlebot.mybot.org/"
_NEXT = "http://schemas.xmlsoap.org/soap/actor/next"
_SERVICES = {"/turtlesim_publisher_ws": "publishers", "/turtlesim_subscriber_ws": "subscribers"}
_READ = ("GetPose", "GetVelocity", "GetSensors", "GetNavigationServices", "GetGoal")


class FaultError(Exception):
    """Raised for a message that gets a fault with this code."""

    def __init__(self, code: str, text: str) -> None:
        super().__init__(text)
        self.code = code


class Soap:
    """The SOAP interface of one body. Other robots override what they do differently.

    Attributes:
        base: URL of this server, for the WSDL's address.
        folder: with the WSDLs.
        files: what is served at the queries of a service, by their suffixes.
    """

    sensors, services = rest.SENSORS, rest.SERVICES
    folder, files = Path(__file__).parent, {"wsdl": "wsdl"}

    def __init__(self, body: Body) -> None:
        self._body = body
        self.base = ""

    def answer(self, method: str, target: str, headers: Message, body: bytes) -> Answer:  # noqa: PLR0911 - one for each kind
        """Return the response to a request."""
        path, _, query = target.partition("?")
        if path not in _SERVICES:
            return Answer(404, b"not here", "text/plain")
        if method in {"GET", "HEAD"} and query.lower() in self.files:
            file = f"{_SERVICES[path]}.{self.files[query.lower()]}"
            wsdl = (self.folder / file).read_text(encoding="utf-8")
            return Answer(200, wsdl.replace("@ADDRESS@", self.base + path).encode(), "text/xml; charset=utf-8")
        if method != "POST":
            return Answer(405, fields={"Allow": "POST"})
        if headers.get_content_type() != "text/xml":
            return Answer(415)
        try:
            content = self._envelope(body, reading=path.endswith("subscriber_ws"))
        except MalformedError as error:
            return self.malformed_answer(str(error))
        except RefusedError as refused:
            return self.fault("Client", str(refused))
        except FaultError as fault:
            return self.fault(fault.code, str(fault))
        return self.envelop(200, content)

    def malformed_answer(self, _problem: str) -> Answer:
        """Return the response to content that is no XML."""
        return Answer(400)

    def no_goal(self) -> list[Any]:
        """Return the values of GetGoal while there is no goal.

        Raises:
            FaultError: this robot says so by a fault.
        """
        return []

    def response(self, operation: str, values: list[Any]) -> str:
        """Return the response element of an operation."""
        content = "".join(element("return", value) for value in values)
        return f'<m:{operation}Response xmlns:m="{TNS}">{content}</m:{operation}Response>'

    def envelop(self, status: int, content: str) -> Answer:
        """Return a SOAP message."""
        text = (
            f'<?xml version="1.0" encoding="UTF-8"?><soap:Envelope xmlns:soap="{SOAP}">'
            f"<soap:Body>{content}</soap:Body></soap:Envelope>"
        )
        return Answer(status, text.encode(), "text/xml; charset=utf-8")

    def fault(self, code: str, text: str) -> Answer:
        """Return a fault."""
        fields = element("faultcode", f"soap:{code}") + element("faultstring", text)
        return self.envelop(500, f"<soap:Fault>{fields}</soap:Fault>")

    def _envelope(self, body: bytes, *, reading: bool) -> str:
        """Process an envelope (SOAP 1.1 section 4), faults in the order of WS-I R2725; return the response."""
        top = parse_xml(body)
        if top.local == "Envelope" and top.namespace != SOAP:
            raise FaultError("VersionMismatch", f"this is SOAP 1.1, not {top.namespace!r}")
        if top.name != f"{SOAP} Envelope":
            raise FaultError("Client", f"{top.name!r} is no Envelope")
        parts = list(top.children)
        if parts and parts[0].name == f"{SOAP} Header":
            for block in parts.pop(0).children:
                must = block.attributes.get(f"{SOAP} mustUnderstand", "0")
                if must == "1" and block.attributes.get(f"{SOAP} actor", _NEXT) in {_NEXT, ""}:
                    raise FaultError("MustUnderstand", f"{block.name!r} is not understood")
        if [part.name for part in parts] != [f"{SOAP} Body"]:
            raise FaultError("Client", "an Envelope has one Body, and nothing after it")
        if len(parts[0].children) != 1:
            raise FaultError("Client", f"a Body has one child, not {len(parts[0].children)}")
        request = parts[0].children[0]
        if request.namespace == TNS:
            content = self._read(request) if reading else self._act(request)
            if content is not None:
                return self.response(request.local, content)
        raise FaultError("Client", f"there is no operation {request.name!r}")

    def _act(self, request: Element) -> list[Any] | None:
        if request.local not in {"ExecuteCoffeeRequest", "ExecuteDeliveryRequest"}:
            return None
        given = fit_element(request, {"arg0": reading.DELIVERY}, "", ordered=True)["arg0"]
        code = given.pop("message_code")
        rest.deliver(self._body, "soap", 4 if request.local == "ExecuteCoffeeRequest" else code, list(given.values()))
        return []

    def _read(self, request: Element) -> list[Any] | None:
        if request.local == "GetPlan":
            given = fit_element(request, reading.PLAN, "", ordered=True)
            return [rest.plan_value(self._body, given)]
        if request.local not in _READ:
            return None
        fit_element(request, {}, "", ordered=True)
        if request.local == "GetPose":
            return [self._body.odometry()]
        if request.local == "GetVelocity":
            return [self._body.velocity()]
        if request.local == "GetGoal":
            goal = self._body.current()
            return [rest.goal_value(goal)] if goal else self.no_goal()
        return self.sensors if request.local == "GetSensors" else self.services
