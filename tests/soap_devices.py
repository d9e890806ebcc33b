"""Three small SOAP services, right or with one fault, each with a WSDL of another kind.

A camera that pans (SOAP 1.1, document/literal, an imported schema), a scale (SOAP 1.1, rpc/literal), and a turntable
(SOAP 1.2, with WS-Security's UsernameToken).
"""

import base64
import hashlib
import socketserver
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache
from typing import Any
from wsgiref.simple_server import WSGIRequestHandler, WSGIServer, make_server

from lxml import etree

SOAP_11 = "http://schemas.xmlsoap.org/soap/envelope/"
SOAP_12 = "http://www.w3.org/2003/05/soap-envelope"
USER, PASSWORD = "operator", "correct horse"
_XS = 'xmlns:xs="http://www.w3.org/2001/XMLSchema"'
_WSDL = 'xmlns="http://schemas.xmlsoap.org/wsdl/"'
_SECURITY = "http://docs.oasis-open.org/wss/2004/01/oasis-200401-wss-wssecurity-secext-1.0.xsd"

CAMERA_XSD = f"""<xs:schema {_XS} targetNamespace="urn:camera" xmlns:c="urn:camera" elementFormDefault="qualified">
<xs:simpleType name="Angle"><xs:restriction base="xs:double"><xs:minInclusive value="-1"/><xs:maxInclusive value="1"/>
</xs:restriction></xs:simpleType>
<xs:complexType name="Position"><xs:attribute name="pan" type="c:Angle" use="required"/>
<xs:attribute name="tilt" type="c:Angle" use="required"/></xs:complexType>
<xs:element name="GetStatus"><xs:complexType><xs:sequence/></xs:complexType></xs:element>
<xs:element name="GetStatusResponse"><xs:complexType><xs:sequence>
<xs:element name="Position" type="c:Position"/>
<xs:element name="Moving"><xs:simpleType><xs:restriction base="xs:string"><xs:enumeration value="IDLE"/>
<xs:enumeration value="MOVING"/></xs:restriction></xs:simpleType></xs:element>
<xs:element name="Time" type="xs:dateTime" minOccurs="0"/></xs:sequence></xs:complexType></xs:element>
<xs:element name="AbsoluteMove"><xs:complexType><xs:sequence><xs:element name="Pan" type="c:Angle"/>
<xs:element name="Tilt" type="c:Angle" minOccurs="0"/><xs:choice><xs:element name="Speed" type="xs:int"/>
<xs:element name="Seconds" type="xs:decimal"/></xs:choice></xs:sequence></xs:complexType></xs:element>
<xs:element name="AbsoluteMoveResponse"><xs:complexType><xs:sequence/></xs:complexType></xs:element>
</xs:schema>"""


def operation(name: str, soap: str, action: str, more: str = "") -> str:
    """Return an operation of a binding."""
    body = f'<{soap}:body use="literal"{more}/>'
    return (
        f'<operation name="{name}"><{soap}:operation soapAction="{action}"/>'
        f"<input>{body}</input><output>{body}</output></operation>"
    )


def wsdl(name: str, types: str, messages: str, operations: str, soap: str, style: str, bound: str) -> str:
    """Return a WSDL with one port."""
    spaces = {"soap": "http://schemas.xmlsoap.org/wsdl/soap/", "soap12": "http://schemas.xmlsoap.org/wsdl/soap12/"}
    return (
        f'<definitions name="{name}" targetNamespace="urn:{name}" {_WSDL} {_XS} xmlns:c="urn:{name}" '
        f'xmlns:{soap}="{spaces[soap]}"><types>{types}</types>{messages}'
        f'<portType name="Port">{operations}</portType><binding name="Binding" type="c:Port">'
        f'<{soap}:binding style="{style}" transport="http://schemas.xmlsoap.org/soap/http"/>{bound}</binding>'
        f'<service name="{name}"><port name="{name}Port" binding="c:Binding">'
        f'<{soap}:address location="ADDRESS/{name}"/></port></service></definitions>'
    )


def abstract(*names: str) -> str:
    """Return operations of a port type."""
    return "".join(
        f'<operation name="{name}"><input message="c:{name}In"/><output message="c:{name}Out"/></operation>'
        for name in names
    )


def messages(*names: str) -> str:
    """Return the messages of operations."""
    return "".join(
        f'<message name="{name}In"><part name="body" element="c:{name}"/></message>'
        f'<message name="{name}Out"><part name="body" element="c:{name}Response"/></message>'
        for name in names
    )


CAMERA = wsdl(
    "camera",
    f'<xs:schema {_XS}><xs:import namespace="urn:camera" schemaLocation="camera.xsd"/></xs:schema>',
    messages("GetStatus", "AbsoluteMove"),
    abstract("GetStatus", "AbsoluteMove"),
    "soap",
    "document",
    "".join(operation(name, "soap", f"urn:camera/{name}") for name in ("GetStatus", "AbsoluteMove")),
)
_SCALE_XSD = f"""<xs:schema {_XS} targetNamespace="urn:scale"><xs:complexType name="Load"><xs:sequence>
<xs:element name="grams" type="xs:int"/><xs:element name="stable" type="xs:boolean"/></xs:sequence></xs:complexType>
</xs:schema>"""
SCALE = wsdl(
    "scale",
    _SCALE_XSD,
    '<message name="GetLoadIn"><part name="channel" type="xs:short"/><part name="unit" type="xs:string"/></message>'
    '<message name="GetLoadOut"><part name="load" type="c:Load"/></message>',
    abstract("GetLoad"),
    "soap",
    "rpc",
    operation("GetLoad", "soap", "urn:scale/load", ' namespace="urn:scale"'),
)
_TABLE_XSD = f"""<xs:schema {_XS} targetNamespace="urn:table" elementFormDefault="qualified">
<xs:element name="GetAngle"><xs:complexType><xs:sequence/></xs:complexType></xs:element>
<xs:element name="GetAngleResponse"><xs:complexType><xs:sequence><xs:element name="Angle" type="xs:float"/>
<xs:any namespace="##other" processContents="lax" minOccurs="0" maxOccurs="unbounded"/>
</xs:sequence></xs:complexType></xs:element></xs:schema>"""
TABLE = wsdl(
    "table", _TABLE_XSD, messages("GetAngle"), abstract("GetAngle"), "soap12", "document",
    operation("GetAngle", "soap12", "urn:table/GetAngle"),
)  # fmt: skip
_RPC = f"""<xs:schema {_XS} targetNamespace="urn:scale"><xs:element name="GetLoad"><xs:complexType><xs:sequence>
<xs:element name="channel" type="xs:short"/><xs:element name="unit" type="xs:string"/></xs:sequence></xs:complexType>
</xs:element></xs:schema>"""


@cache
def _schema(xsd: str) -> etree.XMLSchema:
    return etree.XMLSchema(etree.fromstring(xsd.encode()))


@dataclass
class Device:
    """One service.

    Attributes:
        name: of the WSDL's service, and of its path.
        wsdl, xsd: its documents; the schema validates requests.
        answers: XML of the Body of a success by the local name of the request.
        soap: namespace of its Envelope.
        secured: whether it wants a UsernameToken.
        alter: changes a response: takes request, status, media type and body, and returns the last three.
        seen: nonces.
        fails: whether something went wrong before.
    """

    name: str
    wsdl: str
    xsd: str
    answers: dict[str, str]
    soap: str = SOAP_11
    secured: bool = False
    alter: Callable[[bytes, int, str, bytes], tuple[int, str, bytes] | None] = lambda _, *answer: answer
    seen: set[str] = field(default_factory=set)

    def app(self, environ: dict[str, Any], start: Callable[..., Any]) -> list[bytes]:
        """Serve the WSDL, its schema and the service (WSGI)."""
        path, address = environ["PATH_INFO"], f"http://{environ['HTTP_HOST']}"
        if environ["REQUEST_METHOD"] == "GET":
            found = {f"/{self.name}.wsdl": self.wsdl.replace("ADDRESS", address), f"/{self.name}.xsd": self.xsd}
            text = found.get(path)
            start("200 OK" if text else "404 Not Found", [("Content-Type", "text/xml")])
            return [(text or "").encode()]
        length = int(environ.get("CONTENT_LENGTH") or 0)
        octets = environ["wsgi.input"].read(length)
        if len(octets) < length:
            raise ConnectionError("the client has gone")
        status, body = self.respond(octets)
        media_type = "text/xml; charset=utf-8" if self.soap == SOAP_11 else "application/soap+xml; charset=utf-8"
        altered = self.alter(octets, status, media_type, body)
        if altered is None:
            raise ConnectionError("the connection ends here")
        status, media_type, body = altered
        start(f"{status} {'OK' if status == 200 else 'Error'}", [("Content-Type", media_type)])
        return [body]

    def respond(self, octets: bytes) -> tuple[int, bytes]:
        """Return status and content of the response to a message."""
        try:
            root = etree.fromstring(octets, etree.XMLParser(resolve_entities=False, remove_comments=True))
        except etree.XMLSyntaxError:
            return self.fault("Client", "no XML")
        if problem := self._problem(root):
            return self.fault(*problem)
        body = root.find(f"{{{self.soap}}}Body")
        payload = body[0] if body is not None and len(body) else None
        name = etree.QName(payload).localname if payload is not None else ""
        if payload is None or not self.schema.validate(payload):
            return self.fault("Client", "not valid")
        inside = self.answer(name, payload)
        return self.fault("Client", "not known") if inside is None else (200, self.envelope(inside))

    @property
    def schema(self) -> etree.XMLSchema:
        """The schema that validates requests."""
        return _schema(self.xsd)

    def answer(self, name: str, _payload: Any) -> str | None:
        """Return XML of the Body of the response to a valid request; None: it is refused."""
        return self.answers.get(name)

    def _problem(self, root: Any) -> tuple[str, str] | None:
        """Return code and reason of the fault for a message that must not be processed."""
        if root.getroottree().docinfo.doctype:
            return "Client", "a DOCTYPE"
        if root.tag != f"{{{self.soap}}}Envelope":
            return "VersionMismatch", "another version"
        for block in root.iterfind(f"{{{self.soap}}}Header/*"):
            actor = block.get(f"{{{self.soap}}}actor") or block.get(f"{{{self.soap}}}role") or "/next"
            known = block.tag == f"{{{_SECURITY}}}Security" or not actor.endswith("/next")
            if block.get(f"{{{self.soap}}}mustUnderstand") in {"1", "true"} and not known:
                return "MustUnderstand", "not understood"
        return ("Client", "not authorised") if self.secured and not self._knows(root) else None

    def _knows(self, root: Any) -> bool:
        token = root.find(f".//{{{_SECURITY}}}UsernameToken")
        if token is None:
            return False
        text = {etree.QName(one).localname: (one.text or "") for one in token}
        nonce, created = base64.b64decode(text["Nonce"]), text["Created"]
        if text["Nonce"] in self.seen:
            return False
        self.seen.add(text["Nonce"])
        digest = hashlib.sha1(nonce + created.encode() + PASSWORD.encode(), usedforsecurity=False).digest()
        return text["Username"] == USER and base64.b64decode(text["Password"]) == digest

    def fault(self, code: str, reason: str) -> tuple[int, bytes]:
        """Return status and content of a fault, by its code in SOAP 1.1."""
        if self.soap == SOAP_11:
            fault = f"<s:Fault><faultcode>s:{code}</faultcode><faultstring>{reason}</faultstring></s:Fault>"
            return 500, self.envelope(fault)
        named = {"Client": "Sender"}.get(code, code)
        fault = (
            f"<s:Fault><s:Code><s:Value>s:{named}</s:Value></s:Code>"
            f'<s:Reason><s:Text xml:lang="en">{reason}</s:Text></s:Reason></s:Fault>'
        )
        return 400 if named == "Sender" else 500, self.envelope(fault)

    def envelope(self, inside: str) -> bytes:
        """Return a message."""
        return f'<s:Envelope xmlns:s="{self.soap}"><s:Body>{inside}</s:Body></s:Envelope>'.encode()


def camera() -> Device:
    """Return the camera."""
    status = (
        '<c:GetStatusResponse xmlns:c="urn:camera"><c:Position pan="0.5" tilt="-0.25"/><c:Moving>IDLE</c:Moving>'
        "<c:Time>2026-01-31T12:00:00Z</c:Time></c:GetStatusResponse>"
    )
    moved = '<c:AbsoluteMoveResponse xmlns:c="urn:camera"/>'
    return Device("camera", CAMERA, CAMERA_XSD, {"GetStatus": status, "AbsoluteMove": moved})


def scale() -> Device:
    """Return the scale, whose requests the wrapper's schema validates."""
    load = (
        '<c:GetLoadResponse xmlns:c="urn:scale"><load><grams>120</grams><stable>true</stable></load>'
        "</c:GetLoadResponse>"
    )
    return Device("scale", SCALE, _RPC, {"GetLoad": load})


def table() -> Device:
    """Return the turntable."""
    angle = (
        '<c:GetAngleResponse xmlns:c="urn:table"><c:Angle>1.5</c:Angle><x:More xmlns:x="urn:x"/></c:GetAngleResponse>'
    )
    return Device("table", TABLE, _TABLE_XSD, {"GetAngle": angle}, SOAP_12, secured=True)


class _Server(socketserver.ThreadingMixIn, WSGIServer):
    daemon_threads = True


class _Quiet(WSGIRequestHandler):
    def log_message(self, *_: Any) -> None:
        pass


@contextmanager
def serving(device: Device) -> Iterator[str]:
    """Serve a device; yield scheme, host and port."""
    server = make_server("127.0.0.1", 0, device.app, _Server, _Quiet)
    threading.Thread(target=server.serve_forever, args=(0.01,), daemon=True).start()
    yield f"http://127.0.0.1:{server.server_port}"
    server.shutdown()
    server.server_close()
