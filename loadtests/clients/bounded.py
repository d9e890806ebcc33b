"""Responses of the library clients, up to a size: `requests` has no limit for lines, bodies and what they unpack to."""

import io
from http.client import HTTPResponse
from typing import Any, Final

import requests

# A longer response is no response to any operation, packed or unpacked; more cookies are a flood.
_MOST: Final = 16 * 1024 * 1024
_COOKIES: Final = 100
_PIECE: Final = 65_536
#: Begins the message of each error that a longer response raises.
TOO_LONG: Final = f"the response is longer than {_MOST} bytes"


class _Limited(io.RawIOBase):
    """What a server sends for one response, as long as it is within the limit."""

    def __init__(self, whole: Any) -> None:
        self._raw = whole.detach()
        self._left = _MOST

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int:
        """Read as a socket does.

        Raises:
            OSError: the response is too long.
        """
        count = int(self._raw.readinto(buffer) or 0)
        self._left -= count
        if self._left < 0:
            raise OSError(TOO_LONG)
        return count

    def close(self) -> None:
        super().close()
        self._raw.close()


class BoundedResponse(HTTPResponse):
    """A response of the standard library of which only so much is read, lines of headers and chunks included."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.fp: Any = io.BufferedReader(_Limited(self.fp))


class StayingSession(requests.Session):
    """A session that follows no redirect, which would measure another server, and reads no endless response."""

    def get_redirect_target(self, resp: requests.Response) -> str | None:
        """Return None: there is no redirect to follow."""
        del resp
        return None

    def send(self, request: requests.PreparedRequest, **kwargs: Any) -> requests.Response:
        """Send a request, and read its response up to the limit: a small one may unpack to any size.

        Raises:
            requests.RequestException: there is no response, or it is too long.
        """
        response = super().send(request, **{**kwargs, "stream": True})
        pieces: list[bytes] = []
        size = 0
        for piece in response.iter_content(_PIECE):
            pieces.append(piece)
            size += len(piece)
            if size > _MOST:
                response.close()
                raise requests.exceptions.ContentDecodingError(TOO_LONG)
        # As the property `content` does it.
        response._content, response._content_consumed = b"".join(pieces), True  # noqa: SLF001
        if len(self.cookies) > _COOKIES:
            self.cookies.clear()
        return response
