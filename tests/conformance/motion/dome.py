"""A simulated camera on a dome that pans and tilts, over SOAP 1.2 with a UsernameToken; its API is like ONVIF's PTZ."""

import datetime as dt
from typing import Any

from body import Body
from lxml import etree
from soap_devices import PASSWORD, SOAP_12, USER, Device, abstract, messages, operation, wsdl

from conformance.documents.wsdl import read_services
from conformance.scenarios.described_messages import DescribedMessages
from conformance.transport.credentials import UsernameToken

LIMITS = {"pan": (-1.0, 1.0), "tilt": (-0.5, 0.5)}
# How fast it moves to a position, and at velocity 1, per second; so long after a velocity it moves on, s.
SPEED, FULL_SPEED, HOLD_S = 4.0, 0.5, 0.5
MAP = f"""
[values]
Camera = ["main"]

[motion.state]
read = "POST /domePort/GetStatus"
stamp = "/Status/Time"
fresh_s = 0.3

[motion.state.axes]
pan = {{ at = "/Status/Position/@pan", limits = [-1, 1], speed = 6 }}
tilt = {{ at = "/Status/Position/@tilt", limits = [-0.5, 0.5], speed = 6 }}

[motion.goto]
send = "POST /domePort/AbsoluteMove"
body = {{ Camera = "main", Position = {{ "@pan" = "{{pan}}", "@tilt" = "{{tilt}}" }} }}
within_s = 0.6
settle_s = 0.2
tolerance = 0.03
beyond_limits = "refused"

[motion.velocity]
send = "POST /domePort/ContinuousMove"
body = {{ Camera = "main", Velocity = {{ "@pan" = "{{pan}}", "@tilt" = "{{tilt}}" }}, Timeout = "PT{HOLD_S}S" }}
tolerance = 0.15
settle_s = 0.2
hold_s = {HOLD_S}
beyond_limits = "refused"

[motion.velocity.axes]
pan = {{ limits = [-1, 1], of = "pan", scale = {FULL_SPEED} }}
tilt = {{ limits = [-1, 1], of = "tilt", scale = {FULL_SPEED} }}

[motion.stop]
send = "POST /domePort/Stop"
rests_within_s = 0.3
"""
_NAMES = ("GetStatus", "AbsoluteMove", "ContinuousMove", "Stop")


def _pair(name: str, pan: str, tilt: str) -> str:
    return (
        f'<xs:element name="{name}"><xs:complexType><xs:attribute name="pan" type="c:{pan}" use="required"/>'
        f'<xs:attribute name="tilt" type="c:{tilt}" use="required"/></xs:complexType></xs:element>'
    )


def _range(name: str, least: float, greatest: float) -> str:
    return (
        f'<xs:simpleType name="{name}"><xs:restriction base="xs:double"><xs:minInclusive value="{least}"/>'
        f'<xs:maxInclusive value="{greatest}"/></xs:restriction></xs:simpleType>'
    )


def _message(name: str, inside: str = "") -> str:
    return (
        f'<xs:element name="{name}"><xs:complexType><xs:sequence>{inside}</xs:sequence></xs:complexType></xs:element>'
    )


_CAMERA = '<xs:element name="Camera" type="xs:token"/>'
_SCHEMA = (
    '<xs:schema xmlns:xs="http://www.w3.org/2001/XMLSchema" targetNamespace="urn:dome" xmlns:c="urn:dome" '
    'elementFormDefault="qualified">'
    + _range("Pan", *LIMITS["pan"])
    + _range("Tilt", *LIMITS["tilt"])
    + _range("Speed", -1, 1)
    + '<xs:simpleType name="Any"><xs:restriction base="xs:double"/></xs:simpleType>'
    + _message("GetStatus", _CAMERA)
    + _message(
        "GetStatusResponse",
        _message("Status", _pair("Position", "Any", "Any") + '<xs:element name="Time" type="xs:dateTime"/>'),
    )
    + _message("AbsoluteMove", _CAMERA + _pair("Position", "Pan", "Tilt"))
    + _message(
        "ContinuousMove",
        _CAMERA + _pair("Velocity", "Speed", "Speed") + '<xs:element name="Timeout" type="xs:duration" minOccurs="0"/>',
    )
    + _message("Stop", _CAMERA)
    + "".join(_message(f"{name}Response") for name in _NAMES[1:])
    + "</xs:schema>"
)
_WSDL = wsdl(
    "dome", _SCHEMA, messages(*_NAMES), abstract(*_NAMES), "soap12", "document",
    "".join(operation(name, "soap12", f"urn:dome/{name}") for name in _NAMES),
)  # fmt: skip


def messages_of() -> DescribedMessages:
    """Return what makes the camera's messages, without HTTP."""
    found = read_services(_WSDL.replace("ADDRESS", "http://dome").encode(), "dome.wsdl", lambda _: b"")
    return DescribedMessages(found, {"Camera": ("main",)}, UsernameToken(USER, PASSWORD))


class Dome(Device):
    """The camera; ``body``: the mechanics, None: right ones."""

    def __init__(self, body: Body | None = None) -> None:
        super().__init__("dome", _WSDL, _SCHEMA, {}, SOAP_12, secured=True)
        self.body = body or Body(LIMITS)

    def answer(self, name: str, payload: Any) -> str | None:
        """Return XML of the Body of the response to a valid request; None: another camera is meant."""
        if payload.findtext("{*}Camera") != "main":
            return None
        if name == "GetStatus":
            return f'<c:GetStatusResponse xmlns:c="urn:dome">{self._status()}</c:GetStatusResponse>'
        self._move(name, payload)
        return f'<c:{name}Response xmlns:c="urn:dome"/>'

    def _status(self) -> str:
        time = dt.datetime.fromtimestamp(self.body.stamp(self.body.now()), dt.UTC).isoformat()
        here = " ".join(f'{axis}="{value}"' for axis, value in self.body.told().items())
        return f"<c:Status><c:Position {here}/><c:Time>{time}</c:Time></c:Status>"

    def _move(self, name: str, payload: etree._Element) -> None:
        now = self.body.now()
        if name == "Stop":
            self.body.halt(now)
            return
        given = {axis: float(payload[1].get(axis, "0")) for axis in LIMITS}
        if name == "AbsoluteMove":
            here = self.body.at(now)
            self.body.go(given, max(abs(given[axis] - here[axis]) for axis in given) / SPEED)
        else:
            self.body.drive({axis: FULL_SPEED * value for axis, value in given.items()}, HOLD_S, now)
