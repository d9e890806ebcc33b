"""The first plan of a run, from settings and robot."""

from conformance.packs.table1.thresholds import ApiStyle
from loadtests.clients.library import LIBRARY
from loadtests.clients.robot import Robot
from loadtests.schedule.plan import LIBRARY_RATE, Plan
from loadtests.settings.settings import Settings

ROSBRIDGE = ApiStyle.ROSBRIDGE


_BRIDGE_NOTE = (
    "rosbridge does not answer a publish: a delivery is timed until its echo is back, which has been through ROS, "
    "and a pose from subscribing until the robot's next odometry"
)
_LEAST_USERS, _MOST_USERS = 32, 512
_STALL_S = 3.0  # users of an open model suffice for a stall of this length before arrivals wait for a user


def duel_plan(settings: Settings, *robots: Robot) -> tuple[Plan, list[str]]:
    """Return the plan that compares two interfaces or two robots, and notes on what cannot be measured."""
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
    )
    notes = sorted(missing)
    if ROSBRIDGE in interfaces:
        notes.append(_BRIDGE_NOTE)
    return plan, notes


def users(settings: Settings, workers: int) -> int:
    """Return how many users to start in total."""
    load, steps = settings.load, settings.steps
    if load.users is not None and not steps.rates:
        return max(load.users, *steps.connections, 0)
    rate = max(load.rate or 0.0, *steps.rates, 0.0)
    each = min(_MOST_USERS, max(_LEAST_USERS, int(rate / workers * _STALL_S)))
    return max(each * workers, *steps.connections, 0)
