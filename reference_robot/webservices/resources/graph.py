"""/robot/sensors/ and /robot/navigation/services/: lists of topics and services on the ROS graph."""

from collections.abc import Callable

from reference_robot.webservices.http.messages import Request, Response
from reference_robot.webservices.resources.resource import Resource, represented, wanted_format


class GraphList(Resource):
    """A list of topics or services that is read from the ROS graph for each request; ``root`` is its XML element."""

    def __init__(self, path: str, root: str, entries: Callable[[], list[dict[str, str]]]) -> None:
        self.path = path
        self._root = root
        self._entries = entries

    def get(self, request: Request) -> Response:
        """Return the list in the format that the client prefers."""
        return represented(self._entries(), self._root, wanted_format(request))
