"""Mutants of a moving device by rule: an effect, on an axis or in a direction, always or now and then.

Each mutant is a function that changes a body (body.py) in one way.
"""
# ruff: noqa: ARG001, ARG005 - effects of one kind have one signature

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, Final

from body import Body, Position

Change = Callable[[Body], None]
_NEAR_S = 0.1


def _on_target(
    effect: Callable[[Body, Position, Position], Position | None], when: Callable[[Body, Position], bool]
) -> Change:
    """Return a mutant that aims at another place; None: it does not move."""

    def change(body: Body) -> None:
        right = body.aim

        def aim(target: Position, seconds: float, now: float) -> None:
            there: Position | None = target
            if seconds > _NEAR_S / 10 and when(body, target):  # a stop aims at where it is
                there = effect(body, target, body.at(now))
            if there is not None:
                right(there, seconds, now)

        body.aim = aim  # type: ignore[method-assign]

    return change


def _always(_: Body, __: Position) -> bool:
    return True


def _in_three(body: Body, _: Position) -> bool:
    return body.moves % 3 == 0


def _below(body: Body, target: Position) -> bool:
    return any(value < 0 for value in target.values())


def _far(body: Body, target: Position) -> bool:
    return any(value in body.limits[name] for name, value in target.items())


_WHEN = {"": _always, "@third": _in_three, "@negative": _below, "@limits": _far}


def _along(axis: str) -> dict[str, Callable[[Body, Position, Position], Position | None]]:
    """Return the effects on one axis."""

    def but(value: Callable[[float, float], float]) -> Callable[[Body, Position, Position], Position]:
        return lambda _, target, here: {**target, axis: value(target[axis], here[axis])}

    return {
        "short": but(lambda target, here: here + 0.85 * (target - here)),
        "beyond": but(lambda target, _: 1.15 * target),
        "mirrored": but(lambda target, _: -target),
        "offset": but(lambda target, _: target + 0.06),
        "frozen": but(lambda _, here: here),
    }


def target_mutants(axes: list[str]) -> Iterator[tuple[str, Change]]:
    """Yield mutants that go elsewhere, in time or not."""
    for axis in axes:
        for name, effect in _along(axis).items():
            yield f"{name}:{axis}", _on_target(effect, _always)
    first, second = axes
    swap = lambda _, target, __: {first: target[second], second: target[first]}  # noqa: E731
    yield "swapped", _on_target(swap, _always)
    for when in ("@third", "@negative", "@limits"):
        yield f"short:{first}{when}", _on_target(_along(first)["short"], _WHEN[when])
    yield "dropped@third", _on_target(lambda *_: None, _in_three)
    yield "home@third", _on_target(lambda *_: dict.fromkeys(axes, 0.0), _in_three)
    yield "late", _timed(lambda seconds: seconds * 3 + 0.9)
    yield "too-fast", _timed(lambda seconds: seconds * 0.08)
    yield "starts-late", _delayed(1.2)
    yield "comes-back", _after_move(lambda body, start, target: start, 0.1)
    yield "drifts", _said_with(lambda body, here, still_s: {**here, first: here[first] + min(0.3, 0.3 * still_s)})
    yield (
        "trembles",
        _said_with(lambda body, here, _: {**here, second: here[second] + (0.1 if int(body.now() * 8) % 2 else -0.1)}),
    )


def _timed(seconds_of: Callable[[float], float]) -> Change:
    def change(body: Body) -> None:
        right = body.go
        body.go = lambda target, seconds: right(target, seconds_of(seconds))  # type: ignore[method-assign]

    return change


def _delayed(delay_s: float) -> Change:
    def change(body: Body) -> None:
        right = body.aim

        def go(target: Position, seconds: float) -> None:
            body.moves += 1
            body.later.append((body.now() + delay_s, lambda due: right(target, seconds, due)))

        body.go = go  # type: ignore[method-assign]

    return change


def _after_move(where: Callable[[Body, Position, Position], Position], wait_s: float) -> Change:
    """Return a mutant that goes on to another place a moment after each move."""

    def change(body: Body) -> None:
        right = body.go

        def go(target: Position, seconds: float) -> None:
            start = body.at(body.now())
            right(target, seconds)
            there = where(body, start, target)
            body.later.append((body.now() + seconds + wait_s, lambda due: body.aim(there, 0.3, due)))

        body.go = go  # type: ignore[method-assign]

    return change


def _said_with(effect: Callable[[Body, Position, float], Position]) -> Change:
    """Return a mutant that is elsewhere once it has arrived; the effect gets its position and how long it rests, s."""

    def change(body: Body) -> None:
        right = body._at  # noqa: SLF001 - the mechanics themselves

        def at(now: float) -> Position:
            here = right(now)
            still_s = now - body.began - body.seconds
            return effect(body, here, still_s) if still_s > 0 and not any(body.speeds.values()) else here

        body._at = at  # type: ignore[method-assign]  # noqa: SLF001

    return change


def second_mutants() -> Iterator[tuple[str, Change]]:
    """Yield mutants that treat a second move under way wrongly."""

    def _driven(effect: Callable[[Body, Position, float, Callable[[Position, float, float], None]], None]) -> Change:
        def change(body: Body) -> None:
            right, aim = body.go, body.aim

            def go(target: Position, seconds: float) -> None:
                if body.moving(body.now()):
                    body.moves += 1
                    effect(body, target, seconds, aim)
                else:
                    right(target, seconds)

            body.go, body.takes_second = go, True  # type: ignore[method-assign]

        return change

    def later(body: Body, target: Position, seconds: float, aim: Any) -> None:
        body.later.append((body.began + body.seconds, lambda due: aim(target, seconds, due)))

    def back(body: Body, target: Position, seconds: float, aim: Any) -> None:
        first = dict(body.target)
        aim(target, seconds, body.now())
        body.later.append((body.now() + seconds + 0.2, lambda due: aim(first, seconds, due)))

    def between(body: Body, target: Position, seconds: float, aim: Any) -> None:
        aim({name: (value + body.target[name]) / 2 for name, value in target.items()}, seconds, body.now())

    yield "second-ignored", _driven(lambda *_: None)
    yield "second-queued", _driven(later)
    yield "second-then-first", _driven(back)
    yield "second-between", _driven(between)
    yield "second-stops", _driven(lambda body, target, seconds, aim: body.halt(body.now()))


def stop_mutants(axes: list[str]) -> Iterator[tuple[str, Change]]:
    """Yield mutants that do not stop, or not for good."""

    def _driven(effect: Callable[[Body, float, Callable[[float], None]], None]) -> Change:
        def change(body: Body) -> None:
            right = body.halt
            body.halt = lambda now: effect(body, now, right)  # type: ignore[method-assign]

        return change

    def only_moving(
        effect: Callable[[Body, float, Callable[[float], None]], None],
    ) -> Callable[[Body, float, Callable[[float], None]], None]:
        return lambda body, now, right: effect(body, now, right) if body.moving(now) else right(now)

    def then(there: Callable[[Body], Position], wait_s: float) -> Change:
        def effect(body: Body, now: float, right: Callable[[float], None]) -> None:
            target = there(body)
            right(now)
            body.later.append((now + wait_s, lambda due: body.aim(target, 0.5, due)))

        return _driven(only_moving(effect))

    def creep(body: Body, now: float, _: Any) -> None:
        here, target = body.at(now), body.target
        body.aim({name: one + 0.4 * (target[name] - one) for name, one in here.items()}, 3.0, now)

    def one_axis(body: Body, now: float, _: Any) -> None:
        body.aim({**body.at(now), axes[0]: body.target[axes[0]]}, 0.4, now)

    def half(body: Body, now: float, right: Callable[[float], None]) -> None:
        body.stops = getattr(body, "stops", 0) + 1  # type: ignore[attr-defined]
        if body.stops % 2 == 0:  # type: ignore[attr-defined]
            right(now)

    yield "stop-held-back", _driven(only_moving(_held_back))
    yield "stop-ignored", _driven(only_moving(lambda *_: None))
    yield "stop-late", _driven(only_moving(lambda body, now, right: body.later.append((now + 0.6, right))))
    yield "stop-half", _driven(only_moving(half))
    yield "stop-creeps", _driven(only_moving(creep))
    yield "stop-one-axis", _driven(only_moving(one_axis))
    yield "stop-resumes", then(lambda body: dict(body.target), 0.8)
    yield "stop-goes-home", then(lambda body: dict.fromkeys(axes, 0.0), 0.4)
    yield "stop-goes-back", then(lambda body: dict(body.start), 0.3)


def _held_back(body: Body, _: float, right: Callable[[float], None]) -> None:
    body.sleep(1.5)
    right(body.now())


def _mixed(body: Body) -> None:
    """Take the first axis of one command and the others of the one before, if both come at once."""
    right, last = body.drive, [(-1.0, dict[str, float]())]

    def drive(speeds: Position, hold_s: float, now: float) -> None:
        (then, before), last[0] = last[0], (now, speeds)
        mixed = {name: (before if number else speeds)[name] for number, name in enumerate(speeds)} if before else speeds
        right(mixed if now - then < 0.01 else speeds, hold_s, now)

    body.drive = drive  # type: ignore[method-assign]


def _resumed(body: Body) -> None:
    """Drive the last velocity again after a move was stopped."""
    drive, halt, last = body.drive, body.halt, [dict[str, float]()]

    def driven(speeds: Position, hold_s: float, now: float) -> None:
        last[0] = speeds
        drive(speeds, hold_s, now)

    def halted(now: float) -> None:
        moving = body.moving(now)
        halt(now)
        if moving and any(last[0].values()):
            body.later.append((now + 0.4, lambda due: drive(last[0], 0.8, due)))

    body.drive, body.halt = driven, halted  # type: ignore[method-assign]


def _asleep(body: Body) -> None:
    """Let the hold time end only when somebody asks."""
    right, woken = body.at, [0.0]

    def at(now: float) -> Position:
        if any(body.speeds.values()) and now >= body.held_until and woken[0] != body.began:
            woken[0] = body.began
            body.held_until = now + 0.15
        return right(now)

    body.at = at  # type: ignore[method-assign]


def _zero_held_back(body: Body) -> None:
    right = body.drive

    def drive(speeds: Position, hold_s: float, now: float) -> None:
        if not any(speeds.values()):
            body.sleep(1.5)
            now = body.now()
        right(speeds, hold_s, now)

    body.drive = drive  # type: ignore[method-assign]


def reading_mutants(axes: list[str]) -> Iterator[tuple[str, Change]]:
    """Yield mutants whose readings are old or wrong."""

    def stale(every_s: float) -> Change:
        def change(body: Body) -> None:
            said: list[tuple[float, Position]] = []

            def old(now: float) -> Position:
                if not said or now - said[-1][0] > every_s:
                    said.append((now, body.at(now)))
                return said[-1][1]

            body.said = old  # type: ignore[method-assign]

        return change

    def said(effect: Callable[[Body, float], Position]) -> Change:
        def change(body: Body) -> None:
            body.said = lambda now: effect(body, now)  # type: ignore[method-assign]

        return change

    def stamped(stamp: Callable[[float], float]) -> Change:
        def change(body: Body) -> None:
            body.stamp = stamp  # type: ignore[method-assign]

        return change

    yield "stale", stale(0.6)
    yield "frozen-reading", said(lambda body, now: {**body.at(now), axes[1]: 0.0})
    yield "mirrored-reading", said(lambda body, now: {**body.at(now), axes[0]: -body.at(now)[axes[0]]})
    yield "scaled-reading", said(lambda body, now: {name: 57.3 * one for name, one in body.at(now).items()})
    yield "target-as-reading", said(lambda body, now: dict(body.target))
    yield "stamp-stuck", stamped(lambda _: 5.0)
    yield "stamp-back", stamped(lambda now: 1e6 - now)


def action_mutants() -> Iterator[tuple[str, Change]]:
    """Yield mutants that say something else of a move."""

    def said(words: dict[str, str]) -> Change:
        def change(body: Body) -> None:
            right = body.action
            body.action = lambda: words.get(right(), right())  # type: ignore[method-assign]

        return change

    yield "action-early", said({"running": "done"})
    yield "action-endless", said({"done": "running"})
    yield "action-stopped-as-done", said({"stopped": "done"})
    yield "action-running-as-stopped", said({"running": "stopped"})


def _driven(effect: Callable[[Body, Position, float], tuple[Position, float] | None]) -> Change:
    """Return a mutant that drives at other speeds, or for another time; None: it does not drive."""

    def change(body: Body) -> None:
        right = body.drive

        def drive(speeds: Position, hold_s: float, now: float) -> None:
            found = effect(body, speeds, hold_s)
            if found is not None:
                right(*found, now)

        body.drive = drive  # type: ignore[method-assign]

    return change


def velocity_mutants(axes: list[str]) -> Iterator[tuple[str, Change]]:
    """Yield mutants that take a velocity wrongly, or do not let go."""

    def times(factor: float, axis: str) -> Change:
        return _driven(lambda body, speeds, hold_s: ({**speeds, axis: factor * speeds[axis]}, hold_s))

    def half(body: Body, speeds: Position, hold_s: float) -> tuple[Position, float]:
        body.drives = getattr(body, "drives", 0) + 1  # type: ignore[attr-defined]
        return speeds, hold_s if body.drives % 2 else 60.0  # type: ignore[attr-defined]

    def deaf(body: Body, speeds: Position, hold_s: float) -> tuple[Position, float] | None:
        again = speeds == body.speeds and body.now() < body.held_until
        return None if again else (speeds, hold_s)

    yield "velocity-stop-held-back", _zero_held_back
    for axis in axes:
        yield f"velocity-slow:{axis}", times(0.7, axis)
        yield f"velocity-fast:{axis}", times(1.3, axis)
        yield f"velocity-mirrored:{axis}", times(-1.0, axis)
        yield f"velocity-ignored:{axis}", times(0.0, axis)
    yield "velocity-swapped", _driven(lambda _, speeds, hold_s: (_swapped(speeds), hold_s))
    yield (
        "velocity-stop-ignored",
        _driven(lambda _, speeds, hold_s: (speeds, hold_s) if any(speeds.values()) else None),
    )
    yield (
        "velocity-stop-creeps",
        _driven(lambda _, speeds, hold_s: (speeds if any(speeds.values()) else dict.fromkeys(axes, 0.15), 60.0)),
    )
    yield "watchdog-none", _driven(lambda _, speeds, hold_s: (speeds, 60.0))
    yield "watchdog-late", _driven(lambda _, speeds, hold_s: (speeds, 2.5 * hold_s))
    yield "watchdog-half", _driven(half)
    yield "watchdog-asleep", _asleep
    yield "velocities-mixed", _mixed
    yield "resumes-after-stop", _resumed
    yield "not-renewed", _driven(deaf)
    yield "hold-short", _driven(lambda _, speeds, hold_s: (speeds, 0.3 * hold_s))


def _lapsing(every: int) -> Change:
    """Return a mutant that drives on for long at every so manieth end of a hold time."""

    def change(body: Body) -> None:
        right, ended, turn = body.drive, [0], [0]

        def drive(speeds: Position, hold_s: float, now: float) -> None:
            turn[0] += 1
            right(speeds, hold_s, now)
            if any(speeds.values()):
                body.later.append((now + hold_s - 1e-3, partial(end, turn[0], speeds)))

        def end(began: int, speeds: Position, due: float) -> None:
            if began == turn[0]:
                ended[0] += 1
                if ended[0] % every == 0:
                    right(speeds, 10.0, due)

        body.drive = drive  # type: ignore[method-assign]

    return change


_CREEP: Final = 0.02


def _creeping_after_zero(body: Body) -> None:
    right = body.drive

    def drive(speeds: Position, hold_s: float, now: float) -> None:
        still = not any(speeds.values())
        right(dict.fromkeys(speeds, _CREEP) if still else speeds, 60.0 if still else hold_s, now)

    body.drive = drive  # type: ignore[method-assign]


def _creeping_after_hold(body: Body) -> None:
    right, turn = body.drive, [0]

    def drive(speeds: Position, hold_s: float, now: float) -> None:
        turn[0] += 1
        right(speeds, hold_s, now)
        if any(speeds.values()):
            body.later.append((now + hold_s, partial(creep, turn[0], speeds)))

    def creep(began: int, speeds: Position, due: float) -> None:
        if began == turn[0]:
            right(dict.fromkeys(speeds, _CREEP), 60.0, due)

    body.drive = drive  # type: ignore[method-assign]


def _creeping_after_stop(body: Body, rests_s: float = 0.0, lasts_s: float = 60.0) -> None:
    right = body.halt

    def halt(now: float) -> None:
        moving = body.moving(now)
        right(now)
        if moving:
            creep = partial(body.drive, dict.fromkeys(body.limits, _CREEP), lasts_s)
            body.later.append((now + rests_s, creep))

    body.halt = halt  # type: ignore[method-assign]


def _zero(effect: Callable[[Body, Position, float, Callable[[Position, float, float], None]], None]) -> Change:
    """Return a mutant of what velocity 0 does to a body that drives; the effect gets the velocity before."""

    def change(body: Body) -> None:
        right = body.drive

        def drive(speeds: Position, hold_s: float, now: float) -> None:
            before = dict(body.velocity(now))
            if any(speeds.values()) or not any(before.values()):
                right(speeds, hold_s, now)
            else:
                effect(body, before, now, right)

        body.drive = drive  # type: ignore[method-assign]

    return change


def _resuming(body: Body, before: Position, now: float, right: Callable[[Position, float, float], None]) -> None:
    right(dict.fromkeys(before, 0.0), 0.0, now)
    body.later.append((now + 0.45, lambda due: right(before, 1.0, due)))


def _after_refusal(effect: Callable[[Body, float], None]) -> Change:
    """Return a mutant of what a refused velocity does to a body that drives."""

    def change(body: Body) -> None:
        body.refused = lambda now: effect(body, now) if any(body.velocity(now).values()) else None  # type: ignore[method-assign]

    return change


def finer_velocity_mutants(axes: list[str]) -> Iterator[tuple[str, Change]]:
    """Yield mutants that take some velocities wrongly, now and then, or come to rest slowly or not quite."""
    first, second = axes

    def goes_on(when: Callable[[Position], bool]) -> Change:
        return _driven(lambda _, speeds, hold_s: (speeds, 60.0 if when(speeds) else hold_s))

    def but(axis: str, value: Callable[[float], float]) -> Change:
        return _driven(lambda _, speeds, hold_s: ({**speeds, axis: value(speeds[axis])}, hold_s))

    yield (
        "velocity-deadband",
        _driven(lambda _, v, hold_s: ({a: x if abs(x) > 0.17 else 0.0 for a, x in v.items()}, hold_s)),
    )
    yield (
        "velocity-half-when-both",
        _driven(lambda _, v, hold_s: ({a: x / 2 for a, x in v.items()} if all(v.values()) else v, hold_s)),
    )
    for axis in axes:
        yield f"velocity-short-of-least:{axis}", but(axis, lambda x: max(x, -0.35))
        yield f"velocity-forwards-only:{axis}", but(axis, lambda x: max(x, 0.0))
    yield "watchdog-none-when-slow", goes_on(lambda v: 0 < max(map(abs, v.values())) < 0.35)
    yield "watchdog-none-when-both", goes_on(lambda v: all(v.values()))
    yield f"watchdog-none-back:{first}", goes_on(lambda v: v[first] < 0)
    yield "watchdog-one-in-four", _lapsing(4)
    yield "watchdog-one-in-two", _lapsing(2)
    yield "velocity-stop-creeps-on", _creeping_after_zero
    yield "watchdog-creeps-on", _creeping_after_hold
    yield "stop-creeps-on", _creeping_after_stop
    yield "stop-creeps-for-a-second", partial(_creeping_after_stop, rests_s=0.9, lasts_s=1.0)
    yield "velocity-stop-late", _zero(lambda body, v, now, right: right(v, 0.9, now))
    yield "velocity-resumes", _zero(_resuming)
    yield "refused-stops", _after_refusal(lambda body, now: body.drive(dict.fromkeys(axes, 0.0), 0.0, now))
    yield "refused-renews", _after_refusal(lambda body, now: setattr(body, "held_until", now + 0.4))
    yield "integers-refused", lambda body: setattr(body, "refuses_integers", True)
    yield f"velocity-reversed-second:{second}", but(second, lambda x: -x)


def agreement_mutants(axes: list[str]) -> Iterator[tuple[str, Change]]:
    """Yield mutants of which another resource tells another velocity."""

    def told(effect: Callable[[Body, float], Position]) -> Change:
        def change(body: Body) -> None:
            body.velocity_elsewhere = lambda now: effect(body, now)  # type: ignore[method-assign]

        return change

    yield "elsewhere-still", told(lambda _, now: dict.fromkeys(axes, 0.0))
    yield "elsewhere-as-commanded", told(lambda body, now: body.speeds)
    yield "elsewhere-in-other-units", told(lambda body, now: {a: 3.6 * v for a, v in body.velocity(now).items()})


def _swapped(speeds: Position) -> Position:
    return dict(zip(speeds, reversed(speeds.values()), strict=True))


def switch_mutants() -> Iterator[tuple[str, Change]]:
    """Yield mutants of a gripper."""

    def _driven(effect: Callable[[Body, str, float, Callable[[str, float], None]], None]) -> Change:
        def change(body: Body) -> None:
            right = body.grip
            body.grip = lambda state, now: effect(body, state, now, right)  # type: ignore[method-assign]

        return change

    def falls_back(body: Body, state: str, now: float, right: Callable[[str, float], None]) -> None:
        before = body.gripper(now)
        right(state, now)
        body.later.append((now + 0.2, lambda due: right(before, due)))

    def late(body: Body, state: str, now: float, right: Callable[[str, float], None]) -> None:
        body.later.append((now + 1.0, lambda due: right(state, due)))

    yield "grip-ignored", _driven(lambda *_: None)
    yield (
        "grip-late",
        _driven(lambda body, state, now, right: body.later.append((now + 1.0, lambda due: right(state, due)))),
    )
    yield "grip-falls-back", _driven(falls_back)
    yield "grip-one-way", _driven(lambda body, state, now, right: right("open", now))


def of_arm() -> dict[str, Change]:
    """Return the mutants of the arm."""
    axes = ["pan", "tilt"]
    groups = (target_mutants(axes), second_mutants(), stop_mutants(axes), reading_mutants(axes), action_mutants())
    return {name: change for group in groups for name, change in group}


def of_rover() -> dict[str, Change]:
    """Return the mutants of the rover, which refuses a second move."""
    axes = ["x", "y"]
    groups = (target_mutants(axes), second_mutants(), stop_mutants(axes), reading_mutants(axes))
    more = (velocity_mutants(axes), agreement_mutants(axes), switch_mutants())
    return {name: change for group in (*groups, *more) for name, change in group}


def of_dome() -> dict[str, Change]:
    """Return the mutants of the camera, which says nothing of a move."""
    axes = ["pan", "tilt"]
    groups = (target_mutants(axes), second_mutants(), stop_mutants(axes), reading_mutants(axes), velocity_mutants(axes))
    return {name: change for group in groups for name, change in group}
