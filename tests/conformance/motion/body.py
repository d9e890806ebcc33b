"""The mechanics that the simulated devices share: two axes that move in straight lines, right or with one mutation."""

import random
import time
from collections.abc import Callable
from dataclasses import dataclass, field

Position = dict[str, float]


@dataclass
class Body:
    """Two axes.

    Args:
        limits: least and greatest position by axis.
        now: returns the time, s.
        sleep: waits for some time, s.
        noise: standard deviation of what it says of its position.
        seed: of the noise and of what a mutant leaves to chance.

    A mutant (mutants.py) replaces one of its methods.

    Attributes:
        moves: how many moves it has taken.
        takes_second: whether a device that takes one move at a time takes a second one all the same.
        refuses_integers: whether it refuses numbers that are written without a fraction.
        state: what the last move says of itself.
        later: what it does later, by time.
    """

    limits: dict[str, tuple[float, float]]
    now: Callable[[], float] = time.monotonic
    sleep: Callable[[float], None] = time.sleep
    noise: float = 0.0
    seed: int = 0
    moves: int = 0
    takes_second: bool = False
    refuses_integers: bool = False
    state: str = "done"
    later: list[tuple[float, Callable[[float], None]]] = field(default_factory=list)

    def __post_init__(self) -> None:
        """Stand still in the middle."""
        self.chance = random.Random(self.seed)  # noqa: S311 - no secret
        self.start = dict.fromkeys(self.limits, 0.0)
        self.target = dict(self.start)
        self.began, self.seconds = self.now(), 0.01
        self.speeds = dict.fromkeys(self.limits, 0.0)
        self.held_until = 0.0
        self.gripped = "open"

    def at(self, now: float) -> Position:
        """Return where it is, after what was due until now."""
        while due := [one for one in self.later if one[0] <= now]:
            first = min(due, key=lambda one: one[0])
            self.later.remove(first)
            first[1](first[0])
        return self._at(now)

    def _at(self, now: float) -> Position:
        if any(self.speeds.values()):
            driven_s = max(0.0, min(now, self.held_until) - self.began)
            return {name: value + driven_s * self.speeds[name] for name, value in self.start.items()}
        share = min(1.0, max(0.0, (now - self.began) / self.seconds))
        if share == 1.0 and self.state == "running":
            self.state = "done"
        return {name: self.start[name] + share * (self.target[name] - self.start[name]) for name in self.limits}

    def velocity(self, now: float) -> Position:
        """Return how fast it drives by velocity."""
        return self.speeds if now < self.held_until else dict.fromkeys(self.limits, 0.0)

    def velocity_elsewhere(self, now: float) -> Position:
        """Return how fast another resource says that it drives."""
        return self.velocity(now)

    def moving(self, now: float) -> bool:
        """Return whether it is on its way to a target."""
        self.at(now)
        return now < self.began + self.seconds and self.state == "running"

    def go(self, target: Position, seconds: float) -> None:
        """Take a move."""
        self.moves += 1
        self.aim(target, seconds, self.now())

    def aim(self, target: Position, seconds: float, now: float) -> None:
        """Set out to a target."""
        self.start = self.at(now)
        self.speeds = dict.fromkeys(self.limits, 0.0)
        self.target, self.began, self.seconds, self.state = dict(target), now, max(seconds, 1e-3), "running"

    def drive(self, speeds: Position, hold_s: float, now: float) -> None:
        """Take velocities, for at most so long."""
        self.start = self.at(now)
        self.target, self.began, self.seconds, self.state = dict(self.start), now, 1e-3, "done"
        self.speeds, self.held_until = dict(speeds), now + hold_s

    def refused(self, now: float) -> None:
        """Take note of a velocity that was refused."""

    def halt(self, now: float) -> None:
        """Stop where it is."""
        moving = self.moving(now)
        self.aim(self.at(now), 1e-3, now)
        self.state = "stopped" if moving else "done"

    def grip(self, state: str, now: float) -> None:
        """Set the gripper."""
        self.at(now)
        self.gripped = state

    def gripper(self, now: float) -> str:
        """Return the gripper's state."""
        self.at(now)
        return self.gripped

    def action(self) -> str:
        """Return what the last move says of itself."""
        self.at(self.now())
        return self.state

    def stamp(self, now: float) -> float:
        """Return the time of a reading."""
        return now

    def said(self, now: float) -> Position:
        """Return what it says of its position."""
        return self.at(now)

    def told(self) -> Position:
        """Return what a reading says, with noise."""
        here = self.said(self.now())
        return {name: value + (self.chance.gauss(0, self.noise) if self.noise else 0.0) for name, value in here.items()}
