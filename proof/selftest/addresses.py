"""Rewrite a robot's own addresses in its responses, so that they lead to the proxy in front of the robot."""

import re
from dataclasses import dataclass
from typing import Final

from proof.mutation.messages import Request, Response

_ORIGIN: Final = re.compile(r"^https?://[^/?]*(?=[/?])", re.IGNORECASE)


@dataclass(frozen=True)
class Addresses:
    """The addresses of a robot and of the proxy in front of it, as origins by interface ("rest", "soap").

    Attributes:
        robot: the robot's origins, such as ``http://127.0.0.1:8080``.
        proxy: the proxy's origins, which clients use.
        prefix: path before every REST path at the proxy, such as "/r2d2/api", or empty.
    """

    robot: dict[str, str]
    proxy: dict[str, str]
    prefix: str = ""

    def public(self, side: str) -> str:
        """Return the base URL of an interface at the proxy, as clients use it."""
        return self.proxy[side] + (self.prefix if side == "rest" else "")

    def inward(self, request: Request) -> Request | None:
        """Return a client's request with the robot's own address in it, or None for a path that is not the robot's."""
        if request.side != "rest" or not self.prefix or request.raw is not None:
            return request
        # A target in absolute form (RFC 9112 3.2.2) reaches the robot in origin form.
        target = _ORIGIN.sub("", request.target)
        if not target.startswith(self.prefix):
            return None
        return request.copy(target=target.removeprefix(self.prefix) or "/")

    def outward(self, response: Response) -> Response:
        """Replace the robot's address with the proxy's in a response, in place, and return the response."""
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
