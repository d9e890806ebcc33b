"""The self-test of this pack: its good robots, its mutants, and facts about both that the contract has."""

import contextlib
import sys
import threading
import time
from collections import deque
from collections.abc import Callable
from copy import deepcopy
from dataclasses import replace
from itertools import cycle
from pathlib import Path

from conformance.papers_robot.statement import CONTRACT_DIR
from proof.mutation.changes import inputs, parsed, plain, problem, rest, soap
from proof.mutation.fields import without
from proof.mutation.messages import Forward, Request, Response
from proof.mutation.self_test import (
    GoodDevice,
    HarmlessChange,
    OpenPlace,
    SelfTest,
    Start,
    build,
    check_installed,
    program,
)
from proof.mutation.wire import IncompleteMessageError
from proof.table1.faulty_bodies import STATEMENTS
from proof.table1.mutants import MUTANTS
from proof.table1.mutants.distortion import valid_delivery
from proof.table1.mutants.paths import GOAL, POSE

_HERE = Path(__file__).parent
_ROBOTS = _HERE / "independent_robots"
_REFERENCE_ROBOT = _HERE.parents[1] / "reference_robot"
_FREE_PORTS = ("--rest-port", "0", "--soap-port", "0")
_MESSAGE_S, _FORGOTTEN_S = 0.05, 2.0
_OWN = rest("POST", POSE)
_GOAL_PUT = rest("PUT", GOAL)
_AT_POSE = rest("", POSE)
_ORDERS = soap("ExecuteCoffeeRequest", "ExecuteDeliveryRequest")
_OPEN_PLACES = (
    OpenPlace(
        r"(freeze|delay|scale|ulp|swap)(@[\w-]+)?:[gG]etPlan:answer(\.return)?\.plan(\.poses\[\])?"
        r"\.header\.stamp(\.\w+)?:\w+"
        r"|negate(@[\w-]+)?:[gG]etPlan:answer(\.return)?\.plan(\.poses\[\])?\.header\.stamp\.sec:\w+",
        "A planner chooses the stamp of its plan: the contract names its frame and its poses (contract.md#plans). Each "
        "request makes a new plan, so formats need not agree on the stamp.",
    ),
    OpenPlace(
        r"(default|scale|single|ulp|ignore|lag|clamp|round):[gG]etPlan:request\.tolerance:\w+",
        "A path that ends at the requested pose itself is within every tolerance (contract.md#plans): such a planner's "
        "response does not depend on the tolerance. Of other planners, plan-end judges the path by the tolerance sent.",
    ),
    OpenPlace(
        r"forward(@[\w-]+)?:[gG]etPlan:request\.(?!start_yaw)\w+:\w+"
        r"|(default|scale|negate|ulp|single|round|clamp)(@[\w-]+)?:[gG]etPlan:request\.start_yaw:\w+",
        "A path starts at the asked position (contract.md#plans); what start_yaw does to it, no clause says.",
    ),
    OpenPlace(
        r"ulp(@[\w-]+)?:putGoal:answer\.goal\.target_pose\.pose\.(position|orientation)\.\w+:\w+",
        "A robot responds with the goal as it understood it: it may bring a quaternion to unit length, and transform a "
        "pose to another frame and back (contract.md#goals requires the goal, not its last bit).",
    ),
    OpenPlace(
        r"(default|scale|negate|ulp|ignore|lag|clamp):ExecuteCoffeeRequest:request\.arg0\.message_code:soap",
        "ExecuteCoffeeRequest publishes code 4, whatever code it is given (contract.md#soap-publishers).",
    ),
    OpenPlace(
        r"(default|scale|single|ulp|ignore|lag|clamp|round)(@[\w-]+)?:putGoal:request\."
        r"(goal_id|header|goal\.target_pose\.header)\.stamp\.\w+:\w+",
        "A robot may stamp a goal itself, as it does where the stamp is left out: it must show the same id and pose "
        "(contract.md#goals).",
    ),
    OpenPlace(
        r"(freeze|delay|ulp)(@[\w-]+)?:putGoal:answer\.(goal_id|header|goal\.target_pose\.header)\.stamp(\.\w+)?:\w+",
        "The response to a PUT acknowledges the goal; which time its stamps show there, no clause says.",
    ),
    OpenPlace(
        r"ulp(@[\w-]+)?:getDeliveries:answer\[\]\.accepted\.\w+:\w+",
        "When a delivery counts as accepted, to the nanosecond, is the robot's own affair (contract.md#deliveries).",
    ),
    OpenPlace(
        r"[\w-]+@first:[gG]et(Sensors|NavigationServices):answer(\.return)?(\[\]\.\w+)?:\w+",
        "The lists show what is on the robot's graph, which may change after any response: one that differs from all "
        "later ones is no breach (contract.md#sensors-and-services).",
    ),
    OpenPlace(
        r"(truncate|freeze|delay|fold|strip)(@[\w-]+)?:putGoal:answer\.status\.text:\w+",
        "The text of a status is in the robot's own words (contract.md#goals names the codes).",
    ),
    OpenPlace(
        r"ulp(@[\w-]+)?:putGoal:answer\.status\.code:\w+",
        "Which code of an active goal the response to its PUT shows, no clause says.",
    ),
    OpenPlace(
        r"body-empty(@[\w-]+)?:putGoal:body:\w+",
        "A goal is acknowledged by the status (contract.md#goals); no clause requires a response body.",
    ),
    OpenPlace(
        r"(single|ulp)(@[\w-]+)?:putGoal:request\.goal\.target_pose\.pose\.(position|orientation)\.\w+:\w+",
        "A robot responds with the goal as it understood it, and may have transformed it (contract.md#goals): only "
        "deliveries are the same to the last bit.",
    ),
    OpenPlace(
        r"ulp(@[\w-]+)?:put(Linear)?Velocity:request\.[\w.]+:\w+",
        "A velocity is reached within the declared tolerance (contract.md#velocity), and 204 is a full response.",
    ),
    OpenPlace(r"status:putDelivery:2\d\d-2\d\d", "A delivery responds 2xx; 204 is preferred (contract.md#rest)."),
    OpenPlace(
        r"reorder:[gG]et(Sensors|NavigationServices):answer(\.return)?:\w+",
        "What is on the robot's graph has no order (contract.md#sensors-and-services).",
    ),
    OpenPlace(
        r"status:\w+:(400|422)-4\d\d",
        "Input that is no JSON is 400, of the wrong shape 422; other 4xx conform too (contract.md#input-json).",
    ),
)


def _on_ros(start: Start, *options: str) -> list[str]:
    return [sys.executable, "-P", "-m", "roaas", "robot", *_FREE_PORTS, "--domain-id", str(start.domain_id), *options]


def _realistic(start: Start) -> list[str]:
    """Return a reference robot with odometry, wheels and delays like real ones; each seed is another robot."""
    return _on_ros(start, "--realistic", "--seed", str(start.seed))


def _with_body(name: str) -> GoodDevice:
    """Return a reference robot with another body (``roaas robot --kinematics``)."""
    statement = _REFERENCE_ROBOT / f"{name}.toml"
    return GoodDevice(name, lambda start: _on_ros(start, "--kinematics", name), statement, on_ros=True, once=True)


def _in_python(name: str, *modules: str, options: tuple[str, ...] = ()) -> Callable[[Start], list[str]]:
    def command(_: Start) -> list[str]:
        check_installed(*modules)
        return [sys.executable, "-P", "-m", "proof.table1.independent_robots", name, *_FREE_PORTS, *options]

    return command


def _in_javascript(_: Start) -> list[str]:
    return [program("node", "nodejs"), str(_ROBOTS / "node" / "robot.js")]


def _in_go(_: Start) -> list[str]:
    return [str(build(*sorted((_ROBOTS / "golang").glob("*.go")))), str(CONTRACT_DIR)]


def _statement(name: str) -> Path:
    return _ROBOTS / name / f"{name}.toml"


def _independent(name: str, *, shows_effects: bool = False) -> GoodDevice:
    return GoodDevice(name, _in_python(name), _statement(name), shows_effects=shows_effects)


def _on_server(name: str, command: Callable[[Start], list[str]]) -> GoodDevice:
    """Return a robot on a web server that responds to much by itself; most of these have fewer resources."""
    return GoodDevice(name, command, _statement(name), shows_effects=False, once=True)


REFERENCE = GoodDevice("reference", _on_ros, _REFERENCE_ROBOT / "reference.toml", on_ros=True)
REALISTIC = GoodDevice("realistic", _realistic, _REFERENCE_ROBOT / "realistic.toml", on_ros=True)
BODIES = tuple(_with_body(name) for name in ("ackermann", "no-reverse", "holonomic", "slow-and-busy"))
PLAIN = _independent("plain")
BAROQUE = _independent("baroque", shows_effects=True)
LEGACY = _independent("legacy")
# This robot's hold time is so short that over a slow link a velocity has ended before the next reading.
DEADMAN = GoodDevice(
    "deadman", _in_python("baroque", options=("--hold-s", "0.3")), _ROBOTS / "baroque" / "deadman.toml", once=True
)
ON_SERVERS = (
    _on_server("node", _in_javascript),
    _on_server("golang", _in_go),
    _on_server("flask", _in_python("flask", "flask", "gunicorn")),
    _on_server("aiohttp", _in_python("aiohttp", "aiohttp")),
    _on_server("hypercorn", _in_python("hypercorn", "hypercorn", "starlette")),
)


def with_fault(name: str) -> GoodDevice:
    """Return the robot ``baroque`` with a fault in its body; of an empty name, without one."""
    command = _in_python("baroque", options=("--fault", name) if name else ())
    return replace(BAROQUE, command=command, statement=STATEMENTS.get(name, BAROQUE.statement))


class _Behind:
    """SOAP speaks of pose and velocity as they were some messages ago, as a process of its own may."""

    def __init__(self) -> None:
        self._states = soap("GetPose", "GetVelocity")
        self._known: dict[bytes, deque[Response]] = {}
        self._asked = 0.0

    def __call__(self, request: Request, forward: Forward) -> Response:
        if not self._states(request) or request.media_type != "text/xml":
            return forward(request)
        self._asked = time.monotonic()
        if request.body not in self._known:
            self._known[request.body] = deque([forward(request)], maxlen=2)
            threading.Thread(target=self._follow, args=(request, forward), daemon=True).start()
        return deepcopy(self._known[request.body][0])

    def _follow(self, request: Request, forward: Forward) -> None:
        """Read the state again and again, as long as clients read it."""
        with contextlib.suppress(OSError, IncompleteMessageError):
            while time.monotonic() - self._asked < _FORGOTTEN_S:
                time.sleep(_MESSAGE_S)
                self._known[request.body].append(forward(request))
        del self._known[request.body]


def _extend(request: Request, forward: Forward) -> Response:
    """Add a method of the vendor's own at the pose, and ignore the status in a goal that is put back."""
    if _OWN(request):
        return plain(204)(request)
    goal = parsed(request.body) if _GOAL_PUT(request) else None
    if isinstance(goal, dict) and "status" in goal:
        request = request.copy()
        inputs(without("status"))(request)
    response = forward(request)
    allow = response.field("Allow")
    if _AT_POSE(request) and allow is not None:
        response.put("Allow", f"{allow}, POST")
    return response


class _FullQueue:
    """Defer every twentieth delivery for a second, over either interface, and accept it when it is repeated."""

    def __init__(self) -> None:
        self._answers = cycle([None] * 19 + [503] + [None] * 19 + [429])

    def __call__(self, request: Request, forward: Forward) -> Response:
        status = next(self._answers) if valid_delivery(request) or _ORDERS(request) else None
        if status is None:
            return forward(request)
        after = ("Retry-After", "1")
        return (
            problem(status, "the queue is full", after) if request.side == "rest" else plain(status, b"", "", after)
        )(request)


SELFTEST = SelfTest(
    devices=(REFERENCE, PLAIN, BAROQUE, LEGACY, REALISTIC, DEADMAN, *BODIES, *ON_SERVERS),
    mutants=MUTANTS,
    short=(
        "safety-unactuated-ignored",
        "pose-without-child-frame",
        "sensors-twice",
        "plan-jumps",
        "format-no-vary",
        "http-405-without-allow",
        "http-nan",
        "delivery-text-is-zero",
        "soap-response-namespace",
        "bp-fault-200",
        "input-last-wins",
        "input-soap-missing-is-zero",
        "same-pose",
        "wsdl-float",
        "openapi-without-path",
    ),
    quick="baroque",
    device_for={
        # Its velocities hold long enough for such slow reading.
        "slow": "plain",
        "nginx": "reference",
        "haproxy": "reference",
        "apache": "reference",
        "go-reverse-proxy": "reference",
        "nginx-http10": "plain",
    },
    wsdls=lambda publishers: (publishers, publishers.replace("publisher", "subscriber")),
    variants=(
        HarmlessChange("behind", "SOAP is a message or two behind REST", _Behind),
        HarmlessChange(
            "extended", "POST at the pose is the vendor's own; a goal's status may be sent", lambda: _extend
        ),
        HarmlessChange("full-queue", "every twentieth delivery is put off for a second by 503 or 429", _FullQueue),
    ),
    classes={
        r"(get|put|delete)\w*Deliver(y|ies)": ("rest-delivery", "equivalence"),
        r"(get|put|delete)\w*(Velocity|Goal)": ("rest-resources", "equivalence", "safety"),
        r"[a-z]\w+": ("rest-resources", "equivalence"),
        r"Execute\w+": ("soap-delivery", "equivalence"),
        r"\w+": ("soap-subscribers", "equivalence"),
    },
    clauses={
        r"[a-z]\w*Pose": "Poses",
        r"[a-z]\w*Velocity": "Velocity",
        r"[a-z]\w*(Sensors|Services)": "Sensors and services",
        r"[a-z]\w*Goal": "Goals",
        r"[a-z]\w*Plan": "Plans",
        r"[a-z]\w*Deliver(y|ies)": "Deliveries",
        r"Execute\w+": "SOAP publishers",
        r"Get\w+": "SOAP subscribers",
    },
    open_places=_OPEN_PLACES,
)
