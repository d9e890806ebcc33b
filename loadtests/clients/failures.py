"""Why a call failed, in the few kinds by which the result groups errors."""

import re
import socket
import ssl
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from functools import cached_property
from http import HTTPStatus

from conformance.commandline.secrecy import SECRETS


class CallError(Exception):
    """A call without a good response.

    Attributes:
        kind: `refused`, `resolve`, `network`, `tls`, `closed`, `timeout`, `malformed`, `status`, `redirect`,
            `fault` or `content`.
        refused: the status by which the robot refused who sent the request; 0 if it did not.
    """

    def __init__(self, kind: str, message: str, refused: int = 0) -> None:
        # Mask it here, because Locust's web UI shows it to the network.
        super().__init__(SECRETS.masked(message))
        self.kind, self.refused = kind, refused


#: Kinds that mean that no server listens there; the others are bad responses.
UNREACHABLE = frozenset({"refused", "resolve", "network", "tls"})

_FAULT_STRING = re.compile(rb"<(?:[\w.-]+:)?(?:faultstring|Text)\b[^>]*>\s*(.*?)\s*</", re.DOTALL)  # SOAP 1.1, 1.2
_FAULT = re.compile(rb"<(?:[\w.-]+:)?Fault[\s>/]")
_SHOWN = 160
# Statuses by which a robot refuses the sender of a request, or because another client has the lease.
_REFUSALS = frozenset({401, 403, 407, 423, 428})
# Plain integers: every request is compared with them, and members of HTTPStatus compare more slowly.
_OK = int(HTTPStatus.OK)
_MULTIPLE_CHOICES = int(HTTPStatus.MULTIPLE_CHOICES)


def connect_error(error: OSError, where: str) -> CallError:
    """Return the error for a connection that could not be opened."""
    if isinstance(error, ssl.SSLCertVerificationError):
        return CallError(
            "tls",
            f"{where}: its certificate is not trusted: {error.verify_message or error} "
            "(is a ca_file missing in the statement?)",
        )
    if isinstance(error, ssl.SSLError):
        return CallError("tls", f"{where}: TLS failed: {error.reason or error} (does the port speak https?)")
    if isinstance(error, socket.gaierror):
        return CallError("resolve", f"{where}: the host name does not resolve: {error.strerror}")
    if isinstance(error, ConnectionRefusedError):
        return CallError("refused", f"{where}: connection refused: nothing listens there")
    if isinstance(error, TimeoutError):
        return CallError("network", f"{where}: no connection within the deadline")
    return CallError("network", f"{where}: {error.strerror or error}")


def require_good(status: int, location: str | None, body: bytes, expects: bytes = b"") -> None:
    """Raise an error unless a response is 2xx and its body contains `expects`.

    Raises:
        CallError: any other response; the message says what is wrong with the response.
    """
    if not (_OK <= status < _MULTIPLE_CHOICES and expects in body):
        raise _error(status, location, body, expects)


def _error(status: int, location: str | None, body: bytes, expects: bytes) -> CallError:
    if _OK <= status < _MULTIPLE_CHOICES:
        return CallError("content", f"status {status}, but the body lacks {expects.decode()!r}: {clip(body)}")
    if HTTPStatus.MULTIPLE_CHOICES <= status < HTTPStatus.BAD_REQUEST:  # RFC 9110 section 15.4: redirection
        return CallError("redirect", f"status {status} to {location!r}: use that address as the endpoint")
    refused = status if status in _REFUSALS else 0
    if _FAULT.search(body):
        return _fault(status, body, refused)
    hint = " (does it need a --token-file?)" if refused else ""
    return CallError("status", f"status {status}{hint}: {clip(body)}", refused)


def _fault(status: int, body: bytes, refused: int = 0) -> CallError:
    found = _FAULT_STRING.search(body)
    reason = found.group(1).decode("utf-8", "replace")[:_SHOWN] if found else clip(body)
    return CallError("fault", f"status {status}, SOAP fault: {reason}", refused)


@dataclass(frozen=True)
class Reply:
    """The good response of a SOAP operation by its WSDL.

    Attributes:
        element: local name of the first element in the Body; empty for a one-way operation, or an empty Body.
    """

    element: str

    @cached_property
    def _first(self) -> re.Pattern[bytes]:
        """The beginning of the Body, whatever the prefixes."""
        prefix, between = r"(?:[^\s<>/:]+:)?", r"(?:\s|<!--.*?-->)*"
        first = rf"<{prefix}Body\b[^>]*>{between}<{prefix}{re.escape(self.element)}[\s/>]"
        return re.compile(first.encode(), re.DOTALL)

    def require(self, status: int, location: str | None, content_type: bytes | None, body: bytes) -> None:
        """Raise an error unless a response is 2xx and has the element; a fault is never good.

        Raises:
            CallError: any other response.
        """
        del content_type
        if not _OK <= status < _MULTIPLE_CHOICES:
            raise _error(status, location, body, b"")
        if self.element and self._first.search(body):
            return
        if _FAULT.search(body):
            raise _fault(status, body)
        if self.element:
            raise CallError(
                "content", f"status {status}, but the Body does not begin with {self.element}: {clip(body)}"
            )


@dataclass(frozen=True)
class Declared:
    """The good responses of an operation by its description. An error status is never one, declared or not.

    Attributes:
        responses: status and media types of each; without media types, any will do.
    """

    responses: tuple[tuple[int, tuple[str, ...]], ...]
    _seen: set[tuple[int, bytes | None]] = field(default_factory=set, compare=False, repr=False)

    def require(self, status: int, location: str | None, content_type: bytes | None, body: bytes) -> None:
        """Raise an error unless a response is declared.

        Raises:
            CallError: the status is not declared as a success, or its body has another media type.
        """
        if (status, content_type) in self._seen and (body or content_type is None):
            return  # a form that was valid once need not be parsed again: this runs for every request
        media_types = next((types for one, types in self.responses if one == status), None)
        if media_types is None:
            raise self._status_error(status, location, body)
        name = (content_type or b"").decode("latin-1").partition(";")[0].strip().lower()
        if body and media_types and not any(fnmatchcase(name, text) for text in media_types):
            raise CallError(
                "content", f"status {status} with {name or 'no media type'}, declared is {' or '.join(media_types)}"
            )
        if body:
            self._seen.add((status, content_type))

    def _status_error(self, status: int, location: str | None, body: bytes) -> CallError:
        if not _OK <= status < _MULTIPLE_CHOICES:
            return _error(status, location, body, b"")
        named = ", ".join(str(one) for one, _ in self.responses)
        return CallError("status", f"status {status}, declared is {named}: {clip(body)}")


def clip(body: bytes) -> str:
    """Return the beginning of a body, for a message."""
    text = body[:_SHOWN].decode("utf-8", "replace")
    return (text + " …" if len(body) > _SHOWN else text) or "(no body)"
