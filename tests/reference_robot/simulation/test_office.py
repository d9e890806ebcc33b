"""The office: what is free, what a straight line meets, what the laser sees."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from reference_robot.simulation.office import BODY_RADIUS, DEPOT, DESTINATION, OFFICE, SOURCE, Office

ROOM = Office(np.array([(4.0, -1.0, 5.0, 1.0)]))


@pytest.mark.parametrize("place", [SOURCE, DESTINATION, DEPOT])
def test_the_papers_places_are_free_for_the_whole_body(place):
    assert OFFICE.contains(*place)
    assert OFFICE.grown(BODY_RADIUS).is_free(*place)


def test_around_the_start_a_metre_is_free_in_every_direction():
    assert OFFICE.distances(*DEPOT, np.linspace(-math.pi, math.pi, 72), 12.0).min() > 1.5


def test_the_map_is_an_office_floor():
    x_min, y_min, x_max, y_max = OFFICE.bounds
    assert 20 <= x_max - x_min <= 30
    assert 10 <= y_max - y_min <= 30


def test_nan_lies_nowhere():
    assert not OFFICE.contains(math.nan, 40.0)


@pytest.mark.parametrize(
    ("start", "end", "free"),
    [
        ((0, 0), (3.9, 0), True),
        ((0, 0), (4.1, 0), False),
        ((0, 0), (9, 0), False),
        ((9, 0), (0, 0), False),
        ((4.5, -5), (4.5, 5), False),
        ((0, 1.5), (9, 1.5), True),
        ((3, -5), (3, 5), True),
        ((4.5, 0), (4.6, 0), False),
    ],
)
def test_a_line_is_free_when_it_touches_no_box(start, end, free):
    assert ROOM.free_lines(np.array([start], float), np.array([end], float)).tolist() == [free]


@given(st.floats(-math.pi, math.pi))
def test_the_laser_measures_the_distance_to_the_box(angle):
    distance = float(ROOM.distances(0.0, 0.0, np.array([angle]), 10.0)[0])
    if abs(math.tan(angle)) <= 0.25 and math.cos(angle) > 0:
        assert distance == pytest.approx(4.0 / math.cos(angle))
    else:
        assert distance == 10.0


@given(st.floats(55, 83), st.floats(30, 48), st.floats(-math.pi, math.pi))
def test_a_beam_ends_where_the_line_is_no_longer_free(x, y, angle):
    if not OFFICE.grown(0.01).is_free(x, y):
        return
    distance = float(OFFICE.distances(x, y, np.array([angle]), 12.0)[0])
    here = np.array([[x, y]])
    towards = np.array([[math.cos(angle), math.sin(angle)]])
    assert OFFICE.free_lines(here, here + towards * (distance - 1e-6))[0]
    if distance < 12.0:
        assert not OFFICE.free_lines(here, here + towards * (distance + 1e-3))[0]
