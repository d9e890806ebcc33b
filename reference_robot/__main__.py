"""``python -m reference_robot`` is ``roaas robot``."""

from reference_robot.cli import robot

robot()
