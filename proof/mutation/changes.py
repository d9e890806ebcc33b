"""Building blocks of mutants: conditions that choose requests and responses, and edits of them."""

import contextlib
import json
import re
from collections.abc import Callable
from typing import Any
from urllib.parse import parse_qsl, urlencode

from proof.mutation.messages import Change, Forward, HangUpError, Request, Response

Where = Callable[[Request], bool]
When = Callable[[Response], bool]
Make = Callable[[], Change]

JSON = "application/json"
SOAP = "http://schemas.xmlsoap.org/soap/envelope/"
_SUCCESS, _REFUSED = range(200, 300), range(400, 500)


def rest(method: str = "", *paths: str) -> Where:
    """Return a condition for REST requests by method (several are separated by spaces; empty for any) and path."""
    methods = method.split()

    def where(request: Request) -> bool:
        return (
            request.side == "rest"
            and (not methods or request.method in methods)
            and (not paths or request.path in paths)
        )

    return where


def unwanted(where: Where) -> Where:
    """Return a condition for requests of ``where`` that accept only images, which no device has."""
    return lambda request: where(request) and (request.field("Accept") or "").startswith("image/")


def soap(*operations: str) -> Where:
    """Return a condition for SOAP requests that name one of the operations, or any if none is given."""
    names = "|".join(operations) or r"[\w.-]+"
    pattern = re.compile(rb"<(?:[\w.-]+:)?(?:%s)[\s/>]" % names.encode())

    def where(request: Request) -> bool:
        return request.side == "soap" and request.method == "POST" and bool(pattern.search(request.body))

    return where


def containing(where: Where, pattern: bytes, least: int = 1) -> Where:
    """Return a condition for requests of ``where`` whose body has a pattern so often at least; 0 if not at all."""
    compiled = re.compile(pattern)

    def holds(request: Request) -> bool:
        found = len(compiled.findall(request.body)) if where(request) else -1
        return found >= least if least else found == 0

    return holds


def larger(where: Where, octets: int) -> Where:
    """Return a condition for requests of ``where`` whose body is larger."""
    return lambda request: where(request) and len(request.body) > octets


def with_field(where: Where, name: str, pattern: str) -> Where:
    """Return a condition for requests of ``where`` whose header field, which may be empty, has a pattern."""
    return lambda request: where(request) and bool(re.search(pattern, request.field(name) or ""))


def posted(request: Request) -> bool:
    """Return whether a request is a SOAP POST, whatever its body."""
    return request.side == "soap" and request.method == "POST"


def wsdls(request: Request) -> bool:
    """Return whether a request is for a WSDL or a document that it imports."""
    return request.side == "soap" and request.method in {"GET", "HEAD"} and bool(request.query)


def success(response: Response) -> bool:
    """Return whether the status is 2xx."""
    return response.status in _SUCCESS


def status(*values: int) -> When:
    """Return a condition for responses with one of the statuses."""
    return lambda response: response.status in values


def refusal(response: Response) -> bool:
    """Return whether the status is 4xx."""
    return response.status in _REFUSED


def failure(response: Response) -> bool:
    """Return whether the status is 4xx or 5xx."""
    return response.status >= _REFUSED.start


def anything(_answer: Response) -> bool:
    """Return True for every response."""
    return True


def altered(where: Where, edit: Callable[[Response], object], when: When = success, *, nth: int = 1) -> Make:
    """Return a change that edits every nth response to ``where`` that fulfils ``when``."""

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
    """Return a change that edits requests before they reach the device."""

    def make() -> Change:
        def change(request: Request, forward: Forward) -> Response:
            if where(request):
                request = request.copy()
                edit(request)
            return forward(request)

        return change

    return make


def secretly(where: Where, edit: Callable[[Request], object]) -> Make:
    """Return a change that edits requests and answers a success with 204, which does not show the edit."""

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
    """Return a change that answers requests without forwarding them to the device."""

    def make() -> Change:
        def change(request: Request, forward: Forward) -> Response:
            return response(request) if where(request) else forward(request)

        return change

    return make


def always(change: Change) -> Make:
    """Return a change that remembers nothing, for any run."""
    return lambda: change


def replied(response: Callable[[Request], Response]) -> Change:
    """Return a change that answers each request without forwarding it to the device."""
    return lambda request, _: response(request)


def hanging_up(where: Where) -> Make:
    """Return a change that closes the connection instead of responding."""

    def respond(_request: Request) -> Response:
        raise HangUpError

    return instead(where, respond)


def plain(
    status_: int, body: bytes = b"", media_type: str = "", *fields: tuple[str, str]
) -> Callable[[Request], Response]:
    """Return a maker of responses with this status, body, media type and headers."""
    said = [("Content-Type", media_type)] if media_type else []
    return lambda request: Response(status_, [*said, *fields], body, method=request.method)


def problem(status_: int, detail: str, *fields: tuple[str, str]) -> Callable[[Request], Response]:
    """Return a maker of responses with problem details (RFC 9457)."""
    body = json.dumps({"status": status_, "detail": detail}).encode()
    return plain(status_, body, "application/problem+json", *fields)


def page(status_: int, body: bytes = b"", media_type: str = "") -> Callable[[Response], object]:
    """Return an edit that replaces status, body and media type; an empty media type removes the header."""

    def edit(response: Response) -> None:
        response.status, response.reason, response.body = status_, "", body
        header("Content-Type", media_type or None)(response)

    return edit


def becomes(status_: int) -> Callable[[Response], object]:
    """Return an edit that replaces the status, in problem details too."""

    def edit(response: Response) -> None:
        response.status, response.reason = status_, ""
        if response.media_type.endswith("problem+json"):
            value = parsed(response.body)
            if isinstance(value, dict):
                response.body = json.dumps({**value, "status": status_}).encode()

    return edit


def parsed(body: bytes) -> Any:
    """Return the JSON value of a body, or None if it is not JSON."""
    try:
        return json.loads(body)
    except (ValueError, RecursionError):
        return None


def values(edit: Callable[[Any], Any]) -> Callable[[Response], object]:
    """Return an edit of JSON responses: ``edit`` changes the value in place or returns another one."""

    def apply(response: Response) -> None:
        value = parsed(response.body)
        if value is not None and response.media_type.endswith("json"):
            made = edit(value)
            response.body = json.dumps(value if made is None else made).encode()

    return apply


def inputs(edit: Callable[[Any], Any]) -> Callable[[Request], object]:
    """Return an edit of JSON requests: ``edit`` changes the value in place or returns another one."""

    def apply(request: Request) -> None:
        value = parsed(request.body)
        if value is not None:
            made = edit(value)
            request.body = json.dumps(value if made is None else made).encode()

    return apply


def guarded(edit: Callable[[Any], object]) -> Callable[[Any], None]:
    """Return an edit that leaves a value of unexpected shape unchanged, so that the device refuses it."""

    def apply(value: Any) -> None:
        with contextlib.suppress(TypeError, KeyError, AttributeError, ValueError, OverflowError):
            edit(value)

    return apply


def query(edit: Callable[[dict[str, str]], object]) -> Callable[[Request], object]:
    """Return an edit of the parameters in a request's query."""

    def apply(request: Request) -> None:
        given = dict(parse_qsl(request.query, keep_blank_values=True))
        edit(given)
        request.target = f"{request.path}?{urlencode(given)}"

    return apply


def text(pattern: str, by: str, count: int = 0) -> Callable[[Response], object]:
    """Return an edit that replaces a regular expression in a response's body, ``count`` times (0: everywhere)."""
    compiled = re.compile(pattern.encode(), re.DOTALL)

    def edit(response: Response) -> None:
        response.body = compiled.sub(by.encode(), response.body, count=count)

    return edit


def header(name: str, value: str | None) -> Callable[[Response], object]:
    """Return an edit that sets a header, or removes it if the value is None."""
    return lambda response: response.drop(name) if value is None else response.put(name, value)
