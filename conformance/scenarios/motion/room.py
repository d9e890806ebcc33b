"""Room for a drive: a device that is given a velocity stays within the limits of its positions.

A drive begins where there is room for it and ends before a limit, by the fastest speed and the slowest response seen.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from typing import Final

from msgspec import structs

from conformance.measures.samples import FARTHEST, LATE, SEVERAL, Noise, usual_s
from conformance.scenarios.motion.measuring import end_of_travel
from conformance.scenarios.motion.trace import Reading, middle_of
from conformance.scenarios.scenario import NotPossibleError
from conformance.statement.motion_map import MotionMap

# Responses from the last reading to the end of a drive: of that reading, a command, the next reading, and the stop.
_BLIND: Final = 3
# Commands before the end of a drive that are each held for the hold time at most after the position that is known.
_HOLDS: Final = 3
# Time between two readings that shows how fast a device is, s.
_APART_S: Final = 0.3
# Plan a drive for a device this much faster than declared or seen, because its greatest speed shows only under way.
_FASTER: Final = 1.25
# Share of an axis's tolerance by which two readings at rest may differ, beyond their noise.
_UNSURE: Final = 0.2
#: A velocity is not lowered below this many times the tolerance of its measurement.
MEASURABLE: Final = 2.0

Span = tuple[float, float]
Speeds = Mapping[str, float]


class Room:
    """How far velocities take a device, and where its limits leave room for that.

    Args:
        motion: the map.

    Attributes:
        slowest_s: the slowest response so far, s.
        noise: what the positions show at rest, by axis.
        unknown: velocities of which nobody knows yet which axes they change.
    """

    def __init__(self, motion: MotionMap) -> None:
        self.slowest_s = 0.0
        self._motion = motion
        self._axes = {name: axis for name, axis in motion.state.axes.items() if not axis.angle}
        speeds = motion.velocity.axes if motion.velocity else {}
        # Least and greatest change per second at velocity 1, by velocity and axis.
        self._rates: dict[str, dict[str, Span]] = {
            name: {speed.of: (speed.scale, speed.scale)} if speed.of else {} for name, speed in speeds.items()
        }
        self.noise: Mapping[str, Noise] = {}
        self.unknown = {name for name, speed in speeds.items() if not speed.of and self._axes}
        self._declared = {name for name, speed in speeds.items() if speed.of}
        self._turns = any(axis.angle for axis in motion.state.axes.values())
        # The same while only this velocity was commanded: a device that did not turn drives in the same direction.
        self._heading: dict[str, dict[str, Span]] = {}
        self._driven = set[str]()
        self._so_far: list[Reading] = []

    def plan(self, choices: Sequence[Speeds], lasts_s: float) -> tuple[float, dict[str, Span]]:
        """Plan a drive at any of several velocities, until the device rests again.

        Returns:
            By how much the velocities must be multiplied, at most 1, and for each axis between which positions the
            drive must begin.

        Raises:
            NotPossibleError: the limits leave no room for a velocity that can be measured.
        """
        share, ways = 1.0, dict[str, Span]()
        # A move to the start of a drive may turn the device.
        turned = self._motion.goto is not None
        for name, axis in self._axes.items():
            down, up = self._way(name, choices, _FASTER * (lasts_s + self._blind_s), turned=turned)
            if down + up > 0:
                ways[name] = down, up
                # The start of a drive is reached within the tolerance only.
                free = axis.limits[1] - axis.limits[0] - 2 * self._motion.tolerance(name)
                share = min(share, max(0.0, free) / (down + up))
        if slow := self._too_slow(choices, share):
            raise NotPossibleError(
                f"the limits of {', '.join(ways)} leave no room to drive {slow} for {lasts_s:.1f} s: the slowest "
                f"response took {self.slowest_s:.2f} s"
            )
        limits = {name: self._axes[name].limits for name in ways}
        begin = {
            name: (limits[name][0] + share * down, limits[name][1] - share * up) for name, (down, up) in ways.items()
        }
        return share, begin

    def note_command(self, names: set[str]) -> None:
        """Take note that velocities, or a move, may have turned the device; no names: it was stopped."""
        if names and names != self._driven:
            self._driven, self._heading = names, {}

    def share_from(self, here: Speeds, choices: Sequence[Speeds], lasts_s: float) -> float:
        """Return by how much velocities must be multiplied, at most 1, for a drive that begins here; 0: no room."""
        share = 1.0
        for name, axis in self._axes.items():
            down, up = self._way(name, choices, _FASTER * (lasts_s + self._blind_s))
            for way, free in ((down, here[name] - axis.limits[0]), (up, axis.limits[1] - here[name])):
                share = min(share, max(0.0, free) / way) if way > 0 else share
        return 0.0 if self._too_slow(choices, share) else share

    def _too_slow(self, choices: Sequence[Speeds], share: float) -> str:
        """Return a velocity that cannot be measured at a share of it below 1; empty if there is none."""
        least = {name: MEASURABLE * self._motion.speed_tolerance(name) for choice in choices for name in choice}
        several = (one for choice in choices for one in choice.items() if share < 1 and one[1])
        return next((name for name, speed in several if share * abs(speed) < least[name]), "")

    def note(self, speeds: Speeds, readings: Sequence[Reading]) -> None:
        """Learn from a drive by one velocity how fast it changes each axis."""
        driven = [(name, speed) for name, speed in speeds.items() if speed]
        if len(driven) != 1:
            return
        (name, speed), late_s = driven[0], LATE * usual_s(readings)
        seen = [reading for reading in readings if reading.values and reading.received - reading.sent <= late_s]
        for axis in self._axes:
            for first, last in itertools.combinations(seen, 2):
                lapse_s = (last.sent + last.received - first.sent - first.received) / 2
                way = last.values[axis] - first.values[axis]
                if lapse_s >= _APART_S and abs(way) > self._unsure(axis):
                    rate = way / lapse_s / speed
                    least, greatest = self._rates[name].get(axis, (rate, rate))
                    self._rates[name][axis] = min(least, rate), max(greatest, rate)

    def ends(self, speeds: Speeds, readings: Sequence[Reading]) -> bool:
        """Learn whether a device stands at an undeclared end of its travel; later drives end before it."""
        self._so_far += readings[:: max(1, len(readings) // SEVERAL)]
        found = False
        for name, wanted in speeds.items():
            place = end_of_travel(readings, name, wanted, self._motion, self._so_far)
            if place is not None and self._motion.velocity:
                of = self._motion.velocity.axes[name].of
                least, most = self._axes[of].limits
                limits = (least, place) if wanted > 0 else (place, most)
                if abs(sum(limits) - least - most) > self._motion.tolerance(of) and limits[0] < limits[1]:
                    self._axes[of], found = structs.replace(self._axes[of], limits=limits), True
        return found

    def greatest(self, name: str, axis: str) -> float:
        """Return how fast a velocity of 1 changed an axis at most so far, per second."""
        return max(map(abs, self._rates[name].get(axis, (0.0,))))

    def note_heading(self, speeds: Speeds, readings: Sequence[Reading]) -> Mapping[str, Span]:
        """Learn from readings at a steady velocity which way it takes the device until the next command, by axis."""
        driven = {name: speed for name, speed in speeds.items() if speed}
        seen = [reading for reading in readings if reading.values]
        lapse_s = seen[-1].sent - seen[0].sent if seen else 0.0
        if driven.keys() != self._driven or len(driven) != 1 or lapse_s < _APART_S:
            return {}
        ((name, speed),) = driven.items()
        self._heading[name] = {}
        for axis in self._axes:
            way = (middle_of(seen[-SEVERAL:], axis) - middle_of(seen[:SEVERAL], axis)) / lapse_s / speed
            room = self._unsure(axis) / lapse_s / abs(speed)
            self._heading[name][axis] = way - room, way + room
        return self._heading[name]

    def is_over(self, choices: Sequence[Speeds], readings: Sequence[Reading], rests_s: float) -> bool:
        """Return whether a drive has to end, as the device would pass a limit if it rested ``rests_s`` later."""
        seen = [reading for reading in readings if reading.values][-SEVERAL:]
        if not seen:
            return False
        # A busy machine that has just paused the suite may do so again.
        paused_s = max((two.sent - one.sent for one, two in itertools.pairwise(seen)), default=0.0)
        blind_s = max(self._blind_s, min(paused_s, self._most_blind_s))
        for name, axis in self._axes.items():
            here, (down, up) = middle_of(seen, name), self._way(name, choices, rests_s + blind_s)
            if (down and here - down < axis.limits[0]) or (up and here + up > axis.limits[1]):
                return True
        return False

    def leads_on(self, speeds: Speeds, readings: Sequence[Reading], lasts_s: float) -> bool:
        """Return whether a device that is seen under way has room for another velocity, for so long, s."""
        is_seen = sum(bool(reading.values) for reading in readings) >= SEVERAL or not self._axes
        return is_seen and not self.is_over([speeds], readings, _FASTER * lasts_s + self._blind_s)

    @property
    def _blind_s(self) -> float:
        """How long a device may drive on unseen, s: after a command that came late, no longer than its hold time."""
        return min(_BLIND * self.slowest_s, self._most_blind_s)

    @property
    def _most_blind_s(self) -> float:
        hold_s = self._motion.velocity.hold_s if self._motion.velocity else None
        return math.inf if hold_s is None else _HOLDS * hold_s

    def _unsure(self, axis: str) -> float:
        """Return how far apart two readings of a device at rest may be along an axis."""
        sigma = self.noise[axis].sigma if axis in self.noise else self._motion.state.axes[axis].noise
        return _UNSURE * self._motion.tolerance(axis) + 2 * FARTHEST * sigma

    def _rates_of(self, name: str, *, turned: bool) -> dict[str, Span]:
        if not turned and {name} == self._driven and name in self._heading:
            return self._heading[name]
        if not self._turns or name in self._declared:
            return self._rates[name]
        # Whatever its heading is by then, the device moves no faster than this.
        most = math.hypot(*(max(map(abs, span)) for span in self._rates[name].values()))
        return dict.fromkeys(self._axes, (-most, most))

    def _way(self, axis: str, choices: Sequence[Speeds], lasts_s: float, *, turned: bool = False) -> Span:
        """Return how far an axis may go down and up."""
        ends = [
            sum(
                edge([speed * rate * lasts_s for rate in self._rates_of(name, turned=turned).get(axis, (0.0,))])
                for name, speed in choice.items()
            )
            for choice in choices
            for edge in (min, max)
        ]
        return -min(0.0, *ends), max(0.0, *ends)
