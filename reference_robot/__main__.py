"""Run the command ``roaas robot`` for ``python -m reference_robot``."""

from reference_robot.cli import robot

robot()
