"""/robot/sensors/ and /robot/navigation/services/: what is on the robot's graph."""

from collections.abc import Callable

from reference_robot.webservices.http.messages import Request, Response
from reference_robot.webservices.resources.resource import Resource, represented, wanted_format


class GraphList(Resource):
    """A list of what is on the graph, made anew for each request; ``root`` is its name in XML."""

    def __init__(self, path: str, root: str, entries: Callable[[], list[dict[str, str]]]) -> None:
        self.path = path
        self._root = root
        self._entries = entries

    def get(self, request: Request) -> Response:
        """Return the list."""
        return represented(self._entries(), self._root, wanted_format(request))
