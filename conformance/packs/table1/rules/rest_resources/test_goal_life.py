"""Rules on the scenario goal_life: a goal is sent, repeated, contradicted, replaced and cancelled."""

from collections.abc import Iterator

from conformance.packs.table1.robot.drive_rules import outcomes
from conformance.packs.table1.robot.goal import CANCELED, CANCELLED, NEW, REPEATED, outcome_fault, status_fault
from conformance.packs.table1.robot.goal_trace import GoalLife, Put
from conformance.packs.table1.scenarios.goal_life import ID, goal_life
from conformance.packs.table1.statement import said_of
from conformance.scenarios.rule import Outcome, rule
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
