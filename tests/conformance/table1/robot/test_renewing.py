from contextlib import closing

import pytest
from toy_server import serving

from conformance.api.rest.interface import RestInterface
from conformance.packs.table1.limits import DeclaredLimits
from conformance.packs.table1.robot.drive import Drive, unrenewed_velocities
from conformance.packs.table1.robot.robot import LINEAR, Robot, Velocity
from conformance.packs.table1.statement import Statement
from conformance.transport.client import Connection, HttpClient
from conformance.verdict.run import Run

_WANTED = Velocity(linear_x=0.3)


class XmlBody:
    """A robot that shows and takes XML, and never moves."""

    def __init__(self) -> None:
        self.taken: list[tuple[str, bytes]] = []

    def answer(self, method: str, path: str, sent: bytes) -> tuple[int, object]:
        if method == "PUT":
            self.taken.append((path, sent))
        return 200, b"<twist><linear><x>0</x></linear></twist>"


def test_a_velocity_in_xml_is_renewed_in_xml():
    body = XmlBody()
    declared = DeclaredLimits(linear_m_s=0.7, angular_rad_s=2.5, settle_s=0.3, hold_s=0.2)
    with serving(body.answer, "application/xml") as url, closing(HttpClient(url, Connection())) as client:
        drive = Drive(Robot(RestInterface(Run(statement=Statement(declared=declared), allow_motion=True), client)))
        drive.command(_WANTED, linear=True, xml=True)
        assert not drive.reach(_WANTED, "rest-resources/linear-put")
    first, *again = body.taken
    assert again
    assert {first, *again} == {(LINEAR, first[1])}
    assert b"<x>0.3</x>" in first[1]
    assert [one.renewal for one in drive.trace.commands] == [False, *(True for _ in again)]


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
