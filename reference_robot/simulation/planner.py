"""Shortest paths around obstacles: Floyd-Warshall on a visibility graph of the corners of the office's boxes.

A shortest path among boxes turns only at corners. The shortest ways between the corners are calculated once, which
takes some milliseconds. A plan then takes about a millisecond and is exact, without a grid and without smoothing.
"""

import itertools
import math
from enum import IntEnum
from typing import Final, TypeAlias

import numpy as np

from reference_robot.simulation.office import Floats, Office

Pose: TypeAlias = tuple[float, float, float]

CLEARANCE: Final = 0.33  # m between a path and walls: the body's radius and how far pursuit cuts corners
STEP: Final = 0.2  # largest distance between poses of a path, m
_BESIDE: Final = 1e-3  # distance of corners from the grown boxes, m, so that paths along walls are free


class PlanFailure(IntEnum):
    """The reasons why no path was found, with the error codes of nav2_msgs/ComputePathToPose (Jazzy)."""

    START_OUTSIDE_MAP = 204
    GOAL_OUTSIDE_MAP = 205
    START_OCCUPIED = 206
    GOAL_OCCUPIED = 207
    NO_VALID_PATH = 209


class PlanError(ValueError):
    """An error for a path that does not exist; the message names the pose that is the reason."""

    def __init__(self, failure: PlanFailure, message: str) -> None:
        super().__init__(message)
        self.failure = failure


class Planner:
    """A path planner for one office."""

    def __init__(self, office: Office) -> None:
        self._walls = office
        self._grown = office.grown(CLEARANCE)
        x_min, y_min, x_max, y_max = self._grown.grown(_BESIDE).boxes.T
        corners = np.concatenate(
            [np.column_stack(pair) for pair in ((x_min, y_min), (x_min, y_max), (x_max, y_min), (x_max, y_max))]
        )
        usable = [office.contains(x, y) and self._grown.is_free(x, y) for x, y in corners]
        self._corners: Floats = corners[usable]
        count = len(self._corners)
        visible = self._grown.free_lines(
            np.repeat(self._corners, count, axis=0), np.tile(self._corners, (count, 1))
        ).reshape(count, count)
        straight = np.hypot(*(self._corners[:, None] - self._corners).T)
        self._lengths: Floats = np.where(visible, straight, math.inf)
        np.fill_diagonal(self._lengths, 0.0)
        self._next = np.tile(np.arange(count), (count, 1))  # at [i, j] the corner after i on the way to j
        for corner in range(count):
            detours = self._lengths[:, corner, None] + self._lengths[corner]
            shorter = detours < self._lengths
            self._lengths = np.where(shorter, detours, self._lengths)
            self._next = np.where(shorter, self._next[:, corner, None], self._next)

    def plan(self, start: Pose, goal: Pose, tolerance: float = 0.0) -> Floats:
        """Return the shortest path from a pose to a pose (x and y in m, yaw in rad).

        If the start is closer to a wall than the clearance, the path first leads away from the wall. If the goal is too
        close to a wall, it is moved away by up to ``tolerance`` metres.

        Returns:
            A (k, 3) array of poses, k >= 2, from the start to the goal. Poses in between are at most STEP metres apart
            and face along the path.

        Raises:
            PlanError: There is no path.
        """
        self._check_start(start)
        if not all(map(math.isfinite, goal)) or not self._walls.contains(goal[0], goal[1]):
            raise PlanError(PlanFailure.GOAL_OUTSIDE_MAP, f"the goal ({goal[0]:g}, {goal[1]:g}) is outside the map")
        end = self._escape(goal[0], goal[1])
        moved = math.inf if end is None else math.dist(end, goal[:2])
        if end is None or (moved and not moved <= tolerance):  # in this form a tolerance of NaN permits nothing
            raise PlanError(
                PlanFailure.GOAL_OCCUPIED, f"the goal ({goal[0]:g}, {goal[1]:g}) is in or too near to a wall"
            )
        begin = self._escape(start[0], start[1])
        if begin is None:
            raise PlanError(PlanFailure.START_OCCUPIED, f"the start ({start[0]:g}, {start[1]:g}) is walled in")
        turns = self._shortest(np.array(begin), np.array(end))
        if turns is None:
            raise PlanError(PlanFailure.NO_VALID_PATH, f"no path leads to the goal ({goal[0]:g}, {goal[1]:g})")
        return _poses([start[:2], *turns], start[2], goal[2])

    def _check_start(self, start: Pose) -> None:
        if not all(map(math.isfinite, start)) or not self._walls.contains(start[0], start[1]):
            raise PlanError(PlanFailure.START_OUTSIDE_MAP, f"the start ({start[0]:g}, {start[1]:g}) is outside the map")
        if not self._walls.is_free(start[0], start[1]):
            raise PlanError(PlanFailure.START_OCCUPIED, f"the start ({start[0]:g}, {start[1]:g}) is in a wall")

    def _escape(self, x: float, y: float) -> tuple[float, float] | None:
        """Return the nearest point with full clearance that is reachable straight; None for a point in a wall."""
        if self._grown.is_free(x, y):
            return x, y
        if not self._walls.is_free(x, y):
            return None
        x_min, y_min, x_max, y_max = self._grown.grown(_BESIDE).boxes.T
        holding = (x_min < x) & (x < x_max) & (y_min < y) & (y < y_max)
        sides = [*x_min[holding], *x_max[holding]], [*y_min[holding], *y_max[holding]]
        # Along a wall it is enough to move beyond one side of a box; in a corner between walls, two sides.
        ways = [
            *((side, y) for side in sides[0]),
            *((x, side) for side in sides[1]),
            *((x_side, y_side) for x_side in sides[0] for y_side in sides[1]),
        ]
        for way in sorted(ways, key=lambda point: math.dist(point, (x, y))):
            straight = self._walls.free_lines(np.array([[x, y]]), np.array([way]))[0]
            if straight and self._grown.is_free(*way):
                return float(way[0]), float(way[1])
        return None

    def _shortest(self, begin: Floats, end: Floats) -> list[tuple[float, float]] | None:
        """Return the turning points of the shortest path, including both ends, or None if there is no path."""
        if self._grown.free_lines(begin[None], end[None])[0]:
            return [_point(begin), _point(end)]
        count = len(self._corners)
        from_begin = self._grown.free_lines(np.broadcast_to(begin, (count, 2)), self._corners)
        to_end = self._grown.free_lines(self._corners, np.broadcast_to(end, (count, 2)))
        gone = np.where(from_begin, np.hypot(*(self._corners - begin).T), math.inf)
        left = np.where(to_end, np.hypot(*(self._corners - end).T), math.inf)
        totals = gone[:, None] + self._lengths + left
        if not np.isfinite(totals).any():
            return None
        corner, last = divmod(int(totals.argmin()), count)
        turns = [corner]
        while corner != last:
            corner = int(self._next[corner, last])
            turns.append(corner)
        return [_point(begin), *(_point(self._corners[turn]) for turn in turns), _point(end)]


def _point(row: Floats) -> tuple[float, float]:
    return float(row[0]), float(row[1])


def _poses(turns: list[tuple[float, float]], start_yaw: float, goal_yaw: float) -> Floats:
    rows = [(*turns[0], start_yaw)]
    for (x, y), (to_x, to_y) in itertools.pairwise(turns):
        pieces = math.ceil(math.dist((x, y), (to_x, to_y)) / STEP)
        yaw = math.atan2(to_y - y, to_x - x)
        rows.extend(
            (x + (to_x - x) * piece / pieces, y + (to_y - y) * piece / pieces, yaw) for piece in range(1, pieces + 1)
        )
    if len(rows) == 1:  # start and goal are one point: the robot only turns
        rows.append((*turns[-1], goal_yaw))
    # Set the end exactly, because interpolation rounds.
    rows[-1] = (*turns[-1], goal_yaw)
    return np.array(rows)
