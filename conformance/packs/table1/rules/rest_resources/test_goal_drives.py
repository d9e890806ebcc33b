"""Rules on a drive to a goal."""

from collections.abc import Iterator

from conformance.packs.table1.robot.drive_rules import outcomes
from conformance.packs.table1.robot.goal import NEW, SUCCEEDED, outcome_fault
from conformance.packs.table1.robot.goal_trace import GoalReached
from conformance.packs.table1.scenarios.goal_reached import goal_reached
from conformance.packs.table1.statement import said_of
from conformance.scenarios.rule import Outcome, rule
from conformance.verdict.evidence import Case
from conformance.verdict.run import Run


@rule("rest-resources/goal-put", on=(goal_reached,))
def goal_put(trace: GoalReached) -> Iterator[Outcome]:
    """Judge that a new goal is accepted."""
    yield Case(trace.put.response.status in NEW, trace.put, "201 or 202 for a new goal")


@rule("rest-resources/goal-drives", on=(goal_reached,))
def goal_drives(trace: GoalReached) -> Iterator[Outcome]:
    """Judge that the robot drove, and to the target's position and heading."""
    if trace.there is None or trace.read is None or trace.undecided:
        return  # refused, slow but on its way, or sent elsewhere by another client: no fault
    far, there = trace.way_m > trace.has_to_m, trace.left_m < trace.reached_m
    heading = "" if trace.reached_rad is None else f", with a heading within {trace.reached_rad:.2f} rad of its heading"
    turned = "" if trace.reached_rad is None else f" and {abs(trace.off_rad):.2f} rad off its heading"
    yield Case(
        trace.is_near and far,
        trace.read,
        f"the robot within {trace.reached_m:.2f} m of its goal at ({trace.there.x:.2f}, {trace.there.y:.2f}){heading}",
        f"the robot {trace.left_m:.2f} m away from it{turned}, having moved {trace.way_m:.2f} m",
        "not driven" if not far else "another heading" if there else "not reached",
    )
    if trace.turned_off is not None and trace.reached_rad is not None:
        exchange, off = trace.turned_off
        expected = f"a heading within {trace.reached_rad:.2f} rad of that of a goal where the robot is"
        yield Case(off < trace.reached_rad, exchange, expected, f"one that is {off:.2f} rad off", "does not turn")


@rule("rest-resources/goal-ended", on=(goal_reached,))
def goal_ended(trace: GoalReached) -> Iterator[Outcome]:
    """Judge that the goal ends when the robot has reached it."""
    if trace.read is not None and not trace.undecided and not trace.other:
        holds = trace.ended and trace.read.response.status == 404
        observed = "" if trace.ended else "a goal that is still active"
        yield Case(holds, trace.read, "404 when the goal has been reached", observed)


@rule("rest-resources/goal-outcome", on=(goal_reached,))
def goal_outcome(trace: GoalReached) -> Iterator[Outcome]:
    """Judge that the 404 after the goal reports that it was reached."""
    if trace.read is not None and trace.ended and trace.is_near:
        wrong = outcome_fault(trace.read, SUCCEEDED, "reached")
        yield Case(not wrong, trace.read, "a 404 with last_goal {goal_id, status}, which succeeded (code 4)", wrong)


@rule("rest-resources/goal-id-again", on=(goal_reached,))
def goal_id_again(trace: GoalReached) -> Iterator[Outcome]:
    """Judge that the id of an ended goal can be used again."""
    if trace.again is not None:
        holds = trace.again.response.status in NEW
        yield Case(holds, trace.again, "201 or 202 for a goal whose id has ended before")


@rule("rest-resources/plan-start", on=(goal_reached,))
def plan_start(trace: GoalReached) -> Iterator[Outcome]:
    """Judge that a plan requested after the drive begins at the robot's new position."""
    if trace.start is not None:
        yield trace.start.case


@rule("soap-subscribers/plan", on=(goal_reached,))
def plan_start_over_soap(trace: GoalReached) -> Iterator[Outcome]:
    """Judge that a plan over SOAP begins at the robot's new position."""
    if trace.start_over_soap is not None:
        yield trace.start_over_soap.case


@rule("equivalence/goal", on=(goal_reached,))
def no_goal_over_soap(trace: GoalReached) -> Iterator[Outcome]:
    """Judge that GetGoal shows no goal that has ended."""
    if trace.over_soap is not None:
        exchange, shown = trace.over_soap
        yield Case(not shown, exchange, "no goal, as GET of the goal has none", "a goal that was reached", "ended")


@rule("rest-resources/velocity-odometry", on=(goal_reached,))
def velocity_odometry(trace: GoalReached, run: Run) -> Iterator[Outcome]:
    """Judge that velocity and odometry agree during the drive."""
    if trace.drive is not None:
        yield from outcomes("rest-resources/velocity-odometry", trace.drive, said_of(run).limits)


@rule("rest-resources/pose-motion", on=(goal_reached,))
def pose_motion(trace: GoalReached, run: Run) -> Iterator[Outcome]:
    """Judge that the pose follows the velocity during the drive."""
    if trace.drive is not None:
        yield from outcomes("rest-resources/pose-motion", trace.drive, said_of(run).limits)
