"""Rules on goals: sent, repeated, contradicted, replaced, cancelled, reached, in random order, and special ones."""

from collections.abc import Iterator

from conformance.documents.json_text import clip
from conformance.packs.table1.robot.drive_rules import outcomes
from conformance.packs.table1.robot.goal import (
    CANCELED,
    CANCELLED,
    NEW,
    REPEATED,
    SUCCEEDED,
    outcome_fault,
    status_fault,
)
from conformance.packs.table1.robot.goal_trace import (
    GoalLife,
    GoalReached,
    GoalRead,
    GoalStep,
    Put,
    RefusedGoals,
    SpecialGoal,
)
from conformance.packs.table1.scenarios.goal_life import ID, goal_life
from conformance.packs.table1.scenarios.goal_reached import goal_ids, goal_poses, goal_reached, refused_goals
from conformance.packs.table1.scenarios.walks import goal_walk
from conformance.packs.table1.statement import said_of
from conformance.scenarios.rule import Outcome, Rule, rule
from conformance.verdict.evidence import Case
from conformance.verdict.run import Run

# How far a goal's stamp may be from the odometry's, s: as far as the odometry's from Date (contract.md#poses).
_NOW_S = 5.0


def _puts(life: GoalLife) -> Iterator[Put]:
    """Yield the PUTs of new goals."""
    second = life.second if life.renamed is None else None
    yield from (put for put in (life.first, second, life.reused) if put is not None)


def _read(life: GoalLife) -> Iterator[Put]:
    """Yield the PUTs of new goals that the robot accepted and showed before they ended."""
    yield from (put for put in _puts(life) if put.exchange.response.status in NEW | REPEATED and not put.ended)


def _judge_shown(put: Put) -> Case:
    return Case(not put.differs, put.read, "the goal that was put", put.differs)


@rule("rest-resources/goal-none", on=(goal_life,))
def no_goal(trace: GoalLife) -> Iterator[Outcome]:
    """Judge that GET returns 404 before the first goal."""
    for refusal in trace.none:
        yield Case(refusal.read.response.status == 404, refusal.read, "404 without an active goal")


@rule("rest-resources/goal-delete-none", on=(goal_life,))
def cancelled_without_goal(trace: GoalLife) -> Iterator[Outcome]:
    """Judge the response to DELETE while there is no goal."""
    for refusal in trace.none:
        yield Case(
            refusal.cancelled.response.status == 404, refusal.cancelled, "404 for a DELETE without an active goal"
        )


@rule("rest-resources/goal-delete-none-success", on=(goal_life,))
def cancelled_without_goal_or_success(trace: GoalLife) -> Iterator[Outcome]:
    """Judge that a DELETE without a goal is answered 404 or with success."""
    for refusal in trace.none:
        yield Case(refusal.cancelled.response.status in {404, 200, 204}, refusal.cancelled, "404 or 204 without a goal")


@rule("rest-resources/goal-put", on=(goal_life,))
def goal_put(trace: GoalLife) -> Iterator[Outcome]:
    """Judge that a new goal is accepted."""
    for put in _puts(trace):
        yield Case(put.exchange.response.status in NEW, put.exchange, "201 or 202 for a new goal")


@rule("rest-resources/goal-id-again", on=(goal_life,))
def goal_id_again(trace: GoalLife) -> Iterator[Outcome]:
    """Judge that the id of a cancelled goal can be used again."""
    if (again := trace.again) is not None:
        new = again.exchange.response.status in NEW
        yield Case(new, again.exchange, "201 or 202 for a goal whose id was that of a cancelled goal")
        if new and not again.ended:
            yield _judge_shown(again)


@rule("rest-resources/goal-get", on=(goal_life,))
def goal_get(trace: GoalLife) -> Iterator[Outcome]:
    """Judge that GET shows the goal that was sent, and does so after a velocity that was refused."""
    yield from map(_judge_shown, _read(trace))
    for put in trace.kept:
        expected = f"the active goal, as {put.exchange.request.method} {put.exchange.request.target} was refused"
        yield Case(not put.differs, put.read, expected, put.differs)


@rule("rest-resources/goal-id", on=(goal_life,))
def goal_id(trace: GoalLife) -> Iterator[Outcome]:
    """Judge that GET shows the goal's id."""
    return (_judge_shown(put) for put in _read(trace) if put is trace.first)


@rule("rest-resources/goal-status", on=(goal_life,))
def goal_status(trace: GoalLife) -> Iterator[Outcome]:
    """Judge the status of an active goal."""
    for put in _read(trace):
        if put.shown is not None:
            wrong = status_fault(put.shown)
            yield Case(not wrong, put.read, "a status {code, text} with code 1, 2 or 3", wrong)


@rule("rest-resources/goal-repeat", on=(goal_life,))
def goal_repeat(trace: GoalLife) -> Iterator[Outcome]:
    """Judge that repeating a goal's PUT changes neither the goal nor its stamp."""
    for put in trace.repeated:
        accepted, changed = put.exchange.response.status in REPEATED, put.differs
        # If a goal's stamp stays the same between readings, it must differ from another goal's.
        stamps = trace.stamps if trace.first is not None and put.body == trace.first.body else ()
        if not changed and len(stamps) > 1 and stamps[0] == stamps[1] != put.shown["goal_id"]["stamp"]:
            changed = f"goal_id.stamp {put.shown['goal_id']['stamp']} for {stamps[0]}"
        yield Case(
            accepted and not changed,
            put.read if accepted else put.exchange,
            "200, 202 or 204 for the goal that is active already, which stays as it is",
            changed if accepted else put.exchange.came,
        )


@rule("rest-resources/goal-put-back", on=(goal_life,))
def goal_put_back(trace: GoalLife) -> Iterator[Outcome]:
    """Judge that the active goal may be put back as GET shows it: the robot ignores its status, or refuses it."""
    for put in trace.put_back:
        status = put.exchange.response.status
        answered = status in REPEATED or 400 <= status < 500
        yield Case(
            answered and not put.differs,
            put.read if answered else put.exchange,
            "200, 202, 204 or 4xx for the active goal as GET shows it, which stays as it is",
            put.differs if answered else put.exchange.came,
        )


@rule("rest-resources/goal-conflict", on=(goal_life,))
def goal_conflict(trace: GoalLife) -> Iterator[Outcome]:
    """Judge that the robot rejects another pose under the active goal's id."""
    for put in trace.contradicted:
        refused = put.exchange.response.status == 409
        yield Case(
            refused and not put.differs,
            put.read if refused else put.exchange,
            "409 for another pose under the active goal's id, and the goal as it was",
            put.differs if refused else put.exchange.came,
        )


@rule("rest-resources/goal-preempt", on=(goal_life,))
def goal_preempt(trace: GoalLife) -> Iterator[Outcome]:
    """Judge that another goal replaces the active one."""
    if trace.second is not None and trace.renamed is False:
        yield Case(False, trace.second.exchange, "201 or 202 for another goal")
    yield from (_judge_shown(put) for put in _read(trace) if put is trace.second)


@rule("rest-resources/goal-fills-in", on=(goal_life,))
def goal_fills_in(trace: GoalLife, run: Run) -> Iterator[Outcome]:
    """Judge that the robot fills in optional members that the goal leaves out."""
    second = trace.second
    if second is None:
        return
    if trace.renamed is not None:
        if trace.renamed:
            yield Case(False, second.exchange, "201 or 202 for a goal without an id")
    elif not second.ended:
        id_ = None if second.shown is None else second.shown["goal_id"]["id"]
        found = "no active goal" if id_ is None else f"goal_id.id {id_!r}"
        expected = "the active goal with a header and a goal_id of the robot's own"
        yield Case(id_ not in {None, "", ID}, second.read, expected, found)
        if second.shown is not None and trace.now_s is not None:
            stamp = second.shown["header"]["stamp"]
            ahead_s = stamp["sec"] + stamp["nanosec"] * 1e-9 - trace.now_s
            scale = max(1.0, said_of(run).limits.time_scale)
            holds = -(_NOW_S + trace.took_s) * scale <= ahead_s <= _NOW_S * scale
            expected = "the robot's present time as header.stamp of a goal that was sent without a header"
            yield Case(holds, second.read, expected, f"a stamp {ahead_s:.1f} s ahead of the odometry's")


@rule("rest-resources/velocity-goal", on=(goal_life,))
def velocity_goal(trace: GoalLife, run: Run) -> Iterator[Outcome]:
    """Judge that a velocity PUT while a goal is active is driven, or rejected with 409."""
    answer = trace.velocity
    if answer is not None:
        yield Case(answer.response.status in {200, 204, 409}, answer, "200, 204 or 409 while a goal is active")
    if trace.linear is not None:
        expected = "200, 204 or 409 for a linear velocity while a goal is active"
        # A robot that only turns in circles cannot add a linear velocity of 0 to the turn of its navigation.
        narrow = said_of(run).motion.min_radius_m is not None and trace.linear.response.status == 422
        yield Case(narrow or trace.linear.response.status in {200, 204, 409}, trace.linear, expected)
    if trace.drive is not None:
        yield from outcomes("rest-resources/velocity-goal", trace.drive, said_of(run).limits)


@rule("rest-resources/goal-delete", on=(goal_life,))
def goal_delete(trace: GoalLife) -> Iterator[Outcome]:
    """Judge that a cancelled goal is gone."""
    for cancellation in trace.cancelled:
        accepted = cancellation.exchange.response.status in CANCELLED
        yield Case(
            accepted and cancellation.gone,
            cancellation.read if accepted else cancellation.exchange,
            "204 for DELETE, then 404 for GET",
            f"{cancellation.read.came} for GET" if accepted else "",
        )


@rule("rest-resources/goal-outcome", on=(goal_life,))
def goal_outcome(trace: GoalLife) -> Iterator[Outcome]:
    """Judge that the 404 after a DELETE reports that the goal was cancelled."""
    for cancellation in trace.cancelled:
        if cancellation.exchange.response.status in CANCELLED and cancellation.gone:
            wrong = outcome_fault(cancellation.read, CANCELED)
            yield Case(
                not wrong,
                cancellation.read,
                "a 404 with last_goal {goal_id, status}, which was canceled (code 5)",
                wrong,
            )


def _rule_of_kind(kind: str) -> Rule:
    """Return a rule that judges one requirement by the steps of its kind."""

    def judge(trace: tuple[GoalStep, ...]) -> Iterator[Outcome]:
        return (step.case for step in trace if step.kind == kind)

    return rule(f"rest-resources/{kind}", on=(goal_walk,))(judge)


goal_put_in_walks = _rule_of_kind("goal-put")
goal_get_in_walks = _rule_of_kind("goal-get")
goal_none_in_walks = _rule_of_kind("goal-none")
goal_repeat_in_walks = _rule_of_kind("goal-repeat")
goal_conflict_in_walks = _rule_of_kind("goal-conflict")
goal_preempt_in_walks = _rule_of_kind("goal-preempt")
goal_delete_in_walks = _rule_of_kind("goal-delete")
goal_delete_none_success_in_walks = _rule_of_kind("goal-delete-none-success")


@rule("rest-resources/goal-id", on=(goal_ids,))
def special_goal_id(trace: tuple[Put, ...]) -> Iterator[Outcome]:
    """Judge that the robot accepts a goal with any id, and shows it under this id."""
    for put in trace:
        id_ = put.body["goal_id"]["id"]
        expected = f"201 or 202 for the id {clip(id_)}, which has {len(id_)} characters"
        yield Case(put.exchange.response.status in NEW, put.exchange, expected, cause=put.exchange.came)
    yield from _under_its_id(trace)


@rule("rest-resources/goal-preempt", on=(goal_ids,))
def special_goal_preempt(trace: tuple[Put, ...]) -> Iterator[Outcome]:
    """Judge that each goal replaces the one before."""
    return _under_its_id(trace)


@rule("rest-resources/goal-get", on=(goal_ids,))
def special_goal_get(trace: tuple[Put, ...]) -> Iterator[Outcome]:
    """Judge that GET shows each goal under its id."""
    return _under_its_id(trace)


@rule("rest-resources/goal-get", on=(goal_poses,))
def goal_get_pose(trace: tuple[GoalRead, ...]) -> Iterator[Outcome]:
    """Judge that GET returns each goal unchanged, in every reading."""
    return (Case(not read.differs, read.exchange, "the goal that was put", read.differs) for read in trace)


def _under_its_id(trace: tuple[Put, ...]) -> Iterator[Case]:
    """Yield whether the robot showed each goal that it accepted, unless the goal had ended."""
    for put in trace:
        if put.exchange.response.status in NEW and not put.ended:
            cause = "another id" if put.differs.startswith("goal_id") else put.differs
            yield Case(not put.differs, put.read, "the goal that was put last, under its id", put.differs, cause)


def _judge_refusal(put: SpecialGoal) -> Case:
    holds = 400 <= put.exchange.response.status < 500
    return Case(holds, put.exchange, f"4xx for a goal with {put.special}", cause=put.exchange.came)


@rule("rest-resources/goal-quaternion", on=(refused_goals,))
def goal_quaternion(trace: RefusedGoals) -> Iterator[Outcome]:
    """Judge that goals with a quaternion of another length than 1 are refused."""
    return map(_judge_refusal, trace.not_unit)


@rule("rest-resources/goal-quaternion-taken", on=(refused_goals,))
def goal_quaternion_taken(trace: RefusedGoals) -> Iterator[Outcome]:
    """Judge that goals with a quaternion of length 1 within the tolerance are accepted."""
    for put in trace.unit:
        holds = put.exchange.response.status in NEW
        yield Case(holds, put.exchange, f"201 or 202 for a goal with {put.special}", cause=put.exchange.came)


@rule("rest-resources/goal-frame", on=(refused_goals,))
def goal_frame(trace: RefusedGoals) -> Iterator[Outcome]:
    """Judge that goals in unknown frames are refused."""
    return map(_judge_refusal, trace.unknown_frames)


@rule("rest-resources/goal-unreachable", on=(refused_goals,))
def goal_unreachable(trace: RefusedGoals) -> Iterator[Outcome]:
    """Judge that goals outside every map are refused, or accepted and then ended."""
    for put in trace.far:
        ended = put.read is not None and put.read.response.status == 404
        yield Case(
            400 <= put.exchange.response.status < 500 or ended,
            put.exchange,
            "422 (another 4xx conforms), or a goal that is accepted and ends",
            put.exchange.came if ended or put.read is None else f"a goal that is active {put.waited_s:g} s later",
        )


@rule("rest-resources/goal-put", on=(goal_reached,))
def new_goal_put(trace: GoalReached) -> Iterator[Outcome]:
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
def goal_outcome_when_reached(trace: GoalReached) -> Iterator[Outcome]:
    """Judge that the 404 after the goal reports that it was reached."""
    if trace.read is not None and trace.ended and trace.is_near:
        wrong = outcome_fault(trace.read, SUCCEEDED, "reached")
        yield Case(not wrong, trace.read, "a 404 with last_goal {goal_id, status}, which succeeded (code 4)", wrong)


@rule("rest-resources/goal-id-again", on=(goal_reached,))
def reached_goal_id_again(trace: GoalReached) -> Iterator[Outcome]:
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
