"""The operations of a description, as a scenario's requests find them: by name, or by method and path."""

import re
from typing import NamedTuple

from loadtests.clients.failures import Declared
from loadtests.clients.robot import Described, Robot

_PARAMETER = re.compile(r"\\\{[^{}]*\\\}")


class ScenarioError(Exception):
    """A request that the scenario must not make, or that cannot be made; it ends the run."""


class Route(NamedTuple):
    """An operation: its number in the plan, what its paths look like, and its good responses."""

    number: int
    operation: Described
    path: re.Pattern[str]
    good: Declared


class Routes:
    """The operations of a description, found by name, or by the method and path of a request.

    Args:
        robot: with its operations.
        numbered: names of the operations that may be called, in the order in which the plan numbers them.
    """

    def __init__(self, robot: Robot, numbered: tuple[str, ...]) -> None:
        numbers = {name: number for number, name in enumerate(numbered)}
        self._routes = [
            Route(numbers.get(each.name, -1), each, _pattern(each), Declared(each.responses))
            for each in sorted(robot.described, key=lambda each: each.name.count("{"))  # /items/all before /items/{id}
        ]

    def of(self, method: str, path: str) -> Route:
        """Return the operation of a request.

        Raises:
            ScenarioError: there is none, or it may not be called.
        """
        found = next((one for one in self._routes if one.operation.method == method and one.path.fullmatch(path)), None)
        if found is None:
            others = sorted(one.operation.method for one in self._routes if one.path.fullmatch(path))
            hint = f"the path has {', '.join(others)}" if others else "no path of it matches"
            raise ScenarioError(f"{method} {path} is not in the description: {hint}")
        return _allowed(found)

    def named(self, name: str) -> Route:
        """Return the operation with this method and path template.

        Raises:
            ScenarioError: there is none, or it may not be called.
        """
        found = next((one for one in self._routes if one.operation.name == name), None)
        if found is None:
            raise ScenarioError(f"the description has no operation {name!r}: name it as in 'GET /items/{{id}}'")
        return _allowed(found)


def _pattern(operation: Described) -> re.Pattern[str]:
    template = operation.name.partition(" ")[2]
    return re.compile(_PARAMETER.sub("[^/]+", re.escape(template)))


def _allowed(route: Route) -> Route:
    if route.operation.refused:
        raise ScenarioError(f"{route.operation.name} is not called: {route.operation.refused}")
    return route
