"""Where a robot is behind a proxy: what it says of its own addresses leads to the proxy, never past it."""

import re
from dataclasses import dataclass
from typing import Final

from conformance.mutation.messages import Request, Response

_ORIGIN: Final = re.compile(r"^https?://[^/?]*(?=[/?])", re.IGNORECASE)


@dataclass(frozen=True)
class Addresses:
    """Origins by interface ("rest", "soap"), as ``http://127.0.0.1:8080``.

    Attributes:
        robot: where the robot is.
        proxy: where clients find it.
        prefix: path before everything of REST at the proxy, as "/r2d2/api", or empty.
    """

    robot: dict[str, str]
    proxy: dict[str, str]
    prefix: str = ""

    def public(self, side: str) -> str:
        """The base URL of an interface as clients know it."""
        return self.proxy[side] + (self.prefix if side == "rest" else "")

    def inward(self, request: Request) -> Request | None:
        """A request as the robot knows it, or None when it is for nothing that is the robot's."""
        if request.side != "rest" or not self.prefix or request.raw is not None:
            return request
        # In absolute form too (RFC 9112 3.2.2), of which the robot then gets the origin form.
        target = _ORIGIN.sub("", request.target)
        if not target.startswith(self.prefix):
            return None
        return request.copy(target=target.removeprefix(self.prefix) or "/")

    def outward(self, response: Response) -> Response:
        """The robot's response as clients are to see it; the response itself is altered."""
        for side, robot in self.robot.items():
            here = self.public(side)
            # A robot may go by the Host field, which is the proxy's, and cannot know that the proxy speaks TLS.
            asked = self.proxy[side]
            for there in (robot, asked.replace("https:", "http:")) if asked.startswith("https:") else (robot,):
                response.body = response.body.replace(there.encode(), here.encode())
                response.fields = [(name, value.replace(there, here)) for name, value in response.fields]
        location = response.field("Location")
        if self.prefix and location is not None and location.startswith("/"):
            response.put("Location", self.prefix + location)
        return response
