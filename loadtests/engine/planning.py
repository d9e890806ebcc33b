"""The plans of a run: the first, from settings and robot, and further ones while a comparison of two is undecided."""

from collections.abc import Callable, Sequence

from loadtests.clients.payloads import LIBRARY, ROSBRIDGE
from loadtests.clients.robot import Robot
from loadtests.schedule.plan import BLOCK_S, LIBRARY_RATE, Plan
from loadtests.settings.settings import Against, Settings
from loadtests.statistics.against import UNCLEAR, against
from loadtests.statistics.comparisons import aa_controls
from loadtests.statistics.measured import Measured
from loadtests.statistics.recorder import Recorder

_BRIDGE_NOTE = (
    "rosbridge does not answer a publish: a delivery is timed until its echo is back, which has been through ROS, "
    "and a pose from subscribing until the robot's next odometry"
)
_LEAST_USERS, _MOST_USERS = 32, 512
_LONG_BLOCK_S, _SCENARIO_BLOCKS = 1.0, 60  # fifteen quartets, of which six are the A/A control
_STALL_S = 3.0  # users of an open model suffice for a stall of this length before arrivals wait for a user


def duel_plan(settings: Settings, *robots: Robot) -> tuple[Plan, list[str]]:
    """Return the plan that compares two interfaces or robots, and notes on what cannot be measured."""
    wanted = settings.selection
    workers = max(1, settings.generator.expect)
    interfaces, offers, missing = [], {}, set()
    both = " on both robots" if len(robots) > 1 else ""
    chosen = wanted.clients
    if (settings.load.rate or 0.0) > LIBRARY_RATE * workers and len(chosen) > 1:
        chosen = tuple(name for name in chosen if name != LIBRARY)
        missing.add(
            f"zeep is not measured: at {settings.load.rate:g} requests/s it would take the generator's whole "
            f"processor; at up to {LIBRARY_RATE * workers:g}/s, or with more --processes, it runs at the wire "
            "client's rate"
        )
    for interface in wanted.interfaces:
        for client in chosen:
            numbers = [
                number
                for number, name in enumerate(wanted.operations)
                if all(robot.offers(interface, client, name) for robot in robots)
            ]
            missing |= {
                f"{name} is not measured over {interface} ({client}): no endpoint or WSDL for it{both}"
                for number, name in enumerate(wanted.operations)
                if number not in numbers and (interface, client) != (ROSBRIDGE, LIBRARY)
            }
            offers[f"{interface}/{client}"] = numbers
        if any(offers[f"{interface}/{client}"] for client in chosen):
            interfaces.append(interface)
    clients = tuple(
        client
        for client in chosen
        if all(offers[f"{interface}/{client}"] for interface in interfaces if interface != ROSBRIDGE)
        and any(offers[f"{interface}/{client}"] for interface in interfaces)
    )
    plan = Plan(
        operations=wanted.operations,
        interfaces=tuple(interfaces),
        clients=clients,
        load=settings.load,
        timeout_s=max(robot.timeout_s for robot in robots),
        workers=workers,
        connections=users(settings, workers),
        offers=offers,
        robots=len(robots),
        weights=wanted.weights,
        scenario=settings.scenario is not None,
        least_block_s=BLOCK_S if settings.scenario is None else _scenario_block_s(settings.load.duration_s),
    )
    notes = sorted(missing)
    if ROSBRIDGE in interfaces:
        notes.append(_BRIDGE_NOTE)
    return plan, notes


def _scenario_block_s(duration_s: float) -> float:
    """Return the length of a scenario's blocks: users that wait between tasks leave short ones empty, in step."""
    return min(_LONG_BLOCK_S, max(BLOCK_S, duration_s / _SCENARIO_BLOCKS))


def users(settings: Settings, workers: int) -> int:
    """Return how many users to start in total."""
    load, steps = settings.load, settings.steps
    if load.users is not None:
        return load.users
    each = int((load.rate or 0.0) / workers * _STALL_S)
    return workers * (_MOST_USERS if steps.has_searches else min(_MOST_USERS, max(_LEAST_USERS, each)))


def until_decided(
    plan: Plan,
    other: Against,
    recorder: Recorder,
    deviation: float,
    carry_out: Callable[[Plan], None],
    is_over: Callable[[], bool],
    tell: Callable[[str], None],
) -> Plan:
    """Measure further parts while the comparison is undecided and the settings allow it; return the last plan.

    Args:
        plan: what was carried out before.
        other: the settings of the comparison.
        recorder: the records.
        deviation: relative standard deviation of the ratio between runs.
        carry_out: carries out a plan.
        is_over: whether the run has to end.
        tell: says what happens.
    """
    plans = [plan]
    for look in other.looks[1:]:
        if is_over() or not _is_unclear(plans, other, recorder, deviation):
            break
        seconds = (look - len(plans)) * plan.load.duration_s
        tell(f"not clear yet whether this robot is slower than the other: measuring for another {seconds:g} s")
        while len(plans) < look and not is_over():
            plans.append(plans[-1].more())
            carry_out(plans[-1])
    return plans[-1]


def _is_unclear(plans: Sequence[Plan], other: Against, recorder: Recorder, deviation: float) -> bool:
    recorder.flush()
    measured = Measured(plans, recorder)
    found = against(measured, aa_controls(measured), other.tolerance, len(other.looks), {}, deviation)
    return found.verdict == UNCLEAR
