"""Generated requests, in a module of their own, because importing Schemathesis takes 0.25 s."""

from dataclasses import dataclass

from conformance.api.rest.interface import RestInterface
from conformance.transport.exchange import Exchange, media_type_of


@dataclass(frozen=True)
class GeneratedRequest:
    """One request that Schemathesis generated.

    Attributes:
        method: HTTP method.
        target: path and query below the base URL.
        content_type: value of Content-Type; empty without it.
        body: bytes.
        headers: further headers.
    """

    method: str
    target: str
    content_type: str
    body: bytes
    headers: tuple[tuple[str, str], ...] = ()

    @property
    def media_type(self) -> str:
        """The Content-Type without parameters."""
        return media_type_of(self.content_type)

    def send(self, api: RestInterface, *, fresh: bool = False, timeout_s: float | None = None) -> Exchange:
        """Send the request through the run's client.

        Args:
            api: the device's REST interface.
            fresh: on a connection of its own.
            timeout_s: deadline instead of the run's, s.

        Raises:
            NoAnswerError: no HTTP response was received.
        """
        fields = [*self.headers, *([("Content-Type", self.content_type)] if self.content_type else [])]
        # Clients send these again when a kept connection ends (RFC 9112 9.3.1), which hides a device that hangs up.
        fresh = fresh or self.method in {"PUT", "DELETE"}
        return api.client.send(
            self.method, self.target, headers=fields, body=self.body, fresh=fresh, timeout_s=timeout_s
        )
