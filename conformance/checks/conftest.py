"""What goes along with every check: the observers, which judge each exchange whoever has it, and the ROS probe."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from conformance.rest.observers import watch
from conformance.robot.probe.client import start_probe

if TYPE_CHECKING:
    from conformance.engine.session import Session


@pytest.fixture(scope="session", autouse=True)
def _watched(roaas: Session) -> None:
    """Have every exchange over REST judged from the first check on."""
    watch(roaas)


@pytest.fixture(scope="session", autouse=True)
def _probed(roaas: Session) -> None:
    """Start the ROS probe before it is needed."""
    start_probe(roaas)
