import pytest

from conformance.packs.table1.robot.robot import Velocity
from conformance.packs.table1.robot.velocity_range import unrenewed_velocities

_BENT, _AHEAD = Velocity(linear_x=-0.1, angular_z=-0.8), Velocity(linear_x=0.1, angular_z=0.8)
_ACROSS = Velocity(linear_x=0.1, angular_z=-0.8)
_OTHERS = (Velocity(linear_x=-0.05), Velocity(angular_z=0.3), Velocity(linear_x=-0.3, angular_z=1.8))


def _ways(effort: str, seed: int) -> list[tuple[Velocity, bool]]:
    return unrenewed_velocities(_BENT, _AHEAD, _ACROSS, _OTHERS, effort, seed)


@pytest.mark.parametrize("effort", ["standard", "deep"])
@pytest.mark.parametrize("seed", range(8))
def test_each_path_and_each_sign_is_let_go_for_every_seed(effort, seed):
    ways = _ways(effort, seed)
    assert {(velocity.linear_x > 0, by) for velocity, by in ways if velocity.linear_x} == {
        (True, "xml"),
        (False, "closing"),
        *((ahead, by) for ahead in (False, True) for by in ("velocity", "linear")),
    }
    assert {*_OTHERS} <= {velocity for velocity, _ in ways}


def test_at_quick_seeds_let_each_of_them_go():
    chosen = [_ways("quick", seed) for seed in range(60)]
    assert {len(ways) for ways in chosen} == {1}
    assert {ways[0] for ways in chosen} == {way for seed in range(60) for way in _ways("standard", seed)}


def test_a_robot_without_a_reverse_gear_lets_no_rest_go():
    straight = Velocity(linear_x=0.2)
    assert unrenewed_velocities(straight, Velocity(), Velocity(), (straight,), "standard", 0) == [
        (straight, by) for by in ("linear", "velocity", "closing")
    ]
