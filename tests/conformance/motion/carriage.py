"""A simulated carriage: its heading is a quaternion, and it takes a velocity in several ways; right or with a fault."""

import json
import math
from typing import Any
from urllib.parse import parse_qsl

from body import Body
from lxml import etree

HOLD_S, FASTEST = 0.6, {"x": 0.5, "heading": 1.5}
LIMITS = {"x": (-2.0, 2.0), "heading": (-math.inf, math.inf)}
MAP = f"""
[motion.state]
read = "GET /odometry"
agrees = {{ "GET /compass" = {{ heading = "" }} }}

[motion.state.axes]
x = {{ at = "/x", limits = [-2, 2] }}
heading = {{ at = "/orientation", angle = "yaw", limits = [-3, 3], unit = "rad" }}

[motion.goto]
send = "PUT /goal"
body = {{ x = "{{x}}", orientation = {{ x = 0.0, y = 0.0, z = "{{heading:/z}}", w = "{{heading:/w}}" }} }}
tolerance = 0.05
within_s = 3.0

[motion.stop]
send = "DELETE /goal"

[motion.velocity]
send = "PUT /velocity"
body = {{ ahead = "{{ahead}}", turn = "{{turn}}" }}
tolerance = 0.06
settle_s = 0.2
hold_s = {HOLD_S}
beyond_limits = "refused"

[motion.velocity.axes]
ahead = {{ limits = [-{FASTEST["x"]}, {FASTEST["x"]}], of = "x" }}
turn = {{ limits = [-{FASTEST["heading"]}, {FASTEST["heading"]}], of = "heading" }}

[[motion.velocity.ways]]
send = "PUT /velocity"
body = {{ ahead = "{{ahead}}", turn = "{{turn}}" }}
media_type = "application/xml"
root = "velocity"

[[motion.velocity.ways]]
send = "PUT /velocity"
body = {{ ahead = "{{ahead}}", turn = "{{turn}}" }}
media_type = "application/x-www-form-urlencoded"

[[motion.velocity.ways]]
send = "PUT /velocity/ahead/{{ahead}}"
"""
#: What is wrong with a carriage.
FAULTS = (
    "heading-mirrored", "compass-elsewhere", "xml-lost", "xml-without-turn", "form-halved", "xml-runs-on", "form-short",
    "ahead-lost", "ahead-stops-turning", "ahead-runs-on",
)  # fmt: skip


def _quaternion(yaw: float) -> dict[str, float]:
    return {"x": 0.0, "y": 0.0, "z": math.sin(yaw / 2), "w": math.cos(yaw / 2)}


class Carriage:
    """The carriage's API before its body, with a fault of FAULTS, or right."""

    def __init__(self, body: Body, fault: str = "") -> None:
        self.body, self.fault = body, fault

    def answer(self, method: str, path: str, octets: bytes) -> tuple[int, Any]:
        """Return status and JSON of the response to a request."""
        now = self.body.now()
        if method == "GET":
            return 200, self._told(path)
        if path == "/goal":
            if method == "DELETE":
                self.body.halt(now)
                return 200, {}
            return self._go(json.loads(octets))
        if path == "/velocity":
            form, wanted = _read(octets)
            return self._drive(form, wanted, now)
        driven = {} if self.fault == "ahead-stops-turning" else {"turn": self.body.velocity(now)["heading"]}
        return self._drive("ahead", {"turn": 0.0, **driven, "ahead": float(path.rpartition("/")[2])}, now)

    def _told(self, path: str) -> Any:
        here = self.body.told()
        turned = _quaternion(here["heading"] + (0.5 if (path, self.fault) == ("/compass", "compass-elsewhere") else 0))
        # A quaternion and its negative are one heading.
        turned = {name: -value for name, value in turned.items()} if here["x"] > 0 else turned
        return list(turned.values()) if path == "/compass" else {"x": here["x"], "orientation": turned}

    def _go(self, goal: dict[str, Any]) -> tuple[int, Any]:
        turned = goal["orientation"]
        yaw = 2 * math.atan2(turned["z"], turned["w"]) * (-1 if self.fault == "heading-mirrored" else 1)
        here = self.body.at(self.body.now())
        way = math.remainder(yaw - here["heading"], math.tau)
        self.body.go({"x": goal["x"], "heading": here["heading"] + way}, max(abs(goal["x"] - here["x"]), abs(way)) / 3)
        return 200, {}

    def _drive(self, form: str, wanted: dict[str, float], now: float) -> tuple[int, Any]:
        speeds = {"x": wanted["ahead"], "heading": wanted["turn"]}
        if any(isinstance(speed, str) or abs(speed) > FASTEST[name] for name, speed in speeds.items()):
            return 422, {}
        what = self.fault.removeprefix(f"{form}-") if self.fault.startswith(f"{form}-") else ""
        speeds["heading"] *= what != "without-turn"
        speeds = {name: speed / (2 if what == "halved" else 1) for name, speed in speeds.items()}
        if what != "lost":
            self.body.drive(speeds, HOLD_S * {"runs-on": 5, "short": 0.2}.get(what, 1), now)
        return 200, {}


def _read(octets: bytes) -> tuple[str, dict[str, float]]:
    """Return the form of a velocity, and its parts."""
    if octets.startswith(b"<"):
        return "xml", {str(one.tag): float(one.text or "") for one in etree.fromstring(octets)}
    if octets.startswith(b"{"):
        return "json", json.loads(octets)
    return "form", {name: float(value) for name, value in parse_qsl(octets.decode())}
