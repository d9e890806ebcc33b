"""A client with wrong credentials, which stops before the device shuts the suite out."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from typing import Any, Final

from conformance.api.rest.interface import RestInterface
from conformance.transport.client import HttpClient
from conformance.transport.credentials import Credentials
from conformance.transport.exchange import Exchange, NoAnswerError
from conformance.transport.parallel import until_taken

# Statuses by which a device locks out a client that sent too many wrong credentials (RFC 6585 4, RFC 4918 11.3).
_SHUT_OUT: Final = frozenset({423, 429})


class Stranger:
    """Sends requests with wrong credentials, each followed by one with the right ones.

    Devices count wrong credentials, and begin anew after right ones. One that does not is left alone as soon as it
    answers 423 or 429.

    Args:
        api: the device's REST interface; its client has the right credentials.
        wrong: what is sent; None means credentials that no device knows.
    """

    def __init__(self, api: RestInterface, wrong: Credentials | None = None) -> None:
        self._api = api
        connection = api.client.connection
        wrong = wrong or connection.credentials.wrong
        # Sent again, wrong credentials would shut the suite out for longer.
        settings = replace(connection, token=None, credentials=wrong, is_patient=False)
        self._client = HttpClient(api.client.base_url, settings)

    def close(self) -> None:
        """Close all open connections."""
        self._client.close()

    def send(self, method: str, path: str, **options: Any) -> Exchange | None:
        """Send a request with wrong credentials; return None, without sending it, if the device has shut the suite out.

        Args:
            method: the method of the request.
            path: its target below the base URL.
            options: as of HttpClient.send().

        Raises:
            NoAnswerError: no HTTP response was received.
        """
        if self._api.is_shut_out:
            return None
        exchange = self._client.send(method, path, **options)
        with suppress(NoAnswerError):
            own = list(until_taken(self._api.client.connection, lambda: self._api.client.send("GET", self._api.path)))
            self._api.is_shut_out = own[-1].response.status in _SHUT_OUT
            # The suite's own doing is no limit on the rate.
            self._api.client.connection.overload.is_off |= self._api.is_shut_out
        self._api.is_shut_out |= exchange.response.status in _SHUT_OUT
        return exchange
