"""One state in XML, text and JSON: in motion, at rest elsewhere, for several goals and for several plans.

At rest at the start most values are zero. A format that serves old values shows them first after a change; so the first
reading after each change counts, and a fault must show after each of several changes. One difference may be an odometry
sample that came between two reads.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Final

from conformance.api.rest.applicable import reads
from conformance.api.rest.calls import JSON, XML, Call
from conformance.api.rest.formats import Disagreement, Found, disagreements, each_after, one_turn
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.validity import require_valid
from conformance.packs.table1.robot.drive import Drive, there_and_back
from conformance.packs.table1.robot.goal import (
    await_goal,
    await_none,
    choose_goals,
    goal_body,
    in_turn,
    is_there,
    make_room,
    put_goal,
)
from conformance.packs.table1.robot.plan import reachable
from conformance.packs.table1.robot.robot import GOAL_PATH, LINEAR, PLAN, POSE, STILL, VELOCITY, Robot, put_as_xml
from conformance.scenarios.scenario import NoOccasionError, scenario
from conformance.scenarios.stage import Leaves, Need, Stage
from conformance.transport.exchange import Exchange
from conformance.verdict.effort import Effort

# After this many changes of one kind the first reading must be wrong to count.
_CHANGES: Final = 3
# Ids that some version of YAML reads as another type if they are not quoted.
_LIKE_OTHER_TYPES: Final = ("123", "null", "true", "-1.5", "0x1F")
# How often a goal is tried: over a slow link, or if the robot arrives soon, it may end before it is read.
_TRIES: Final = 3


@dataclass(frozen=True)
class FormatsRead:
    """A resource in all of its formats, or a goal that was PUT as XML.

    Attributes:
        template, operation: path template and operation id of the resource.
        exchange: the exchange whose response differs from JSON, or the last JSON exchange.
        differs: the value in both formats; empty if all formats agree.
        put: whether XML was sent; then ``differs`` is where the robot's JSON differs from it.
    """

    template: str
    operation: str
    exchange: Exchange
    differs: str = ""
    put: bool = False

    @classmethod
    def of(cls, call: Call, exchange: Exchange, found: Disagreement | None = None) -> "FormatsRead":
        """Return the record of readings, of which ``exchange`` is the last."""
        operation = call.operation
        if found is None:
            return cls(operation.template, operation.id, exchange)
        return cls(operation.template, operation.id, found.exchange, found.description)


@scenario(needs={Need.REST, Need.MOTION})
def formats_in_motion(api: RestInterface, robot: Robot, effort: Effort) -> tuple[FormatsRead, ...]:
    """Read pose and velocity in all formats while the robot drives an arc, and at rest after it."""
    calls = [call for call in reads(api) if call.operation.template in {POSE, VELOCITY, LINEAR} and _others(call)]
    if effort.name == "quick" or not calls:
        return ()  # formats are also compared at rest
    make_room(robot)
    drive = Drive(robot)
    compared: list[FormatsRead] = []
    # The differences that every first reading has had so far, by resource and kind of change.
    suspects: dict[tuple[str, bool], Found] = {}
    for change, wanted in there_and_back(drive, _CHANGES):
        robot.clock.sleep(robot.sample_s if change else 0.0)
        for call in calls:
            key = (call.operation.id, wanted == STILL)
            drive.command(wanted)
            found = one_turn(api, call, _others(call))[0]
            before = suspects.get(key, {}) if change else found
            suspects[key] = {place: item for place, item in found.items() if place in before}
        for call in () if change else calls:
            compared += _compare(api, call, partial(drive.command, wanted))
        if wanted == STILL and not any(suspects.values()):
            return tuple(compared)
    by_id = {call.operation.id: call for call in calls}
    left = ((by_id[id_], item) for (id_, _), found in suspects.items() for item in found.values())
    return (*compared, *(FormatsRead.of(call, item.exchange, item) for call, item in left))


@scenario(needs={Need.REST, Need.MOTION})
def formats_of_goals(api: RestInterface, robot: Robot, effort: Effort) -> tuple[FormatsRead, ...]:
    """PUT several goals, every other one as XML, and read each in all formats, from the first reading on."""
    call = _reader(api, GOAL_PATH)
    if call is None:
        return ()
    poses = choose_goals(robot, 1.5, 2)
    trace: list[FormatsRead] = []
    suspects: Found | None = None
    for number in range(effort.cases(12)):
        pose = in_turn(poses, number)
        body = goal_body(pose, robot.statement.motion.frame, f"formats {number}")
        accept = (JSON, XML)[number // 2 % 2]
        as_xml = put_as_xml(robot, GOAL_PATH, body, accept=accept) if number % 2 else None
        if as_xml is None or not as_xml.response.ok:
            as_xml = None
            put_goal(robot, body)
        goal, differs, _ = await_goal(robot, body)
        if as_xml is not None and not (goal is None and is_there(robot, pose)):
            trace.append(FormatsRead(GOAL_PATH, call.operation.id, as_xml, differs, put=True))
        # If earlier goals showed a difference, wait as long as a command may take.
        robot.clock.sleep(robot.settle_s if suspects else 0.0)
        found, exchange = one_turn(api, call, _others(call))
        # A format may learn of another goal later, but must show one whole goal.
        other_goal = {name for name, place in found if place == "goal_id.id"}
        odd = {key: one for key, one in found.items() if key[0] not in other_goal and not key[1].startswith("status.")}
        trace += [FormatsRead.of(call, disagreement.exchange, disagreement) for disagreement in odd.values()]
        suspects = found if suspects is None else {key: one for key, one in found.items() if key in suspects}
        if exchange.response.ok:
            trace.append(FormatsRead.of(call, exchange))
    robot.delete_goal()
    await_none(robot)
    return (
        *trace,
        *(FormatsRead.of(call, disagreement.exchange, disagreement) for disagreement in (suspects or {}).values()),
    )


@scenario(needs={Need.REST, Need.MOTION})
def goal_as_text(api: RestInterface, robot: Robot) -> tuple[tuple[str, Exchange], ...]:
    """PUT distant goals, and read each as text; return them by their ids, or nothing where text is not described."""
    if "text/plain" not in _others(_reader(api, GOAL_PATH)):
        return ()
    pose = choose_goals(robot, 1.5, 1)[0]
    read: list[tuple[str, Exchange]] = []
    for id_ in _LIKE_OTHER_TYPES:
        body = goal_body(pose, robot.statement.motion.frame, id_)
        for _ in range(_TRIES):
            put_goal(robot, body)
            await_goal(robot, body)
            exchange = robot.rest.send("GET", GOAL_PATH, headers=(("Accept", "text/plain"),))
            if exchange.response.ok:
                read.append((id_, exchange))
                break
    robot.delete_goal()
    await_none(robot)
    if not read:
        raise NoOccasionError(f"a goal with the id {_LIKE_OTHER_TYPES[0]} was never there when it was read")
    return tuple(read)


@scenario(needs={Need.REST}, leaves=Leaves.UNTOUCHED, stage=Stage.RESTING)
def formats_of_plans(api: RestInterface, robot: Robot, effort: Effort) -> tuple[FormatsRead, ...]:
    """Request several plans and read each in all formats, from the first reading on."""
    call = _reader(api, PLAN)
    here = robot.map_pose()
    if effort.name == "quick" or call is None or here is None:
        return ()  # one plan is compared in any case
    goals = reachable(robot, here, max(1.0, robot.statement.motion.radius_m), 3)

    def ask() -> Iterator[Call]:
        for number in range(1 + _CHANGES if goals else 0):
            goal, start = goals[number % len(goals)], goals[(number + 1) % len(goals)]
            given = {"x": goal.x, "y": goal.y, "yaw": 0.3 * number}
            given |= {"start_x": start.x, "start_y": start.y, "start_yaw": -0.4 * number}
            asked = call
            for name, value in given.items():
                asked = asked.having(name, repr(value))
            require_valid(api.run.contract, "GET", asked.path)
            yield asked

    return _first(api, ask())


def _compare(api: RestInterface, call: Call, renew: Callable[[], object]) -> list[FormatsRead]:
    """Read a resource in all formats until they agree, a few times; return nothing where it has no JSON.

    Each format is preferred to the others, as some clients do.
    """
    found, exchange = disagreements(api, call, _others(call), renew, each_after(renew))
    return [FormatsRead.of(call, exchange, found[0] if found else None)] if exchange.response.ok else []


def _first(api: RestInterface, changes: Iterator[Call]) -> tuple[FormatsRead, ...]:
    """Return the differences in the first reading after each change except the first one."""
    left: Found | None = None
    for number, call in enumerate(changes):
        found, exchange = one_turn(api, call, _others(call))
        if number:
            left = found if left is None else {place: item for place, item in found.items() if place in left}
        if left == {}:
            return (FormatsRead.of(call, exchange),) if exchange.response.ok else ()
    return tuple(FormatsRead.of(call, item.exchange, item) for item in (left or {}).values())


def _reader(api: RestInterface, template: str) -> Call | None:
    """Return the GET of a resource that has several formats, or None."""
    return next((call for call in reads(api) if call.operation.template == template and _others(call)), None)


def _others(call: Call | None) -> list[str]:
    """Return the formats of a resource other than JSON."""
    return [name for name in call.operation.formats if name != JSON] if call else []
