"""Rules on plans: where a path begins and ends, how long its steps are, and in which frame it is."""

from collections.abc import Iterator
from http import HTTPStatus

from conformance.packs.table1.robot.geometry import Pose, wrapped
from conformance.packs.table1.robot.plan import START_OFF, Plan
from conformance.packs.table1.robot.plan_trace import DefaultPlan, FramePlan, PlansFromRobot, PlansFromStart
from conformance.packs.table1.scenarios.plans import (
    is_refused,
    plans_from_robot,
    plans_from_start,
    plans_in_frames,
    plans_outside,
)
from conformance.packs.table1.statement import said_of
from conformance.scenarios.rule import Outcome, rule
from conformance.transport.exchange import Exchange
from conformance.verdict.case import Case
from conformance.verdict.run import Run

Plans = PlansFromRobot | PlansFromStart
_YAW_OFF_RAD = 0.2
_ROUNDING_M = 1e-6
_EXPECTED = "status 200 with a complete nav_msgs/GetPlan response of one pose at least"


@rule("rest-resources/plan-type", on=(plans_from_robot,))
def plan_type(trace: PlansFromRobot) -> Iterator[Outcome]:
    """Judge that the robot has plans to poses around it, each valid by the schema."""
    if trace.nowhere is not None:
        yield Case(False, trace.nowhere, "a plan to one of 8 poses around the robot")
    for one in trace.reads:
        yield Case(not one.problem, one.exchange, _EXPECTED, one.problem)


@rule("rest-resources/plan-start", on=(plans_from_robot,))
def plan_start(trace: PlansFromRobot) -> Iterator[Outcome]:
    """Judge that a plan begins where the robot is."""
    yield from (one.start.case for one in trace.reads if one.start is not None)


@rule("rest-resources/plan-given-start", on=(plans_from_start,))
def plan_given_start(trace: PlansFromStart) -> Iterator[Outcome]:
    """Judge that a plan begins at the start in the request."""
    for one in trace.reads:
        if one.begin is not None:
            first = one.plan.poses[0] if one.plan is not None else None
            yield Case(
                first is not None and first.distance(one.begin) <= START_OFF,
                one.exchange,
                f"a path that starts at {_place(one.begin)}",
                one.problem if first is None else _place(first),
                one.problem or "starts elsewhere",
            )


@rule("rest-resources/plan-end", on=(plans_from_robot, plans_from_start))
def plan_end(trace: Plans) -> Iterator[Outcome]:
    """Judge that a plan ends at the goal in the request."""
    for one in trace.reads:
        if one.plan is not None:
            last = one.plan.poses[-1]
            yield Case(
                last.distance(one.goal) <= one.tolerance_m * 1.05 + 0.01,
                one.exchange,
                f"a path that ends at {_place(one.goal)} within {one.tolerance_m:g} m",
                _place(last),
                "ends elsewhere",
            )


@rule("rest-resources/plan-yaw", on=(plans_from_robot, plans_from_start))
def plan_yaw(trace: Plans) -> Iterator[Outcome]:
    """Judge that a plan ends with the heading in the request."""
    for one in trace.reads:
        if one.plan is not None:
            yaw = one.plan.poses[-1].yaw
            holds = abs(wrapped(yaw - one.goal.yaw)) <= _YAW_OFF_RAD
            expected = f"a last heading of {one.goal.yaw:.3f} rad"
            yield Case(holds, one.exchange, expected, f"a last heading of {yaw:.3f} rad", "another heading")


@rule("rest-resources/plan-continuous", on=(plans_from_robot, plans_from_start))
def plan_continuous(trace: Plans, run: Run) -> Iterator[Outcome]:
    """Judge that no step between two poses of a plan is longer than declared."""
    longest_m = said_of(run).limits.plan_step_m
    for one in trace.reads:
        if one.plan is not None:
            step_m = one.plan.longest_step
            expected = f"no step of more than {longest_m:g} m"
            yield Case(step_m <= longest_m + _ROUNDING_M, one.exchange, expected, f"a step of {step_m:.3f} m")


@rule("rest-resources/plan-frame", on=(plans_from_robot, plans_from_start))
def plan_frame(trace: Plans, run: Run) -> Iterator[Outcome]:
    """Judge that path and poses of a plan are in the frame of goals."""
    frame = said_of(run).motion.frame
    for one in trace.reads:
        if one.plan is not None:
            holds = one.plan.frames == {frame}
            yield Case(holds, one.exchange, f"path and poses in {frame}", _frames(one.plan))


@rule("rest-resources/plan-defaults", on=(plans_from_start,))
def plan_defaults(trace: PlansFromStart) -> Iterator[Outcome]:
    """Judge that omitted parameters have their defaults."""
    for one in trace.defaults:
        problem = one.problem if one.plan is None else _other_plan(one, one.plan)
        yield Case(not problem, one.exchange, "the plan that yaw=0, frame_id=map and tolerance=0.1 give", problem)


@rule("rest-resources/plan-numbers", on=(plans_from_start,))
def plan_numbers(trace: PlansFromStart) -> Iterator[Outcome]:
    """Judge that numbers in a query mean the same in every notation."""
    for one in trace.written:
        problem = one.problem if one.plan is None else _other_plan(one, one.plan)
        yield Case(not problem, one.exchange, "the plan for the same numbers in their shortest notation", problem)


def _other_plan(one: DefaultPlan, plan: Plan) -> str:
    """Return where a plan differs from the one with the defaults written out; empty if nowhere."""
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
    """Judge that a plan is in the requested frame, or rejected."""
    for one in trace:
        problem = "" if one.plan is None or one.plan.frames == {one.frame} else f"frames {_frames(one.plan)}"
        problem = "" if is_refused(one.exchange) else one.problem or problem
        yield Case(not problem, one.exchange, f"path and poses in {one.frame!r}, or 4xx", problem)


@rule("rest-resources/plan-start", on=(plans_in_frames,))
def plan_starts_in_its_frame(trace: tuple[FramePlan, ...]) -> Iterator[Outcome]:
    """Judge that a plan in the odometry frame begins at the odometry's pose."""
    for one, plan, moved_m in _placed(trace):
        yield _at(plan.poses[0], one.begin, START_OFF + moved_m, one.exchange)


@rule("rest-resources/plan-end", on=(plans_in_frames,))
def plan_ends_in_its_frame(trace: tuple[FramePlan, ...]) -> Iterator[Outcome]:
    """Judge that a plan in the odometry frame ends at the requested goal."""
    for one, plan, _ in _placed(trace):
        yield _at(plan.poses[-1], one.goal, 0.1 * 1.05 + 0.01, one.exchange)


def _placed(trace: tuple[FramePlan, ...]) -> Iterator[tuple[FramePlan, Plan, float]]:
    """Yield the plans that are in the known frame requested, and how far the robot moved in the meantime, m."""
    for one in trace:
        if one.plan is not None and one.moved_m is not None and one.plan.frames == {one.frame}:
            yield one, one.plan, one.moved_m


def _at(pose: Pose, wanted: Pose, off_m: float, exchange: Exchange) -> Case:
    expected = f"{_place(wanted)} in the odometry's frame"
    return Case(pose.distance(wanted) <= off_m, exchange, expected, _place(pose), "odometry's frame")


@rule("rest-resources/plan-none", on=(plans_outside,))
def plan_none(trace: tuple[Exchange, ...]) -> Iterator[Outcome]:
    """Judge that the robot responds 422 to a request for a plan to a goal outside every map."""
    for exchange in trace:
        yield Case(exchange.response.status == HTTPStatus.UNPROCESSABLE_ENTITY, exchange, "422 where there is no plan")


def _place(pose: Pose) -> str:
    return f"({pose.x:.3f}, {pose.y:.3f})"


def _frames(plan: Plan) -> str:
    return ", ".join(sorted(map(repr, plan.frames)))
