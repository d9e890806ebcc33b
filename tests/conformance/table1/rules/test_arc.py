"""Driving along an arc: what is judged of the angular part while the linear one is commanded."""

from types import SimpleNamespace

import pytest

from conformance.packs.table1.robot.robot import Velocity
from conformance.packs.table1.scenarios.turn import _arc


class _Drive:
    """A drive of a robot that answers linear parts with a status, and lets the angular part go."""

    clock = SimpleNamespace(now=lambda: 0.0)
    holds_until = 1.0

    def __init__(self, *statuses: int) -> None:
        self.trace, self.statuses, self.judged = SimpleNamespace(commands=[]), list(statuses), []

    def command(self, velocity: Velocity, *, linear: bool) -> bool:
        response = SimpleNamespace(ok=self.statuses.pop(0) < 300)
        self.trace.commands.append(SimpleNamespace(velocity=velocity, exchange=SimpleNamespace(response=response)))
        return linear and response.ok

    def refresh(self, _velocity: Velocity) -> None: ...

    def keep(self, _seconds: float) -> None: ...

    def sees(self, *_wanted: object, **_more: object) -> tuple[bool, str]:
        return False, "angular.z 0"

    def saw(self, requirement: str, *_said: str, holds: bool) -> None:
        self.judged.append((requirement, holds))


@pytest.mark.parametrize(
    ("statuses", "judged"),
    [((200, 200), [("rest-resources/linear-keeps-angular", False)]), ((200, 422), []), ((422,), [])],
)
def test_a_linear_part_that_is_refused_says_nothing_of_the_angular_one(statuses, judged):
    drive = _Drive(*statuses)
    _arc(SimpleNamespace(usual_s=0.0), drive, Velocity(0.2, 0.0, 0.0, 0.0, 0.0, 1.0), Velocity(linear_x=0.5))
    assert drive.judged == judged
