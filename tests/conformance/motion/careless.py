"""The simulated arm, asked what must move nothing and by several clients at once; right, or careless in one way."""

import math
from unittest.mock import patch

import simulated
from arm import MAP, Arm
from body import Body
from driven_device import SimulatedClock

from conformance.scenarios.motion import attempts, several
from conformance.scenarios.motion.mapped import MappedDevice
from conformance.transport.exchange import Exchange, Request, Response
from conformance.verdict.effort import Effort
from conformance.verdict.run import Run

_AWAY = {"pan": 0.4, "tilt": 0.3}


class _Api(simulated.Api):
    """Wants credentials; ``careless``: what moves it all the same, "" for a right one."""

    careless = ""

    def send(self, method, path, *, headers=(), body=b"", authorized=True, **_):
        if not authorized:
            self._slip("unauthorised")
            return Exchange(Request(method, path, headers, body), Response(401, (), b"{}", 2.0))
        found = super().send(method, path, headers=headers, body=body)
        if not found.response.ok:
            self._slip("refused")
        return found

    def cut_off(self):
        """Hear a request whose client vanishes."""
        self._slip("incomplete")

    def _slip(self, what):
        if self.careless == what:
            self.device.body.aim(_AWAY, 0.5, self.clock.now())


class _Cut:
    """Stands for a request of which some bytes are missing."""

    def __init__(self, client, *_, **__):
        self._client = client

    def vanish(self, **_):
        self._client.cut_off()


class _Binding(simulated.Binding):
    has_credentials = True


def played(careless, sway=0.0, phase=0.0):
    """Return what the arm is recorded to do, and its map: by the name of the scenario.

    Args:
        careless: refused, incomplete or unauthorised requests that move it, or "mixes" for targets of two clients; ""
            for a right one.
        sway: how far to each side of its place the arm says that it is, in turn, rad; phase: at first, rad.
    """
    clock = SimulatedClock()
    body = Body(simulated.LIMITS, clock.now, clock.sleep)
    body.said = lambda now: {name: value + sway * math.sin(2.5 * now + phase) for name, value in body.at(now).items()}
    arm = Arm(body, fault=careless)
    api = _Api(arm, clock, lambda: 0.002)
    api.careless = careless
    motion = simulated.map_of(MAP)
    device = MappedDevice(api, motion, clock, _Binding(api))

    with (
        patch.object(attempts, "PartialRequest", _Cut),
        patch.object(several, "send_together", simulated.one_after_another),
    ):
        found = {
            "attempts_at_rest": attempts.attempts_at_rest.play(mapped=device),
            "several_clients": several.several_clients.play(mapped=device, effort=Effort("quick")),
        }
    return found, {"mapped": device, "run": Run(), "motion": motion}
