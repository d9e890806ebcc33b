"""The office in which the simulated robot drives: its walls and furniture, free space, and laser distances.

The floor measures 28 m by 18 m in the map frame and contains the places of the paper's example: the depot in a lobby,
the source in an office north of the corridor, the destination in an office south of it. Walls and furniture are
axis-aligned boxes. All geometric queries are vectorised slab tests on these boxes, without a grid.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

Floats: TypeAlias = NDArray[np.float64]
Box: TypeAlias = tuple[float, float, float, float]

# Coordinates of the paper's example call (coffee, message code 4).
SOURCE: Final = (76.02, 41.35)
DESTINATION: Final = (60.633, 37.51)
DEPOT: Final = (68.269, 38.718)

BODY_RADIUS: Final = 0.18  # m, a Turtlebot 2
_HALF_WALL: Final = 0.05
_HALF_DOOR: Final = 0.6
_PARALLEL: Final = 1e-12


def _wall_along_x(y: float, x_from: float, x_to: float, doors: Sequence[float] = ()) -> list[Box]:
    edges = [x_from, *(edge for door in doors for edge in (door - _HALF_DOOR, door + _HALF_DOOR)), x_to]
    pairs = zip(edges[::2], edges[1::2], strict=True)
    return [(left, y - _HALF_WALL, right, y + _HALF_WALL) for left, right in pairs]


def _wall_along_y(x: float, y_from: float, y_to: float) -> list[Box]:
    return [(x - _HALF_WALL, y_from, x + _HALF_WALL, y_to)]


_WEST, _SOUTH, _EAST, _NORTH = 55.0, 30.0, 83.0, 48.0
_CORRIDOR_SOUTH, _CORRIDOR_NORTH = 38.0, 40.2
_LOBBY_WEST, _LOBBY_EAST = 64.5, 72.0

_BOXES: Final[list[Box]] = [
    # Outer walls
    *_wall_along_x(_SOUTH, _WEST, _EAST),
    *_wall_along_x(_NORTH, _WEST, _EAST),
    *_wall_along_y(_WEST, _SOUTH, _NORTH),
    *_wall_along_y(_EAST, _SOUTH, _NORTH),
    # The corridor's walls with a door to each office
    *_wall_along_x(_CORRIDOR_NORTH, _WEST, _LOBBY_WEST, doors=(57.5, 62.3)),
    *_wall_along_x(_CORRIDOR_NORTH, _LOBBY_EAST, _EAST, doors=(75.0, 80.0)),
    *_wall_along_x(_CORRIDOR_SOUTH, _WEST, _LOBBY_WEST, doors=(57.0, 62.5)),
    *_wall_along_x(_CORRIDOR_SOUTH, _LOBBY_EAST, _EAST, doors=(74.5, 80.0)),
    # The lobby's side walls, and the walls between offices
    *_wall_along_y(_LOBBY_WEST, _SOUTH, _CORRIDOR_SOUTH),
    *_wall_along_y(_LOBBY_WEST, _CORRIDOR_NORTH, _NORTH),
    *_wall_along_y(_LOBBY_EAST, _SOUTH, _CORRIDOR_SOUTH),
    *_wall_along_y(_LOBBY_EAST, _CORRIDOR_NORTH, _NORTH),
    *_wall_along_y(60.0, _CORRIDOR_NORTH, _NORTH),
    *_wall_along_y(78.0, _CORRIDOR_NORTH, _NORTH),
    *_wall_along_y(59.0, _SOUTH, _CORRIDOR_SOUTH),
    *_wall_along_y(77.5, _SOUTH, _CORRIDOR_SOUTH),
    # A lift shaft: free inside, but without an entrance
    *_wall_along_x(45.5, 80.5, _EAST),
    *_wall_along_y(80.5, 45.5, _NORTH),
    # Furniture: the lobby's reception desk and desks in offices
    (66.0, 44.0, 70.5, 44.8),
    (73.0, 44.5, 75.0, 45.3),
    (60.5, 32.5, 62.5, 33.3),
    (80.0, 32.0, 80.8, 34.0),
]


@dataclass(frozen=True, eq=False)
class Office:
    """A map of axis-aligned obstacles.

    Attributes:
        boxes: (n, 4) array of x_min, y_min, x_max, y_max in metres.
    """

    boxes: Floats

    @property
    def bounds(self) -> Box:
        """The map's x_min, y_min, x_max, y_max in metres."""
        low, high = self.boxes[:, :2].min(axis=0), self.boxes[:, 2:].max(axis=0)
        return float(low[0]), float(low[1]), float(high[0]), float(high[1])

    def contains(self, x: float, y: float) -> bool:
        """Return whether a point lies within the map's bounds; False for NaN."""
        x_min, y_min, x_max, y_max = self.bounds
        return x_min <= x <= x_max and y_min <= y <= y_max

    def grown(self, margin: float) -> "Office":
        """Return an office whose boxes are ``margin`` metres larger on every side."""
        return Office(self.boxes + np.array([-margin, -margin, margin, margin]))

    def is_free(self, x: float, y: float) -> bool:
        """Return whether a point lies outside all boxes."""
        inside = (self.boxes[:, :2] < (x, y)) & ((x, y) < self.boxes[:, 2:])
        return not bool(inside.all(axis=1).any())

    def free_lines(self, starts: Floats, ends: Floats) -> NDArray[np.bool_]:
        """Return for each of m straight lines, from (m, 2) starts to (m, 2) ends, whether the line touches no box."""
        enter, leave = self._crossings(starts, ends - starts)
        hits = (enter < leave) & (leave > 0.0) & (enter < 1.0)
        free: NDArray[np.bool_] = np.logical_not(hits.any(axis=1))
        return free

    def distances(self, x: float, y: float, angles: Floats, longest: float) -> Floats:
        """Return the distances from a free point to the nearest box in each of (m,) directions, at most ``longest``."""
        directions = np.column_stack((np.cos(angles), np.sin(angles)))
        enter, leave = self._crossings(np.broadcast_to((x, y), directions.shape), directions)
        ahead = np.where((enter < leave) & (enter > 0.0), enter, longest)
        nearest: Floats = np.minimum(ahead.min(axis=1), longest)
        return nearest

    def _crossings(self, starts: Floats, directions: Floats) -> tuple[Floats, Floats]:
        """Return where each of m lines enters and leaves each of n boxes: (m, n) multiples of the direction."""
        slopes = np.where(np.abs(directions) < _PARALLEL, _PARALLEL, directions)[:, None, :]
        to_low = (self.boxes[None, :, :2] - starts[:, None, :]) / slopes
        to_high = (self.boxes[None, :, 2:] - starts[:, None, :]) / slopes
        return np.minimum(to_low, to_high).max(axis=2), np.maximum(to_low, to_high).min(axis=2)


OFFICE: Final = Office(np.array(_BOXES))
