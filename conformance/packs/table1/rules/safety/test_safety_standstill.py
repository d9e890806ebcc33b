"""The one watch for all that was tried on a robot at rest and has to leave it there."""

import pytest

from conformance.packs.table1.robot.standstill import Standstill

pytestmark = [pytest.mark.phase("stays"), pytest.mark.needs("rest"), pytest.mark.motion]


@pytest.mark.requirement(
    "http/not-acceptable-undone",
    "safety/cancel-stays",
    "safety/client-vanished",
    "safety/refused-keeps",
    "strict-input/velocity-refused",
)
def test_robot_stays_at_rest(standstill: Standstill) -> None:
    """Goals that were cancelled, clients that vanished and what was refused move nothing afterwards."""
    standstill.judge()
