"""Mutants that break HTTP's rules for methods, content negotiation and status codes."""

from collections.abc import Callable

from proof.mutation.changes import JSON, anything, page, problem, rest, status, success
from proof.mutation.messages import Forward, Request, Response
from proof.mutation.table import Table
from proof.table1.mutants.paths import GOAL, RESOURCES

MUTANTS = Table()
_mutant = MUTANTS.of_class("http", "rest")

_ANY, _GET, _HEAD, _OPTIONS = rest(), rest("GET"), rest("HEAD"), rest("OPTIONS")
_INPUT = rest("PUT", *RESOURCES)


@_mutant("http-head-with-body", "head-no-body", "A response to HEAD has a body.")
def _with_body(request: Request, forward: Forward) -> Response:
    response = forward(request)
    if _HEAD(request) and success(response):
        body = forward(request.copy(method="GET")).body
        head = response.octets().split(b"\r\n\r\n")[0]
        response.raw = head + b"\r\n\r\n" + body
    return response


def _q_zero_ignored(request: Request) -> None:
    given = request.field("Accept") or ""
    if "q=0" in given.replace(" ", "") and "json" in given:
        request.put("Accept", JSON)


def _typed_as_json(request: Request) -> None:
    if request.media_type not in {JSON, "application/xml"}:
        request.put("Content-Type", JSON)


def _unavailable(response: Response) -> None:
    page(503, b'{"status": 503, "detail": "not now"}', "application/problem+json")(response)
    response.put("Retry-After", "1")


def _charset(request: Request) -> bool:
    return _INPUT(request) and "charset" in (request.field("Content-Type") or "").lower()


def _allow(edit: Callable[[list[str]], list[str]]) -> Callable[[Response], None]:
    def apply(response: Response) -> None:
        allow = response.field("Allow")
        if allow is not None:
            response.put("Allow", ", ".join(edit([text.strip() for text in allow.split(",")])))

    return apply


def _strange(request: Request) -> bool:
    return _ANY(request) and request.method in {"FOO", "PROPFIND"}


def _missing_slash(request: Request) -> bool:
    return request.side == "rest" and not request.path.endswith("/") and f"{request.path}/" in RESOURCES


@_mutant("http-unsafe-head", "safe", "HEAD and OPTIONS of the goal cancel the goal.")
def _cancelling(request: Request, forward: Forward) -> Response:
    response = forward(request)
    if request.side == "rest" and request.path == GOAL and request.method in {"HEAD", "OPTIONS"}:
        forward(request.copy(method="DELETE"))
    return response


class _SecondTime:
    """A change that answers a request itself when it repeats the previous one."""

    def __init__(self, method: str, response: Callable[[Request], Response]) -> None:
        self._method, self._answer = method, response
        self._last: tuple[str, bytes] | None = None

    def __call__(self, request: Request, forward: Forward) -> Response:
        if request.side != "rest" or request.method in {"GET", "HEAD", "OPTIONS"}:
            return forward(request)
        now, before = (request.method + request.target, request.body), self._last
        if request.method == self._method and now == before:
            return self._answer(request)
        response = forward(request)
        self._last = now if success(response) or response.status == 404 else None
        return response


@_mutant("http-unknown-path-405", "not-found", "PUT to an unknown path returns 405.")
def _not_found(request: Request, forward: Forward) -> Response:
    response = forward(request)
    if (
        response.status == 404
        and request.side == "rest"
        and request.method not in {"GET", "HEAD"}
        and request.path not in RESOURCES
    ):
        response = problem(405, "not here", ("Allow", "GET"))(request)
    return response


_mutant("http-post-reads", "method-not-allowed", "POST is handled like GET.")(
    lambda request, forward: forward(
        request.copy(method="GET") if _ANY(request) and request.method == "POST" else request
    )
)
_mutant("http-unknown-method-reads", "unknown-method-refused", "Unknown methods are handled like GET.")(
    lambda request, forward: forward(request.copy(method="GET") if _strange(request) else request)
)
_mutant("http-allow-get-only", "allow-agrees", "Allow lists only GET, HEAD and OPTIONS.").altered(
    _ANY, _allow(lambda _: ["GET", "HEAD", "OPTIONS"]), anything
)
_mutant("http-allow-too-much", "allow-agrees", "Allow in a 405 response lists all standard methods.").altered(
    _ANY, _allow(lambda methods: sorted({*methods, "PUT", "POST", "DELETE", "PATCH"})), status(405)
)
_mutant("http-unknown-path-page", "not-found", "An unknown path returns 200 with a page.").altered(
    lambda request: _ANY(request) and request.path not in RESOURCES,
    page(200, b"<html><body>Welcome</body></html>", "text/html"),
    status(404),
)
_mutant("http-slash-served", "trailing-slash", "The robot serves paths without their trailing slash.")(
    lambda request, forward: forward(
        request.copy(target=request.target.replace(request.path, f"{request.path}/", 1))
        if _missing_slash(request)
        else request
    )
)
_mutant("http-date-zone", "date-format", "Date ends with -0000 instead of GMT.").altered(
    _ANY, lambda response: response.put("Date", (response.field("Date") or "").replace("GMT", "-0000")), anything
)
