"""What was sent to a robot and what came back, as values that can be shown and sent again."""

import base64
import gzip
import re
import shlex
from dataclasses import dataclass, field
from enum import StrEnum
from functools import cached_property

# By these nothing is done (RFC 9110 9.2.1), so they may be sent again without leave.
SAFE_METHODS = frozenset({"GET", "HEAD", "OPTIONS"})
# Twice has the effect of once (RFC 9110 9.2.2), so a client may send them again on a new connection.
IDEMPOTENT_METHODS = SAFE_METHODS | {"PUT", "DELETE"}
_CURL_PLAIN_LIMIT = 4000
# A segment of a path that holds this, or is longer than this, is a value and no name.
_VALUE = re.compile(r"\d|%|NaN|Infinity")
_LONG_SEGMENT = 40
# The first element in a SOAP Body names the operation: the operations of a service share one URL.
_SOAP_OPERATION = re.compile(rb"<(?:[\w.-]+:)?Body[^>]*>\s*<(?:[\w.-]+:)?([\w.-]+)")
_SOAP_HEAD = 4096


@dataclass(frozen=True)
class Request:
    """One HTTP request as it was sent.

    Attributes:
        method: as on the wire.
        url: absolute, with its target as it was sent.
        headers: pairs in sending order; a bearer token is never kept in them.
        body: octets.
        raw: what went over the socket, where the request was written by hand and is no plain HTTP request.
    """

    method: str
    url: str
    headers: tuple[tuple[str, str], ...] = ()
    body: bytes = b""
    raw: bytes | None = None

    @property
    def size(self) -> int:
        """Return how much there is to read in the request; the smallest failing request is the one to show."""
        if self.raw is not None:
            return len(self.raw)
        return len(self.url) + len(self.body) + sum(len(name) + len(value) for name, value in self.headers)

    @property
    def target(self) -> str:
        """Return the request target as it was sent; that of a raw request stands in its first line."""
        target = "/" + self.url.split("//", 1)[-1].partition("/")[2]
        if self.raw is not None:
            words = self.raw.split(b"\r\n", 1)[0].decode("latin-1").split(" ")
            target = words[1] if len(words) > 1 else ""
            if target.startswith(("http://", "https://")):
                target = "/" + target.split("//", 1)[1].partition("/")[2]
        return target

    @property
    def endpoint(self) -> str:
        """Return method, server and path with its values taken out, and the operation of a SOAP message."""
        path = "/".join(
            "*" if _VALUE.search(part) or len(part) > _LONG_SEGMENT else part
            for part in self.target.split("?", 1)[0].split("/")
        )
        scheme, _, rest = self.url.partition("//")
        found = _SOAP_OPERATION.search(self.body[:_SOAP_HEAD]) if self.method == "POST" else None
        operation = f" {found[1].decode('latin-1')}" if found else ""
        return f"{self.method} {scheme}//{rest.partition('/')[0]}{path}{operation}"

    def curl(self) -> str:
        """A shell command that sends the request again (a raw one by nc)."""
        if self.raw is not None:
            host, _, port = self.url.split("//", 1)[-1].split("/", 1)[0].rpartition(":")
            return f"{_printed(self.raw)} | nc {host.strip('[]')} {port}"
        words = ["curl", "-i", "--path-as-is", "-g"]
        if self.method == "HEAD":
            words.append("-I")
        elif self.method != "GET" or self.body:
            words += ["-X", self.method]
        for name, value in self.headers:
            if name.lower() in {"host", "content-length", "connection", "user-agent", "accept-encoding"}:
                continue
            words += ["-H", f"{name}: {value}" if value else f"{name};"]
        pipe = ""
        if self.body:
            if _is_plain(self.body):
                words += ["--data-binary", self.body.decode()]
            else:
                pipe = f"{_printed(self.body)} | "
                words += ["--data-binary", "@-"]
        words.append(self.url)
        # $ROAAS_TOKEN has to be expanded by the shell, so its header is quoted by hand.
        return pipe + " ".join(
            '"Authorization: Bearer $ROAAS_TOKEN"'
            if word == "Authorization: Bearer $ROAAS_TOKEN"
            else shlex.quote(word)
            for word in words
        )


def _is_plain(body: bytes) -> bool:
    if len(body) > _CURL_PLAIN_LIMIT or body.startswith(b"@"):
        return False
    try:
        return all(char.isprintable() or char in "\n\t" for char in body.decode())
    except UnicodeDecodeError:
        return False


def _printed(body: bytes) -> str:
    """A shell command that writes ``body``; compressed where that makes it shorter, as attack bodies are huge."""
    packed = gzip.compress(body, mtime=0)
    if len(packed) < len(body):
        return f"echo {base64.b64encode(packed).decode()} | base64 -d | gunzip"
    return f"echo {base64.b64encode(body).decode()} | base64 -d"


@dataclass(frozen=True)
class Response:
    """One HTTP response.

    Attributes:
        status: status code.
        headers: pairs in the order and spelling in which they came.
        body: octets, after transfer coding and before content coding.
        elapsed_ms: from the first octet sent to the last one received.
        http_version: ``HTTP/1.1`` or ``HTTP/1.0``.
        received_s: when its last octet came, s on the monotonic clock; 0 where nobody looked.
    """

    status: int
    headers: tuple[tuple[str, str], ...]
    body: bytes
    elapsed_ms: float
    http_version: str = "HTTP/1.1"
    received_s: float = field(default=0.0, compare=False)

    @cached_property
    def _by_name(self) -> dict[str, list[str]]:
        """The values of each field, by its name in lower case: every answer is looked through by many."""
        found: dict[str, list[str]] = {}
        for name, value in self.headers:
            found.setdefault(name.lower(), []).append(value)
        return found

    def header(self, name: str) -> str | None:
        """The value of a field, several joined by commas (RFC 9110 5.3); None where there is none."""
        values = self._by_name.get(name.lower())
        return ", ".join(values) if values else None

    def repeated(self, *names: str) -> str:
        """The first of these fields that stands more than once; empty where none does."""
        return next((name for name in names if len(self._by_name.get(name.lower(), ())) > 1), "")

    @cached_property
    def media_type(self) -> str:
        """Content-Type without parameters, in lower case; empty where there is none."""
        return (self.header("content-type") or "").split(";", 1)[0].strip().lower()

    @property
    def ok(self) -> bool:
        """Whether the status is 2xx."""
        return 200 <= self.status < 300  # noqa: PLR2004 - RFC 9110 15.3


@dataclass(frozen=True)
class Exchange:
    """A request with its answer.

    Attributes:
        request: what was sent.
        response: what came.
    """

    request: Request
    response: Response

    @property
    def came(self) -> str:
        """What came, in a few words for a finding."""
        kind = f", {self.response.media_type}" if self.response.media_type else ""
        return f"status {self.response.status}{kind}"


class NoAnswer(StrEnum):
    """Why no answer came."""

    REFUSED = "refused"
    TIMEOUT = "timeout"
    CLOSED = "closed"
    TLS = "tls"
    MALFORMED = "malformed"
    # The endpoint has hung before, so nothing was sent.
    CIRCUIT_OPEN = "circuit-open"


@dataclass(frozen=True)
class Unanswered:
    """A request to which no HTTP response came.

    Attributes:
        request: what was sent.
        problem: what happened instead ("no response within 10 s", ...).
        kind: the same as one of a few.
    """

    request: Request
    problem: str
    kind: NoAnswer

    @property
    def came(self) -> str:
        """What came, in a few words for a finding: nothing, and why."""
        return self.problem


# What became of a request: what a finding can be shown by.
Attempt = Exchange | Unanswered


class NoAnswerError(Exception):
    """A request was sent and no HTTP response came.

    Attributes:
        unanswered: the request, and what happened instead.
    """

    def __init__(self, unanswered: Unanswered) -> None:
        super().__init__(unanswered.problem)
        self.unanswered = unanswered

    @property
    def kind(self) -> NoAnswer:
        """What happened, as one of a few."""
        return self.unanswered.kind


class Listener:
    """Is told what became of every request; each kind that it does not override, it lets pass."""

    def answered(self, exchange: Exchange) -> None:
        """An answer came."""

    def unanswered(self, request: Unanswered) -> None:
        """None came."""
