"""Rules on plans: whether one exists, where it begins, and which requests must not change it."""

from collections.abc import Iterator
from http import HTTPStatus

from conformance.packs.table1.robot.geometry import Pose, wrapped
from conformance.packs.table1.robot.plan import START_OFF, Plan
from conformance.packs.table1.scenarios.plans import (
    DefaultPlan,
    FramePlan,
    PlansFromRobot,
    PlansFromStart,
    is_refused,
    plans_from_robot,
    plans_from_start,
    plans_in_frames,
    plans_outside,
)
from conformance.scenarios.rule import Outcome, Rule, rule
from conformance.transport.exchange import Exchange
from conformance.verdict.evidence import Case

Plans = PlansFromRobot | PlansFromStart
_YAW_OFF_RAD = 0.2
_EXPECTED = "status 200 with a complete nav_msgs/GetPlan response of one pose at least"


@rule("rest-resources/plan-type", on=(plans_from_robot, plans_from_start))
def plan_type(trace: Plans) -> Iterator[Outcome]:
    """Judge that the robot has plans to poses around it, each valid by the schema."""
    if isinstance(trace, PlansFromRobot) and trace.nowhere is not None:
        yield Case(False, trace.nowhere, "a plan to one of 8 poses around the robot")
    for read in trace.reads:
        yield Case(not read.problem, read.exchange, _EXPECTED, read.problem)


@rule("rest-resources/plan-start", on=(plans_from_robot,))
def plan_start(trace: PlansFromRobot) -> Iterator[Outcome]:
    """Judge that a plan begins where the robot is."""
    yield from (read.start.case for read in trace.reads if read.start is not None)


def _player(name: str) -> Rule:
    """Return the rule that plays plans; `checkers.plans` judges them, like those of all other checks."""
    return rule(f"rest-resources/{name}", on=(plans_from_robot, plans_from_start))(lambda _trace: ())


plan_given_start, plan_end, plan_yaw = _player("plan-given-start"), _player("plan-end"), _player("plan-yaw")
plan_continuous, plan_frame = _player("plan-continuous"), _player("plan-frame")


@rule("rest-resources/plan-defaults", on=(plans_from_start,))
def plan_defaults(trace: PlansFromStart) -> Iterator[Outcome]:
    """Judge that omitted parameters have their defaults."""
    for plan in trace.defaults:
        problem = plan.problem if plan.plan is None else _other_plan(plan, plan.plan)
        yield Case(not problem, plan.exchange, "the plan that yaw=0, frame_id=map and tolerance=0.1 give", problem)


@rule("rest-resources/plan-numbers", on=(plans_from_start,))
def plan_numbers(trace: PlansFromStart) -> Iterator[Outcome]:
    """Judge that numbers in a query mean the same in every notation."""
    for plan in trace.written:
        problem = plan.problem if plan.plan is None else _other_plan(plan, plan.plan)
        yield Case(not problem, plan.exchange, "the plan for the same numbers in their shortest notation", problem)


def _other_plan(one: DefaultPlan, plan: Plan) -> str:
    """Return where a plan differs from the plan for explicit defaults; empty if nowhere."""
    last, wanted = plan.poses[-1], one.explicit.poses[-1]
    off_m, apart_m = last.distance(one.goal), plan.poses[0].distance(one.explicit.poses[0])
    if off_m > 0.11:
        return f"an end {off_m:.3f} m away from the goal"
    if abs(wrapped(last.yaw - wanted.yaw)) > _YAW_OFF_RAD:
        return f"a last heading of {last.yaw:.3f} rad for {wanted.yaw:.3f}"
    if plan.frames != one.explicit.frames:
        return f"frames {_frames(plan)} for {_frames(one.explicit)}"
    return f"a start {apart_m:.3f} m away from the other's" if apart_m > START_OFF else ""


@rule("rest-resources/plan-frame", on=(plans_in_frames,))
def plan_in_its_frame(trace: tuple[FramePlan, ...]) -> Iterator[Outcome]:
    """Judge that there is a plan in the requested frame, which `checkers.plans` compares, or a refusal."""
    for plan in trace:
        problem = "" if is_refused(plan.exchange) else plan.problem
        yield Case(not problem, plan.exchange, f"path and poses in {plan.frame!r}, or 4xx", problem)


@rule("rest-resources/plan-start", on=(plans_in_frames,))
def plan_starts_in_its_frame(trace: tuple[FramePlan, ...]) -> Iterator[Outcome]:
    """Judge that a plan in the odometry frame begins at the odometry's pose."""
    for plan in trace:
        if plan.plan is not None and plan.moved_m is not None and plan.plan.frames == {plan.frame}:
            start, expected = plan.plan.poses[0], f"{_place(plan.begin)} in the odometry's frame"
            holds = start.distance(plan.begin) <= START_OFF + plan.moved_m
            yield Case(holds, plan.exchange, expected, _place(start), "odometry's frame")


@rule("rest-resources/plan-none", on=(plans_outside,))
def plan_none(trace: tuple[Exchange, ...]) -> Iterator[Outcome]:
    """Judge that the robot responds 422 to a request for a plan to a goal outside every map."""
    for exchange in trace:
        yield Case(exchange.response.status == HTTPStatus.UNPROCESSABLE_ENTITY, exchange, "422 where there is no plan")


def _place(pose: Pose) -> str:
    return f"({pose.x:.3f}, {pose.y:.3f})"


def _frames(plan: Plan) -> str:
    return ", ".join(sorted(map(repr, plan.frames)))
