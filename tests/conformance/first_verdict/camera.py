"""A camera over SOAP, as ONVIF's are: PTZ, imaging with a session, events with WS-Addressing, snapshots by MTOM, rpc.

Each operation may be broken by itself.
"""

from collections.abc import Mapping

from aiohttp import web
from lxml import etree
from small_device import Handle

_S11, _S12 = "http://schemas.xmlsoap.org/soap/envelope/", "http://www.w3.org/2003/05/soap-envelope"
_TRUE, _HERE = {"1", "true"}, ("/next", "/ultimateReceiver", "next")
_WSA, _XOP = "http://www.w3.org/2005/08/addressing", "http://www.w3.org/2004/08/xop/include"
_XS = "http://www.w3.org/2001/XMLSchema"
_W = {"soap": "http://schemas.xmlsoap.org/wsdl/soap/", "soap12": "http://schemas.xmlsoap.org/wsdl/soap12/"}
_TYPES = (
    '<xs:schema xmlns:xs="{xs}" xmlns:t="urn:types" targetNamespace="urn:types" '
    'elementFormDefault="qualified">{}</xs:schema>'
)
_VECTOR = """<xs:complexType name="Vector"><xs:attribute name="x" type="t:Angle" use="required"/>
<xs:attribute name="y" type="t:Angle" use="required"/></xs:complexType>
<xs:complexType name="Preset"><xs:sequence><xs:element name="Name" type="xs:string" minOccurs="0" nillable="true"/>
<xs:element name="Position" type="t:Vector" minOccurs="0"/></xs:sequence>
<xs:attribute name="token" type="t:Token" use="required"/></xs:complexType>
<xs:complexType name="Shape" abstract="true"><xs:sequence><xs:element name="Label" type="xs:string"/></xs:sequence>
</xs:complexType><xs:complexType name="Circle"><xs:complexContent><xs:extension base="t:Shape"><xs:sequence>
<xs:element name="Radius" type="xs:double"/></xs:sequence></xs:extension></xs:complexContent></xs:complexType>"""
_CHAMELEON = f"""<xs:schema xmlns:xs="{_XS}"><xs:simpleType name="Angle"><xs:restriction base="xs:double">
<xs:minInclusive value="-1"/><xs:maxInclusive value="1"/></xs:restriction></xs:simpleType>
<xs:simpleType name="Token"><xs:restriction base="xs:string"><xs:maxLength value="64"/></xs:restriction></xs:simpleType>
</xs:schema>"""
_MODES = '<xs:simpleType name="Mode"><xs:restriction base="xs:string">{}</xs:restriction></xs:simpleType>'
_EMPTY = "<xs:complexType/>"
# Each operation: the content of its request and of its response, and what is answered.
_OPERATIONS = {
    "GetStatus": (
        "ptz",
        "",
        (
            '<xs:element name="Position" type="c:Vector"/><xs:element name="Mode" type="k:Mode"/>'
            '<xs:element name="UtcTime" type="xs:dateTime"/>'
            '<xs:any namespace="##other" processContents="lax" minOccurs="0"/>'
        ),
        (
            '<k:Position x="0.5" y="-0.25"/><k:Mode>IDLE</k:Mode><k:UtcTime>2026-01-31T12:00:00Z</k:UtcTime>'
            '<v:More xmlns:v="urn:vendor"><![CDATA[ok]]></v:More>'
        ),
    ),
    "GetPresets": (
        "ptz",
        "",
        '<xs:element name="Preset" type="c:Preset" minOccurs="0" maxOccurs="unbounded"/>',
        (
            '<k:Preset token="door"><c:Name>Door</c:Name><c:Position x="0" y="1"/></k:Preset>'
            '<!-- a second one --><k:Preset token="gate"><c:Name xsi:nil="true"/></k:Preset>'
        ),
    ),
    "DescribePreset": (
        "ptz",
        '<xs:element name="PresetToken" type="c:Token"/>',
        '<xs:element name="Preset" type="c:Preset"/>',
        '<k:Preset token="door"/>',
    ),
    "GetNodes": (
        "ptz",
        "",
        '<xs:element name="Shape" type="c:Shape" maxOccurs="unbounded"/>',
        '<k:Shape xsi:type="c:Circle"><c:Label>all</c:Label><c:Radius>INF</c:Radius></k:Shape>',
    ),
    "Stop": ("ptz", '<xs:element name="PanTilt" type="xs:boolean" minOccurs="0"/>', "", ""),
    "GetSettings": (
        "imaging",
        "",
        '<xs:element name="Brightness" type="xs:float"/>',
        "<k:Brightness>0.5</k:Brightness>",
    ),
    "GetEvents": ("events", "", '<xs:element name="Count" type="xs:unsignedInt"/>', "<k:Count>3</k:Count>"),
    "GetSnapshot": (
        "media",
        "",
        '<xs:element name="Image" type="xs:base64Binary"/>',
        f'<k:Image><xop:Include xmlns:xop="{_XOP}" href="cid:i%40camera"/></k:Image>',
    ),
}
_SPOKEN = {"ptz": "soap12", "imaging": "soap", "events": "soap12", "media": "soap"}
_FAULT_12 = (
    "<e:Fault><e:Code><e:Value>e:{}</e:Value><e:Subcode><e:Value xmlns:ter='urn:onvif-like'>ter:{}</e:Value>"
    '</e:Subcode></e:Code><e:Reason><e:Text xml:lang="en">{}</e:Text></e:Reason></e:Fault>'
)
_FAULT_11 = "<e:Fault><faultcode>e:{}</faultcode><faultstring>{}</faultstring></e:Fault>"


def _element(name: str, content: str) -> str:
    inside = f"<xs:complexType><xs:sequence>{content}</xs:sequence></xs:complexType>" if content else _EMPTY
    return f'<xs:element name="{name}">{inside}</xs:element>'


def _messages() -> str:
    declared = "".join(
        _element(name, asked) + _element(f"{name}Response", told) for name, (_, asked, told, _) in _OPERATIONS.items()
    )
    redefined = _MODES.format('<xs:enumeration value="IDLE"/>').replace("xs:string", "k:Mode")
    return (
        f'<xs:schema xmlns:xs="{_XS}" xmlns:k="urn:camera" xmlns:c="urn:types" targetNamespace="urn:camera" '
        'elementFormDefault="qualified"><xs:import namespace="urn:types" schemaLocation="../x/./types.xsd"/>'
        f'<xs:redefine schemaLocation="modes.xsd">{redefined}</xs:redefine>'
        f'{declared}{_element("Session", """<xs:element name="id" type="xs:int"/>""")}</xs:schema>'
    )


def _port(name: str) -> tuple[str, str, str]:
    """Return port type, binding and port of a service."""
    prefix, own = _SPOKEN[name], [each for each, (port, *_) in _OPERATIONS.items() if port == name]
    abstract = "".join(
        f'<w:operation name="{one}"><w:input message="k:{one}In"/><w:output message="k:{one}Out"/></w:operation>'
        for one in own
    )
    header = '<soap:header message="k:Header" part="session" use="literal"/>' if name == "imaging" else ""
    bound = "".join(
        f'<w:operation name="{one}"><{prefix}:operation soapAction="urn:camera/{one}"/><w:input><{prefix}:body '
        f'use="literal"/>{header}</w:input><w:output><{prefix}:body use="literal"/></w:output></w:operation>'
        for one in own
    )
    if name == "imaging":
        bound = (
            f'<w:operation name="GetGain"><soap:operation style="rpc" soapAction="urn:camera/GetGain"/><w:input>'
            f'<soap:body use="literal" namespace="urn:camera"/>{header}</w:input><w:output><soap:body use="literal" '
            f'namespace="urn:camera"/></w:output></w:operation>{bound}'
        )
        abstract += (
            '<w:operation name="GetGain"><w:input message="k:GainIn"/><w:output message="k:GainOut"/></w:operation>'
        )
    mark = '<wsaw:UsingAddressing w:required="true"/>' if name == "events" else ""
    return (
        f'<w:portType name="{name}Type">{abstract}</w:portType>',
        (
            f'<w:binding name="{name}Binding" type="k:{name}Type">{mark}<{prefix}:binding style="document" '
            f'transport="http://schemas.xmlsoap.org/soap/http"/>{bound}</w:binding>'
        ),
        f'<w:port name="{name}" binding="k:{name}Binding"><{prefix}:address location="BASE/{name}"/></w:port>',
    )


def _wsdl() -> str:
    spaces = " ".join(f'xmlns:{prefix}="{space}"' for prefix, space in _W.items())
    messages = "".join(
        f'<w:message name="{name}In"><w:part name="body" element="k:{name}"/></w:message>'
        f'<w:message name="{name}Out"><w:part name="body" element="k:{name}Response"/></w:message>'
        for name in _OPERATIONS
    )
    types, bindings, ports = zip(*map(_port, _SPOKEN), strict=True)
    return (
        f'<w:definitions xmlns:w="http://schemas.xmlsoap.org/wsdl/" {spaces} xmlns:k="urn:camera" xmlns:xs="{_XS}" '
        'xmlns:wsaw="http://www.w3.org/2006/05/addressing/wsdl" targetNamespace="urn:camera" name="Camera"><w:types>'
        f'{_messages()}</w:types>{messages}<w:message name="Header"><w:part name="session" element="k:Session"/>'
        '</w:message><w:message name="GainIn"><w:part name="channel" type="xs:short"/></w:message>'
        f'<w:message name="GainOut"><w:part name="gain" type="xs:double"/></w:message>{"".join(types)}'
        f'{"".join(bindings)}<w:service name="Camera">{"".join(ports)}</w:service></w:definitions>'
    )


FILES = {
    "/a/camera.wsdl": _wsdl(),
    "/x/types.xsd": _TYPES.format('<xs:include schemaLocation="angles.xsd"/>' + _VECTOR, xs=_XS),
    "/x/angles.xsd": _CHAMELEON,
    "/a/modes.xsd": _TYPES.format(
        _MODES.format("".join(f'<xs:enumeration value="{one}"/>' for one in ("IDLE", "MOVING", "UNKNOWN"))), xs=_XS
    ).replace("urn:types", "urn:camera"),
}
_ASKED = {
    name: etree.XMLSchema(
        etree.fromstring(
            f'<xs:schema xmlns:xs="{_XS}" xmlns:c="urn:camera" targetNamespace="urn:camera" '
            f'elementFormDefault="qualified">{_element(name, asked.replace("c:Token", "xs:string"))}</xs:schema>'
        )
    )
    for name, (_, asked, _, _) in _OPERATIONS.items()
}
_ANSWERS = {name: told for name, (*_, told) in _OPERATIONS.items()}


class Camera:
    """The camera; ``broken`` has other texts of answers, by operation, and ``media_type`` is that of all."""

    def __init__(self, broken: Mapping[str, str] | None = None, media_type: str = "") -> None:
        self._answers = {**_ANSWERS, **(broken or {})}
        self._media_type = media_type

    @property
    def routes(self) -> dict[str, dict[str, Handle]]:
        """The handlers of its paths."""
        return {
            **{path: {"GET": _file(text)} for path, text in FILES.items()},
            **{f"/{name}": {"POST": self._service(name)} for name in _SPOKEN},
        }

    def _service(self, name: str) -> Handle:
        space = _S12 if _SPOKEN[name] == "soap12" else _S11

        async def handle(request: web.Request) -> web.Response:
            if request.content_type != ("application/soap+xml" if space == _S12 else "text/xml"):
                return web.Response(status=415)
            status, inside = self._answered(name, space, await request.read())
            if "closed" in inside and request.transport is not None:
                request.transport.close()
            packaged = name == "media" and status == 200
            answer = _message(space, status, inside, packaged=packaged)
            if self._media_type and not packaged:
                answer.headers["Content-Type"] = self._media_type
            return answer

        return handle

    def _answered(self, name: str, space: str, octets: bytes) -> tuple[int, str]:
        """Return the status and the content of the Body for a message."""
        try:
            root = etree.fromstring(octets, etree.XMLParser(resolve_entities=False))
        except etree.XMLSyntaxError:
            return _fault(space, "Client", "no XML")
        headers = root.findall(f"{{{space}}}Header/*")
        known = {"imaging": "{urn:camera}Session", "events": f"{{{_WSA}}}Action"}.get(name)
        # A block for another node is none of this one's business (SOAP 1.1, 4.2.2; SOAP 1.2 Part 1, 2.4).
        own = [
            one
            for one in headers
            if all(one.get(f"{{{space}}}{role}", "next").endswith(_HERE) for role in ("actor", "role"))
        ]
        foreign = [one for one in own if etree.QName(one).namespace not in {_WSA, "urn:camera"}]
        body = root.find(f"{{{space}}}Body")
        refusals = {
            "a DOCTYPE": ("Client", root.getroottree().docinfo.doctype),
            "a version": ("VersionMismatch", root.tag != f"{{{space}}}Envelope"),
            "a header": ("MustUnderstand", any(one.get(f"{{{space}}}mustUnderstand") in _TRUE for one in foreign)),
            "a header is missing": ("Client", known and known not in [one.tag for one in headers]),
            "no body": ("Client", body is None or len(body) != 1),
        }
        for why, (code, refused) in refusals.items():
            if refused:
                return _fault(space, code, why)
        return self._called(name, space, body[0])

    def _called(self, name: str, space: str, payload: etree._Element) -> tuple[int, str]:
        operation = etree.QName(payload).localname
        if name == "imaging" and operation == "GetGain":
            channel = payload.findtext("channel") or ""
            right = channel.strip().lstrip("-+").isdigit() and len(payload) == 1 and abs(int(channel)) < 2**15
            return (
                (200, "<k:GetGainResponse><gain>1.5</gain></k:GetGainResponse>")
                if right
                else _fault(space, "Client", "?")
            )
        if _OPERATIONS.get(operation, ("",))[0] != name:
            return _fault(space, "Client", "ActionNotSupported")
        alone = etree.fromstring(etree.tostring(payload, with_tail=False))
        if not _ASKED[operation].validate(alone):
            return _fault(space, "Client", "not well-formed by the schema")
        if operation == "DescribePreset" and payload[0].text not in {"door", "gate"}:
            return _fault(space, "Client", "no such preset")
        told = self._answers[operation]
        if told.startswith("fault"):
            return _fault(space, "Server", told)
        return 200, told if told.startswith("<z:") else f"<k:{operation}Response>{told}</k:{operation}Response>"


def _file(text: str) -> Handle:
    async def handle(request: web.Request) -> web.Response:
        return web.Response(text=text.replace("BASE", f"http://{request.host}"), content_type="text/xml")

    return handle


def _fault(space: str, code: str, reason: str) -> tuple[int, str]:
    if space == _S11:
        return 500, _FAULT_11.format(code, reason)
    named = {"Client": "Sender", "Server": "Receiver"}.get(code, code)
    return 400 if named == "Sender" else 500, _FAULT_12.format(named, "InvalidArgVal", reason)


def _message(space: str, status: int, inside: str, *, packaged: bool) -> web.Response:
    media_type = "application/soap+xml" if space == _S12 else "text/xml"
    spaces = 'xmlns:k="urn:camera" xmlns:c="urn:types" xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance"'
    text = f'<e:Envelope xmlns:e="{space}" {spaces}>\n <e:Body>{inside}</e:Body>\n</e:Envelope>\n'
    # One of the two is in UTF-16, as some gateways write it.
    charset = "utf-16" if space == _S11 and not packaged else "utf-8"
    octets = f'<?xml version="1.0" encoding="{charset}"?>\n{text}'.encode(charset)
    if not packaged:
        return web.Response(status=status, body=octets, headers={"Content-Type": f"{media_type}; charset={charset}"})
    root = (
        f'Content-Type: application/xop+xml; charset=utf-8; type="{media_type}"\r\nContent-ID: <root>\r\n\r\n'.encode()
    )
    image = (
        b"Content-Type: image/png\r\nContent-Transfer-Encoding: binary\r\nContent-ID: <i@camera>\r\n\r\n\x89PNG\r\n\x00"
    )
    whole = b"\r\n".join((b"--b1", root + octets, b"--b1", image, b"--b1--", b""))
    how = f'multipart/related; boundary="b1"; type="application/xop+xml"; start="<root>"; start-info="{media_type}"'
    return web.Response(body=whole, headers={"Content-Type": how})
