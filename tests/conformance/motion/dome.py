"""A simulated camera on a dome that pans and tilts by ONVIF's PTZ service: SOAP 1.2 with a UsernameToken."""

import datetime as dt
from functools import cached_property
from pathlib import Path
from typing import Any

from body import Body
from lxml import etree
from soap_devices import PASSWORD, SOAP_12, USER, Device

from conformance.documents.wsdl import read_services
from conformance.scenarios.described_messages import DescribedMessages
from conformance.transport.credentials import UsernameToken

LIMITS = {"pan": (-1.0, 1.0), "tilt": (-0.5, 0.5)}
_XS, _PTZ = "http://www.w3.org/2001/XMLSchema", "http://www.onvif.org/ver20/ptz/wsdl"
_ONVIF = "http://www.onvif.org/ver10/schema"
# What noise and floating point may add to a way that ends at a limit.
_ROUNDED = 0.02
# How fast it moves to a position, and at velocity 1, per second; so long after a velocity it moves on, s.
SPEED, FULL_SPEED, HOLD_S = 4.0, 0.5, 0.5
MAP = f"""
[values]
ProfileToken = ["main"]

[motion.state]
read = "POST /PTZPort/GetStatus"
stamp = "/PTZStatus/UtcTime"
fresh_s = 0.3

[motion.state.axes]
pan = {{ at = "/PTZStatus/Position/PanTilt/@x", limits = [-1, 1], speed = 6 }}
tilt = {{ at = "/PTZStatus/Position/PanTilt/@y", limits = [-0.5, 0.5], speed = 6 }}

[motion.goto]
send = "POST /PTZPort/AbsoluteMove"
body = {{ ProfileToken = "main", Position = {{ PanTilt = {{ "@x" = "{{pan}}", "@y" = "{{tilt}}" }} }} }}
within_s = 0.6
settle_s = 0.2
tolerance = 0.03
beyond_limits = "refused"
while_moving = "displaces"

[motion.velocity]
send = "POST /PTZPort/ContinuousMove"
tolerance = 0.15
settle_s = 0.2
hold_s = {HOLD_S}
beyond_limits = "refused"

[motion.velocity.body]
ProfileToken = "main"
Timeout = "PT{HOLD_S}S"
Velocity = {{ PanTilt = {{ "@x" = "{{pan}}", "@y" = "{{tilt}}" }} }}

[motion.velocity.axes]
pan = {{ limits = [-1, 1], of = "pan", scale = {FULL_SPEED} }}
tilt = {{ limits = [-1, 1], of = "tilt", scale = {FULL_SPEED} }}

[motion.stop]
send = "POST /PTZPort/Stop"
body = {{ ProfileToken = "main", PanTilt = true, Zoom = true }}
rests_within_s = 0.3
"""
#: The same with the way from where it is, in place of the position.
RELATIVE = (
    MAP.replace("AbsoluteMove", "RelativeMove")
    .replace("Position = {", "Translation = {")
    .replace(
        'beyond_limits = "refused"\nwhile_moving = "displaces"\n\n[motion.velocity]',
        "relative = true\n\n[motion.velocity]",
    )
)
_DATA = Path(__file__).parent / "data"
_WSDL, _TYPES = ((_DATA / name).read_text(encoding="utf-8") for name in ("ptz.wsdl", "onvif.xsd"))


def messages_of() -> DescribedMessages:
    """Return what makes the camera's messages, without HTTP."""
    found = read_services(_WSDL.replace("ADDRESS", "http://dome").encode(), "ptz.wsdl", lambda _: _TYPES.encode())
    return DescribedMessages(found, {"ProfileToken": ("main",)}, UsernameToken(USER, PASSWORD))


class Dome(Device):
    """The camera; ``body``: the mechanics, None: right ones."""

    def __init__(self, body: Body | None = None) -> None:
        super().__init__("onvif", _WSDL, _TYPES, {}, SOAP_12, secured=True)
        self.body = body or Body(LIMITS)

    @cached_property
    def schema(self) -> etree.XMLSchema:
        """The schema of the messages, which the WSDL holds."""
        inside = etree.fromstring(_WSDL.encode(), base_url=str(_DATA / "ptz.wsdl")).find(f".//{{{_XS}}}schema")
        return etree.XMLSchema(inside)

    def answer(self, name: str, payload: Any) -> str | None:
        """Return XML of the Body of the response to a valid request; None: another profile, or beyond its limits."""
        if payload.findtext("{*}ProfileToken") != "main":
            return None
        if name == "GetStatus":
            return f'<t:GetStatusResponse xmlns:t="{_PTZ}">{self._status()}</t:GetStatusResponse>'
        return f'<t:{name}Response xmlns:t="{_PTZ}"/>' if self._moves(name, payload) else None

    def _status(self) -> str:
        time = dt.datetime.fromtimestamp(self.body.stamp(self.body.now()), dt.UTC).isoformat()
        here = self.body.told()
        return (
            f'<t:PTZStatus xmlns:o="{_ONVIF}"><o:Position>'
            f'<o:PanTilt x="{here["pan"]}" y="{here["tilt"]}"/></o:Position>'
            f"<o:UtcTime>{time}</o:UtcTime></t:PTZStatus>"
        )

    def _moves(self, name: str, payload: etree._Element) -> bool:
        now = self.body.now()
        if name == "Stop":
            self.body.halt(now)
            return True
        vector = payload[1].find("{*}PanTilt")
        given = {axis: float(vector.get(one)) for axis, one in zip(LIMITS, "xy", strict=True)}
        here = self.body.at(now)
        if name == "RelativeMove":
            given = {axis: here[axis] + way for axis, way in given.items()}
        limits = dict.fromkeys(LIMITS, (-1.0, 1.0)) if name == "ContinuousMove" else LIMITS
        if not all(least - _ROUNDED <= given[axis] <= most + _ROUNDED for axis, (least, most) in limits.items()):
            return False
        if name == "ContinuousMove":
            self.body.drive({axis: FULL_SPEED * value for axis, value in given.items()}, HOLD_S, now)
        else:
            self.body.go(given, max(abs(given[axis] - here[axis]) for axis in given) / SPEED)
        return True
