"""A winch over SOAP that turns at the last speed it was given, with a fault from its first move on."""

import threading
import time
from typing import Any, Final

import moving_cart
from soap_devices import Device, abstract, messages, operation, wsdl

_NAMES: Final = ("GetState", "Drive", "Stop")
MAP = moving_cart.MAP.replace('"/x"', '"/X"').replace('{ ahead = "{', '{ Ahead = "{')
for _way, _name in (("GET /state", "GetState"), ("PUT /velocity", "Drive"), ("POST /stop", "Stop")):
    MAP = MAP.replace(_way, f"POST /winchPort/{_name}")


def _message(name: str, inside: str = "") -> str:
    return (
        f'<xs:element name="{name}"><xs:complexType><xs:sequence>{inside}</xs:sequence></xs:complexType></xs:element>'
    )


_SCHEMA: Final = (
    '<xs:schema xmlns:xs="http://www.w3.org/2001/XMLSchema" targetNamespace="urn:winch" elementFormDefault="qualified">'
    + _message("GetState")
    + _message("GetStateResponse", '<xs:element name="X" type="xs:double"/>')
    + _message("Drive", '<xs:element name="Ahead" type="xs:double"/>')
    + _message("Stop")
    + "".join(_message(f"{name}Response") for name in _NAMES[1:])
    + "</xs:schema>"
)
_WSDL: Final = wsdl(
    "winch", _SCHEMA, messages(*_NAMES), abstract(*_NAMES), "soap", "document",
    "".join(operation(name, "soap", f"urn:winch/{name}") for name in _NAMES),
)  # fmt: skip


class Winch(Device):
    """The winch.

    Args:
        fault: "silent", "refuses", "ignores", or another word for none.
    """

    def __init__(self, fault: str) -> None:
        super().__init__("winch", _WSDL, _SCHEMA, {})
        self._fault, self._gone = fault, threading.Event()
        self._speed, self._x, self._since = 0.0, 0.0, time.monotonic()

    def answer(self, name: str, payload: Any) -> str | None:
        """Return XML of the Body of the response; None: the request is refused with a fault."""
        now = time.monotonic()
        self._x, self._since = self._x + self._speed * (now - self._since), now
        if self._speed and self._fault == "silent":
            self._gone.wait(60)
        if name != "GetState" and self._speed and self._fault == "refuses":
            return None
        if name == "Stop" and self._fault != "ignores":
            self._speed = 0.0
        if name == "Drive" and not (self._speed and self._fault == "ignores"):
            self._speed = float(payload.findtext("{*}Ahead"))
        inside = f"<c:X>{self._x}</c:X>" if name == "GetState" else ""
        return f'<c:{name}Response xmlns:c="urn:winch">{inside}</c:{name}Response>'
