"""What mutants are made of: conditions that choose exchanges, and edits of requests and responses."""

from __future__ import annotations

import contextlib
import json
import re
from collections.abc import Callable
from typing import Any
from urllib.parse import parse_qsl, urlencode

from conformance.mutation.messages import Change, Forward, HangUpError, Request, Response

Where = Callable[[Request], bool]
When = Callable[[Response], bool]
Make = Callable[[], Change]

JSON = "application/json"
SOAP = "http://schemas.xmlsoap.org/soap/envelope/"
_SUCCESS, _REFUSED = range(200, 300), range(400, 500)


def rest(method: str = "", *paths: str) -> Where:
    """REST requests with one of these methods (any, when empty) to one of these paths (likewise)."""
    methods = method.split()

    def where(request: Request) -> bool:
        return (
            request.side == "rest"
            and (not methods or request.method in methods)
            and (not paths or request.path in paths)
        )

    return where


def unwanted(where: Where) -> Where:
    """Return a condition for those requests that accept only a media type that no device has."""
    return lambda request: where(request) and (request.field("Accept") or "").startswith("image/")


def soap(*operations: str) -> Where:
    """SOAP requests whose body speaks of one of these operations (of any, when there are none)."""
    names = "|".join(operations) or r"[\w.-]+"
    pattern = re.compile(rb"<(?:[\w.-]+:)?(?:%s)[\s/>]" % names.encode())

    def where(request: Request) -> bool:
        return request.side == "soap" and request.method == "POST" and bool(pattern.search(request.body))

    return where


def posted(request: Request) -> bool:
    """SOAP requests, whatever is in them."""
    return request.side == "soap" and request.method == "POST"


def wsdls(request: Request) -> bool:
    """Requests for a WSDL, or for a document that it imports."""
    return request.side == "soap" and request.method in {"GET", "HEAD"} and bool(request.query)


def success(response: Response) -> bool:
    """Answers with 2xx."""
    return response.status in _SUCCESS


def status(*values: int) -> When:
    """Answers with one of these."""
    return lambda response: response.status in values


def refusal(response: Response) -> bool:
    """Answers with 4xx."""
    return response.status in _REFUSED


def anything(_answer: Response) -> bool:
    """Every answer."""
    return True


def altered(where: Where, edit: Callable[[Response], object], when: When = success, *, nth: int = 1) -> Make:
    """Alter answers; with ``nth`` only each nth of those that it concerns."""

    def make() -> Change:
        seen = 0

        def change(request: Request, forward: Forward) -> Response:
            nonlocal seen
            response = forward(request)
            if where(request) and when(response):
                seen += 1
                if seen % nth == 0:
                    response = response.copy()
                    edit(response)
            return response

        return change

    return make


def rewritten(where: Where, edit: Callable[[Request], object]) -> Make:
    """Alter requests on their way to the robot."""

    def make() -> Change:
        def change(request: Request, forward: Forward) -> Response:
            if where(request):
                request = request.copy()
                edit(request)
            return forward(request)

        return change

    return make


def secretly(where: Where, edit: Callable[[Request], object]) -> Make:
    """Alter requests on their way to the robot, and answer 204, so that no answer tells."""

    def make() -> Change:
        def change(request: Request, forward: Forward) -> Response:
            if not where(request):
                return forward(request)
            altered_request = request.copy()
            edit(altered_request)
            response = forward(altered_request)
            return Response(204, method=request.method) if success(response) else response

        return change

    return make


def instead(where: Where, response: Callable[[Request], Response]) -> Make:
    """Answer requests without asking the robot."""

    def make() -> Change:
        def change(request: Request, forward: Forward) -> Response:
            return response(request) if where(request) else forward(request)

        return change

    return make


def hanging_up(where: Where) -> Make:
    """Close the connection in place of a response."""

    def respond(_request: Request) -> Response:
        raise HangUpError

    return instead(where, respond)


def plain(
    status_: int, body: bytes = b"", media_type: str = "", *fields: tuple[str, str]
) -> Callable[[Request], Response]:
    """An answer of one's own."""
    said = [("Content-Type", media_type)] if media_type else []
    return lambda request: Response(status_, [*said, *fields], body, method=request.method)


def problem(status_: int, detail: str, *fields: tuple[str, str]) -> Callable[[Request], Response]:
    """A problem as RFC 9457 has it."""
    body = json.dumps({"status": status_, "detail": detail}).encode()
    return plain(status_, body, "application/problem+json", *fields)


def page(status_: int, body: bytes = b"", media_type: str = "") -> Callable[[Response], object]:
    """Another status and another body, of this media type (of none, when empty); the other fields stay."""

    def edit(response: Response) -> None:
        response.status, response.reason, response.body = status_, "", body
        header("Content-Type", media_type or None)(response)

    return edit


def becomes(status_: int) -> Callable[[Response], object]:
    """Another status, in the problem too."""

    def edit(response: Response) -> None:
        response.status, response.reason = status_, ""
        if response.media_type.endswith("problem+json"):
            value = parsed(response.body)
            if isinstance(value, dict):
                response.body = json.dumps({**value, "status": status_}).encode()

    return edit


def parsed(body: bytes) -> Any:
    """JSON, or None."""
    try:
        return json.loads(body)
    except (ValueError, RecursionError):
        return None


def values(edit: Callable[[Any], Any]) -> Callable[[Response], object]:
    """Alter the value of a JSON answer: ``edit`` changes it in place, or returns another one."""

    def apply(response: Response) -> None:
        value = parsed(response.body)
        if value is not None and response.media_type.endswith("json"):
            made = edit(value)
            response.body = json.dumps(value if made is None else made).encode()

    return apply


def inputs(edit: Callable[[Any], Any]) -> Callable[[Request], object]:
    """Alter the value of a JSON request, as values() does."""

    def apply(request: Request) -> None:
        value = parsed(request.body)
        if value is not None:
            made = edit(value)
            request.body = json.dumps(value if made is None else made).encode()

    return apply


def guarded(edit: Callable[[Any], object]) -> Callable[[Any], None]:
    """An edit that leaves values of another shape than it expects as they are, to be refused."""

    def apply(value: Any) -> None:
        with contextlib.suppress(TypeError, KeyError, AttributeError, ValueError, OverflowError):
            edit(value)

    return apply


def query(edit: Callable[[dict[str, str]], object]) -> Callable[[Request], object]:
    """Alter the parameters of a request's query."""

    def apply(request: Request) -> None:
        given = dict(parse_qsl(request.query, keep_blank_values=True))
        edit(given)
        request.target = f"{request.path}?{urlencode(given)}"

    return apply


def text(pattern: str, by: str, count: int = 0) -> Callable[[Response], object]:
    """Replace a regular expression in an answer's body."""
    compiled = re.compile(pattern.encode(), re.DOTALL)

    def edit(response: Response) -> None:
        response.body = compiled.sub(by.encode(), response.body, count=count)

    return edit


def header(name: str, value: str | None) -> Callable[[Response], object]:
    """Set a header field, or remove it."""
    return lambda response: response.drop(name) if value is None else response.put(name, value)
