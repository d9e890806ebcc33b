"""Names for scenario files: `from loadtests.scenario import RobotUser` (docs/load.md, "A scenario in Python")."""

from loadtests.clients.scenario import Client, Response, ResponseContext
from loadtests.measuring.scenario import RobotUser

__all__ = ["Client", "Response", "ResponseContext", "RobotUser"]
