"""From settings and robot to the plan that is carried out first."""

from __future__ import annotations

from typing import TYPE_CHECKING

from loadtests.schedule.plan import Plan

if TYPE_CHECKING:
    from loadtests.clients.robot import Robot
    from loadtests.settings import Settings

_LEAST_USERS, _MOST_USERS = 32, 512
_STALL_S = 3.0  # the stall that the users of an open model outlast before arrivals queue for one


def duel_plan(settings: Settings, robot: Robot) -> tuple[Plan, list[str]]:
    """The plan of the duel between the interfaces, and notes on what cannot be measured."""
    interfaces, offers, missing = [], {}, set()
    for interface in settings.interfaces:
        for client in settings.clients:
            numbers = [
                number for number, name in enumerate(settings.operations) if robot.offers(interface, client, name)
            ]
            missing |= {
                f"{name} is not measured over {interface} ({client}): no endpoint or WSDL for it"
                for number, name in enumerate(settings.operations)
                if number not in numbers
            }
            offers[f"{interface}/{client}"] = numbers
        if any(offers[f"{interface}/{client}"] for client in settings.clients):
            interfaces.append(interface)
    clients = tuple(
        client for client in settings.clients if all(offers[f"{interface}/{client}"] for interface in interfaces)
    )
    workers = max(1, settings.expect)
    plan = Plan(
        operations=settings.operations,
        interfaces=tuple(interfaces),
        clients=clients,
        rate=settings.rate,
        users=settings.users,
        duration_s=settings.duration_s,
        warmup_s=settings.warmup_s,
        arrivals=settings.arrivals,
        seed=settings.seed,
        timeout_s=settings.timeout_s,
        workers=workers,
        connections=users(settings, workers),
        offers=offers,
    )
    return plan, sorted(missing)


def users(settings: Settings, workers: int) -> int:
    """How many users come up in all."""
    if settings.users is not None and not settings.step_rates:
        return settings.users
    rate = max(settings.rate or 0.0, *settings.step_rates, 0.0)
    each = min(_MOST_USERS, max(_LEAST_USERS, int(rate / workers * _STALL_S)))
    return each * workers
