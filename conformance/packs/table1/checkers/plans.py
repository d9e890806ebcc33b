"""Judge every plan of a run, whichever check requests it: its end, start, heading, frame and steps."""

import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from statistics import median
from typing import Any, Final
from urllib.parse import parse_qsl, urlsplit

from conformance.documents.representation import UnreadableError, local_name, parse_xml, read
from conformance.measures.samples import FARTHEST
from conformance.packs.table1.robot.geometry import Pose, pose_of, wrapped
from conformance.packs.table1.robot.message_shapes import GET_PLAN, ODOMETRY, read_as
from conformance.packs.table1.robot.plan import START_OFF, Plan, plan_of
from conformance.packs.table1.robot.robot import PLAN, POSE
from conformance.packs.table1.robot.state_read import value_in
from conformance.packs.table1.statement import Statement
from conformance.transport.exchange import SAFE_METHODS, Attempt, Exchange, Response
from conformance.verdict.evidence import Case, case

# A leap in a path is longer than _LEAP_M, m, and longer than _STEPS usual steps of the path.
_LEAP_M: Final = 1.0
_STEPS: Final = 4.0
# A leap aside and back ends within this share of the leap from where it began.
_BACK: Final = 0.5
_FAR_M: Final = 1e4  # greater coordinates are too inexact to compare
_NEAR_M: Final = 0.01  # declared tolerances below this are not judged, m
_TOLERANCE_M: Final = 0.1  # default tolerance, m
_FRAME: Final = "map"
_YAW_OFF_RAD: Final = 0.2
_ROUNDING_M: Final = 1e-6
# Requirements on a plan's end, start, frame and given start, by media type; the last is SOAP's. YAML takes too long.
_JUDGED: Final = {
    "application/json": (
        "rest-resources/plan-end",
        "rest-resources/plan-start",
        "rest-resources/plan-frame",
        "rest-resources/plan-given-start",
    ),
    "application/xml": ("rest-formats/same-values",) * 4,
    "text/xml": ("soap-subscribers/plan",) * 4,
}
# Poses that a path needs to show its usual step.
_FEWEST: Final = 6
_STANDS_M: Final = 0.02  # a robot that moves less than this stands still, m
_OFTEN: Final = 2  # plans that must start elsewhere to count as a failure


class Plans:
    """Judges the plans in all exchanges of one run.

    Args:
        url: returns the URL of a path.
        said: the robot's statement.
    """

    def __init__(self, url: Callable[[str], str], said: Statement) -> None:
        self._url, self._at, motion = url(f"{PLAN}?"), url(POSE), said.motion
        self._frame, self._in_map = motion.frame, Pose(*motion.odom_to_map)
        self._noise_m = FARTHEST * said.limits.noise.position_m
        self._longest_m = said.limits.plan_step_m
        # The last pose since a command.
        self._here: Exchange | None = None
        self._from_here: list[tuple[Pose, Exchange]] = []  # plans from the robot's place since then
        self._elsewhere = 0

    def __call__(self, attempt: Attempt) -> Iterator[Case]:
        """Judge one exchange if it is a plan."""
        if not isinstance(attempt, Exchange):
            return
        exchange, response = attempt, attempt.response
        if exchange.request.url == self._at and exchange.request.method == "GET":
            yield from self._read_pose(exchange)
        elif exchange.request.method not in SAFE_METHODS and b":Get" not in exchange.request.body:
            self._here, self._from_here = None, []
        if not response.ok or response.media_type not in _JUDGED:
            return
        if exchange.request.method == "GET" and exchange.request.url.startswith(self._url):
            asked = _once(parse_qsl(urlsplit(exchange.request.url).query))
            value = _read(response)
        elif exchange.request.method == "POST" and b"GetPlanResponse" in response.body:
            asked = _asked_over_soap(exchange.request.body)
            value, _ = value_in(exchange, GET_PLAN)
        else:
            return
        if value is None or GET_PLAN.problem(value):
            return  # other checks judge that
        plan = plan_of(value)
        poses = plan.poses
        yield from self._judge_end(exchange, asked, poses[-1])
        yield from self._judge_start(exchange, asked, poses[0])
        yield from self._judge_frame(exchange, asked.get("frame_id", _FRAME if asked else ""), plan.frames)
        if not any(name.startswith("start") for name in asked) and asked.get("frame_id", _FRAME) == self._frame:
            self._from_here.append((poses[0], exchange))
        if response.media_type == "application/json":
            yield from self._judge_way(exchange, plan)
            yield from self._judge_heading(exchange, asked, poses[-1].yaw)

    def _read_pose(self, exchange: Exchange) -> Iterator[Case]:
        """Judge the plans since the pose that was read before, if the robot stood there and still does."""
        plans, before = self._from_here, self._here
        self._here, self._from_here = exchange, []
        if not plans or before is None:
            return
        one, other = (read_as(seen.response, ODOMETRY)[0] for seen in (before, exchange))
        if one is None or other is None:
            return
        here, after = (pose_of(seen["pose"]["pose"]).seen_from(self._in_map) for seen in (one, other))
        if here.distance(after) > _STANDS_M + 2 * self._noise_m:
            return
        for start, asked in plans:
            off_m = min(start.distance(here), start.distance(after)) - START_OFF - self._noise_m
            # A single reading may be wrong.
            self._elsewhere += off_m > 0
            yield case(
                _JUDGED[asked.response.media_type][1],
                off_m <= 0 or self._elsewhere < _OFTEN,
                asked,
                f"a path that starts within {START_OFF:g} m of the robot, ({here.x:.3f}, {here.y:.3f})",
                found=f"one that starts at ({start.x:.3f}, {start.y:.3f}), {self._elsewhere} times",
                cause="starts where the robot is not",
            )

    def _judge_end(self, exchange: Exchange, asked: Mapping[str, str], end: Pose) -> Iterator[Case]:
        """Judge that a path ends at the position in the request, where that is clear."""
        there = Pose(_number(asked.get("x", "")), _number(asked.get("y", "")), 0.0)
        tolerance_m = _number(asked.get("tolerance", str(_TOLERANCE_M)))
        if not (abs(there.x) < _FAR_M and abs(there.y) < _FAR_M and tolerance_m >= _NEAR_M):
            return
        yield case(
            _JUDGED[exchange.response.media_type][0],
            end.distance(there) <= tolerance_m * 1.05 + _NEAR_M,
            exchange,
            f"a path that ends at ({there.x:.3f}, {there.y:.3f}) within {tolerance_m:g} m",
            found=f"one that ends at ({end.x:.3f}, {end.y:.3f})",
            cause="ends elsewhere",
        )

    def _judge_start(self, exchange: Exchange, asked: Mapping[str, str], start: Pose) -> Iterator[Case]:
        """Judge that a path starts at the position in the request, where it has one."""
        given = Pose(_number(asked.get("start_x", "")), _number(asked.get("start_y", "")), 0.0)
        if not (abs(given.x) < _FAR_M and abs(given.y) < _FAR_M):
            return
        yield case(
            _JUDGED[exchange.response.media_type][3],
            start.distance(given) <= START_OFF,
            exchange,
            f"a path that starts within {START_OFF:g} m of ({given.x:.3f}, {given.y:.3f})",
            found=f"one that starts at ({start.x:.3f}, {start.y:.3f})",
            cause="starts elsewhere",
        )

    def _judge_frame(self, exchange: Exchange, asked: str, frames: frozenset[str]) -> Iterator[Case]:
        """Judge that a path and its poses are in the frame in the request; all in one, where that is not clear.

        A leading slash is no part of a frame's name (tf2 drops it).
        """
        named = {frame.removeprefix("/") for frame in frames}
        odd = sorted(named - {asked.removeprefix("/")}) if asked else sorted(named)[1:]
        yield case(
            _JUDGED[exchange.response.media_type][2],
            not odd,
            exchange,
            f"a path and poses in the frame {asked!r}" if asked else "a path and poses in one frame",
            found=f"the frame {odd[0]!r}" if odd else "",
            cause="another frame",
        )

    def _judge_way(self, exchange: Exchange, plan: Plan) -> Iterator[Case]:
        """Judge that no step of a path is longer than declared, and that it does not leap."""
        leap, step_m = longest_leap(plan.poses), plan.longest_step
        yield case(
            "rest-resources/plan-continuous",
            not leap and step_m <= self._longest_m + _ROUNDING_M,
            exchange,
            f"a path without a step of more than {self._longest_m:g} m that does not leap aside and back",
            found=f"a leap of {leap:.3f} m" if leap else f"a step of {step_m:.3f} m",
            cause="leaps" if leap else "long steps",
        )

    def _judge_heading(self, exchange: Exchange, asked: Mapping[str, str], yaw: float) -> Iterator[Case]:
        """Judge that a path ends with the heading in the request, where that is clear."""
        wanted = _number(asked.get("yaw", "0" if asked else ""))
        if abs(wanted) <= 2 * math.pi:
            yield case(
                "rest-resources/plan-yaw",
                abs(wrapped(yaw - wanted)) <= _YAW_OFF_RAD,
                exchange,
                f"a last heading of {wanted:.3f} rad",
                found=f"a last heading of {yaw:.3f} rad",
                cause="another heading",
            )


def _read(response: Response) -> Any:
    """Return the plan in a REST response; None where it cannot be read."""
    try:
        return read(response.media_type, response.body, GET_PLAN.schema)
    except UnreadableError:
        return None


def _asked_over_soap(body: bytes) -> dict[str, str]:
    """Return the parameters of a GetPlan message; none where it cannot be read."""
    try:
        root = parse_xml(body)
    except UnreadableError:
        return {}
    return _once(
        (local_name(element), element.text or "")
        for element in root.iter()
        if isinstance(element.tag, str) and not len(element)
    )


def _once(named: Iterable[tuple[str, str]]) -> dict[str, str]:
    """Return parameters by name; empty if a name occurs twice, because it is unclear which value counts."""
    pairs = list(named)
    found = dict(pairs)
    return found if len(found) == len(pairs) else {}


def _number(text: str) -> float:
    """Return a number, or NaN."""
    try:
        return float(text)
    except ValueError:
        return math.nan


def longest_leap(poses: tuple[Pose, ...]) -> float:
    """Return how far a path jumps aside for one pose and back again, m; 0 if it does not."""
    if len(poses) < _FEWEST:
        return 0.0
    steps = [one.distance(two) for one, two in itertools.pairwise(poses)]
    least = max(_LEAP_M, _STEPS * median(steps))
    leaps = [
        min(there, back)
        for (there, back), before, after in zip(itertools.pairwise(steps), poses, poses[2:], strict=False)
        if min(there, back) > least and before.distance(after) < _BACK * min(there, back)
    ]
    return max(leaps, default=0.0)
