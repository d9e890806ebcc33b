"""What goes along with every check: the observers, which judge each exchange whoever has it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from conformance.http.observers import watch

if TYPE_CHECKING:
    from conformance.session import Session


@pytest.fixture(scope="session", autouse=True)
def _watched(roaas: Session) -> None:
    """Have every exchange over REST judged from the first check on."""
    watch(roaas)
