"""SOAP, judged by the service's own schema with lxml."""

import math
from functools import cache
from pathlib import Path
from typing import Any
from xml.sax.saxutils import escape

from lxml import etree

from conformance.packs.table1.independent_robots.baroque import resources
from conformance.packs.table1.independent_robots.baroque.judging import NotTakenError, safe_xml
from conformance.packs.table1.independent_robots.baroque.server import Ask, Reply
from conformance.packs.table1.independent_robots.baroque.writing import fill
from conformance.packs.table1.independent_robots.body import Body

_ENV = "http://schemas.xmlsoap.org/soap/envelope/"
_OURS = "http://soap.turtlebot.mybot.org/"
_SERVICES = {"/turtlesim_publisher_ws": "publishers", "/turtlesim_subscriber_ws": "subscribers"}
_FOR_US = ("", "http://schemas.xmlsoap.org/soap/actor/next")
_WHOLE = ("message_code",)


class _Fault(Exception):  # noqa: N818 - a SOAP fault is what it is called
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

    def answer(self, ask: Ask) -> Reply:  # noqa: PLR0911 - one for each kind of request
        """Return the response to a request."""
        service = _SERVICES.get(ask.path)
        if service is None:
            return Reply(404, b"?", "text/plain")
        if ask.method in {"GET", "HEAD"} and ask.query in {"wsdl", "WSDL", "xsd=1"}:
            file = f"{service}.{'xsd' if ask.query == 'xsd=1' else 'wsdl'}"
            text = (Path(__file__).parent / file).read_text(encoding="utf-8")
            return Reply(200, text.replace("@ADDRESS@", self.base + ask.path).encode(), "text/xml;charset=utf-8")
        if ask.method != "POST":
            return Reply(405, fields=[("allow", "POST")])
        if ask.fields.get("content-type", "").partition(";")[0].strip().lower() != "text/xml":
            return Reply(415)
        try:
            return _reply(200, self._process(ask.body, service))
        except etree.XMLSyntaxError as error:
            return _fault("Client", f"no XML: {error}")
        except NotTakenError as refused:
            return _fault("Client", str(refused))
        except _Fault as fault:
            return _fault(fault.code, str(fault))

    def _process(self, body: bytes, service: str) -> str:
        root = safe_xml(body)
        name = etree.QName(root)
        if name.localname == "Envelope" and name.namespace != _ENV:
            raise _Fault("VersionMismatch", f"Envelope of {name.namespace}")
        if root.tag != f"{{{_ENV}}}Envelope":
            raise _Fault("Client", f"{root.tag} where an Envelope should be")
        tags = [child.tag for child in root]
        if tags not in ([f"{{{_ENV}}}Body"], [f"{{{_ENV}}}Header", f"{{{_ENV}}}Body"]):
            raise _Fault("Client", f"children of Envelope: {tags!r:.300}")
        for block in root[0] if len(root) > 1 else ():
            must, actor = block.get(f"{{{_ENV}}}mustUnderstand"), block.get(f"{{{_ENV}}}actor", "")
            if must in {"1", "true"} and actor in _FOR_US:
                raise _Fault("MustUnderstand", f"{block.tag} means nothing here")
        content = list(root[-1])
        if len(content) != 1 or (root[-1].text or "").strip():
            raise _Fault("Client", f"{len(content)} elements in Body")
        request = content[0]
        schema = _schema(service)
        if not schema.validate(etree.fromstring(etree.tostring(request, with_tail=False))):
            raise _Fault("Client", str(schema.error_log.last_error.message if schema.error_log else "not valid"))
        operation = etree.QName(request).localname
        if operation.endswith("Response"):
            raise _Fault("Client", f"{operation} is no request")
        values = "".join(_unqualified("return", value) for value in self._perform(operation, request))
        return f'<{operation}Response xmlns="{_OURS}"><!-- answered -->{values}</{operation}Response>'

    def _perform(self, operation: str, request: Any) -> list[Any]:
        body = self._body
        if operation.startswith("Execute"):
            given = _numbers(request.find("arg0"))
            if operation == "ExecuteCoffeeRequest":
                given["message_code"] = 4
            if given["message_code"] not in {3, 4}:
                raise _Fault("Client", f"message_code {given['message_code']} is neither 3 nor 4")
            body.deliver("soap", **given)
            return []
        if operation == "GetPlan":
            frame = request.find("frame_id")
            given = _numbers([part for part in request if part.tag != "frame_id"])
            return [resources.plan_value(body, given if frame is None else {**given, "frame_id": frame.text or ""})]
        if operation == "GetGoal":
            goal = body.current()
            if goal is None:
                raise _Fault("Client", "the robot has no goal")
            return [resources.goal_value(goal, plain=True)]
        lists: dict[str, list[Any]] = {
            "GetSensors": resources.SENSORS,
            "GetNavigationServices": resources.SERVICES,
            "GetPose": [body.odometry()],
            "GetVelocity": [body.velocity()],
        }
        return lists[operation]


def _numbers(parts: Any) -> dict[str, Any]:
    if parts is None:
        raise _Fault("Client", "arg0 is missing")
    found: dict[str, Any] = {}
    for part in parts:
        # XML Schema has seen to it that these are numbers; INF, NaN and what overflows are the contract's affair.
        value = float(part.text)
        if not math.isfinite(value):
            raise _Fault("Client", f"{part.tag}: {part.text} is not finite")
        found[part.tag] = int(part.text) if part.tag in _WHOLE else value
    return found


@cache
def _schema(service: str) -> Any:
    return etree.XMLSchema(etree.parse(str(Path(__file__).parent / f"{service}.xsd")))


def _unqualified(name: str, value: Any) -> str:
    """Return an element in no namespace, although its parent has a default namespace."""
    element = etree.Element(name)
    fill(element, value, nested=False)
    return etree.tostring(element, encoding="unicode").replace(f"<{name}", f'<{name} xmlns=""', 1)


def _reply(status: int, content: str) -> Reply:
    text = f'<!-- baroque --><Envelope xmlns="{_ENV}"><Body>\n {content}\n </Body></Envelope>'
    return Reply(status, text.encode(), 'text/xml; charset="UTF-8"')


def _fault(code: str, text: str) -> Reply:
    said = escape("".join(char if char.isprintable() else " " for char in text))
    return _reply(
        500,
        f'<Fault><faultcode xmlns="" xmlns:code="{_ENV}">\n code:{code} </faultcode>'
        f'<faultstring xmlns="" xml:lang="en">{said}</faultstring>'
        f'<detail xmlns=""><advice xmlns="urn:example:baroque">see the manual</advice></detail></Fault>',
    )
