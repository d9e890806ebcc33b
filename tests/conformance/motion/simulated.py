"""Simulated devices whose moves are recorded and judged by a simulated clock: without HTTP, in no time."""

import tomllib
from functools import partial
from unittest.mock import patch

import dome
import msgspec
import mutants
import rover
from arm import LIMITS, MAP, Arm
from body import Body
from dome import Dome
from driven_device import SimulatedClock
from rover import Rover

from conformance.rules.motion import test_motion, test_motion_attempts, test_states, test_velocities
from conformance.scenarios.motion import moves, several, states, velocities
from conformance.scenarios.motion.binding import JsonBinding, SoapBinding
from conformance.scenarios.motion.mapped import MappedDevice
from conformance.scenarios.rule import Rule
from conformance.scenarios.scenario import NotPossibleError, PartialTraceError
from conformance.statement.motion_map import MotionMap
from conformance.transport.exchange import Exchange, Request, Response
from conformance.verdict.effort import Effort
from conformance.verdict.evidence import Case
from conformance.verdict.run import Run

_PLAYED = (
    moves.targets, moves.clamped_targets, moves.stops, moves.new_targets, moves.many_commands, moves.repeated,
    velocities.velocities, velocities.let_go, states.agreement, states.switched, several.several_clients,
    several.several_drivers,
)  # fmt: skip
RULES = [
    one
    for module in (test_motion, test_motion_attempts, test_velocities, test_states)
    for one in vars(module).values()
    if isinstance(one, Rule)
]
_RELATIVE = MAP.replace('beyond_limits = "refused"', "relative = true")
DEVICES = {
    "arm": (Arm, LIMITS, MAP),
    "rover": (Rover, rover.LIMITS, rover.MAP),
    "relative": (partial(Arm, relative=True), LIMITS, _RELATIVE),
    "dome": (Dome, dome.LIMITS, dome.MAP),
}
# A move that is relative begins where the last one ended, and none is sent under way.
MUTANTS = {
    "arm": mutants.of_arm(),
    "rover": mutants.of_rover(),
    "dome": mutants.of_dome(),
    "relative": {name: change for name, change in mutants.of_arm().items() if not name.startswith("second")},
}


class Api:
    """A device without HTTP: a request takes some simulated time each way."""

    def __init__(self, device, clock, takes_s):
        self.device, self.clock, self.client, self.takes_s = device, clock, self, takes_s
        self.stop_device = self.preparation = None

    def send(self, method, path, *, headers=(), body=b"", **_):
        self.clock.sleep(self.takes_s() / 2)
        if isinstance(self.device, Dome):
            status, octets = self.device.respond(body)
        else:
            status, document = self.device.answer(method, path, body)
            octets = msgspec.json.encode(document)
        self.clock.sleep(self.takes_s() / 2)
        fields = (("Content-Type", "text/xml" if isinstance(self.device, Dome) else "application/json"),)
        return Exchange(Request(method, f"http://device{path}", headers, body), Response(status, fields, octets, 2.0))

    def close(self):
        """Close nothing: there are no connections."""


class Unread:
    """A whole request, whose response nobody reads."""

    def __init__(self, client, method, target, *, sent, promised, headers):
        assert promised == len(sent)
        client.send(method, target, headers=headers, body=sent)

    def vanish(self, *, reset=True):
        """Close nothing: there is no connection."""


class Binding(JsonBinding):
    """The description's rules without a contract: what is no number is forbidden."""

    has_credentials = False

    def forbids(self, _call, body):
        return any(not isinstance(one, int | float) for one in body.values())


def one_after_another(rounds):
    """Send what several clients send at once: the simulated clock does not pass between them."""
    return [[to.send(one.method, one.target, headers=one.headers, body=one.body) for to, one in rounds[0]]]


def map_of(text):
    """Return a motion map from its TOML."""
    return msgspec.convert(tomllib.loads(text)["motion"], MotionMap)


def played(name, mutant=None, *, noise=0.0, seed=0, takes_s=lambda: 0.002, toml="", effort=""):
    """Yield what a device is recorded to do: scenario, trace, and what rules may ask for; ``toml``: another map."""
    device, limits, _ = DEVICES[name]
    clock = SimulatedClock()
    body = Body(limits, clock.now, clock.sleep, noise, seed)
    if mutant is not None:
        mutant(body)
    motion = map_of(toml or DEVICES[name][2])
    api = Api(device(body), clock, takes_s)
    binding = SoapBinding(api, dome.messages_of()) if name == "dome" else Binding(api)
    mapped = MappedDevice(api, motion, clock, binding)
    # Making and reading XML takes most of the time of a camera's run.
    chosen = Effort(effort or ("quick" if name == "dome" else "standard"))
    given = {"mapped": mapped, "effort": chosen, "run": Run(seed=seed), "motion": motion, "body": body}
    for scenario in _PLAYED:
        try:
            with (
                patch.object(several, "send_together", one_after_another),
                patch.object(velocities, "PartialRequest", Unread),
            ):
                trace = scenario.play(**{name: given[name] for name in scenario.fixtures})
        except PartialTraceError as error:
            trace = error.trace
        except NotPossibleError:
            continue
        yield scenario, trace, given


def cases_of(rule, trace, given):
    """Return the cases of a rule on a trace."""
    return [one for one in rule.outcomes(trace, given.get) if isinstance(one, Case)]
