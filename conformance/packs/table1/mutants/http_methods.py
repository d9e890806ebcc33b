"""Mutants that break HTTP's rules for methods, content negotiation and status codes."""

from collections.abc import Callable

from conformance.mutation.changes import (
    JSON,
    anything,
    becomes,
    header,
    page,
    plain,
    problem,
    refusal,
    rest,
    status,
    success,
)
from conformance.mutation.messages import Forward, Request, Response
from conformance.mutation.table import Table
from conformance.packs.table1.mutants.paths import GOAL, POSE, RESOURCES, SENSORS, SERVICES, VELOCITY

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
            response.put("Allow", ", ".join(edit([one.strip() for one in allow.split(",")])))

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


_mutant("http-203", "declared-status", "GET of the sensors returns 203.").altered(rest("GET", SENSORS), becomes(203))
_mutant("http-202-delete", "declared-status", "DELETE of a goal returns 202.").altered(
    rest("DELETE", GOAL), becomes(202)
)
_mutant("http-wrapped", "declared-body", "Lists are wrapped in an object.").json(
    rest("GET", SERVICES), lambda items: {"services": items}
)
_mutant("http-html", "declared-body", "The list of services has the media type text/html.").altered(
    rest("GET", SERVICES), header("Content-Type", "text/html")
)
_mutant("http-crash-on-input", "no-server-error", "Invalid request bodies return 500.").altered(
    _INPUT, becomes(500), refusal
)
_mutant("http-crash-on-query", "no-server-error", "Invalid queries return 500.").altered(
    rest("GET", "/robot/navigation/service/plan"), becomes(500), refusal
)
_mutant("http-every-second-read", "available", "Every second GET returns 503 with Retry-After.").altered(
    _GET, _unavailable, anything, nth=2
)
_mutant("http-crash-sometimes", "declared-status", "One GET in 50 returns 502.").altered(
    _GET, becomes(502), anything, nth=50
)
_mutant("http-post-reads", "method-not-allowed", "POST is handled like GET.")(
    lambda request, forward: forward(
        request.copy(method="GET") if _ANY(request) and request.method == "POST" else request
    )
)
_mutant("http-404-for-405", "method-not-allowed", "Unsupported methods return 404.").altered(
    _ANY, becomes(404), status(405)
)
_mutant("http-unknown-method-404", "unknown-method", "Unknown methods return 404.").altered(
    _strange, becomes(404), anything
)
_mutant("http-unknown-method-reads", "unknown-method-refused", "Unknown methods are handled like GET.")(
    lambda request, forward: forward(request.copy(method="GET") if _strange(request) else request)
)
_mutant("http-405-without-allow", "allow", "405 responses have no Allow header.").altered(
    _ANY, header("Allow", None), status(405)
)
_mutant("http-no-head", "head", "HEAD returns 405.").instead(_HEAD, plain(405, b"", "", ("Allow", "GET, OPTIONS")))
_mutant("http-head-other-type", "head-content-type", "HEAD returns Content-Type text/html.").altered(
    _HEAD, header("Content-Type", "text/html")
)
_mutant("http-no-options", "options", "OPTIONS returns 405.").instead(
    _OPTIONS, problem(405, "no OPTIONS", ("Allow", "GET, HEAD"))
)
_mutant("http-options-mute", "options", "Responses to OPTIONS have no Allow header.").altered(
    _OPTIONS, header("Allow", None)
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
_mutant("http-slash-lost", "trailing-slash", "A path without its trailing slash redirects to the front page.").instead(
    _missing_slash, plain(302, b"", "", ("Location", "/"))
)
_mutant("http-accepts-anything", "not-acceptable", "The robot ignores Accept.").rewritten(
    _GET, lambda request: request.put("Accept", JSON)
)
_mutant("http-406-as-400", "not-acceptable", "The robot returns 400 where it should return 406.").altered(
    _GET, becomes(400), status(406)
)
_mutant("http-q-zero-ignored", "q-zero", "The robot returns JSON although Accept has q=0 for it.").rewritten(
    _GET, _q_zero_ignored
)
_mutant("http-any-type", "unsupported-media-type", "The robot reads a body of any media type as JSON.").rewritten(
    _INPUT, _typed_as_json
)
_mutant("http-415-as-400", "unsupported-media-type", "Unsupported media types return 400.").altered(
    _ANY, becomes(400), status(415)
)
_mutant("http-no-charset", "charset", "Content-Type with a charset parameter returns 415.").instead(
    _charset, problem(415, "Content-Type: parameters are not taken")
)
_mutant("http-put-once", "put-idempotent", "Repeating a PUT returns 409.").made(
    lambda: _SecondTime("PUT", problem(409, "linear.x: that is so already"))
)
_mutant("http-delete-crash", "delete-idempotent", "Repeating a DELETE returns 500.").made(
    lambda: _SecondTime("DELETE", problem(500, "no goal"))
)
_mutant("http-no-content-type", "content-type", "Responses have no Content-Type.").altered(
    _ANY, header("Content-Type", None), anything
)
_mutant("http-no-content-type-sometimes", "content-type", "One response in 50 has no Content-Type.").altered(
    rest("GET", POSE, VELOCITY), header("Content-Type", None), nth=50
)
_mutant("http-no-date", "date", "Responses have no Date.").altered(_ANY, header("Date", None), anything)
_mutant("http-date-zone", "date-format", "Date ends with -0000 instead of GMT.").altered(
    _ANY, lambda response: response.put("Date", (response.field("Date") or "").replace("GMT", "-0000")), anything
)
_mutant("http-date-old", "date-format", "One Date in 50 has the obsolete format of RFC 850.").altered(
    rest("GET", POSE, VELOCITY), header("Date", "Sunday, 06-Nov-94 08:49:37 GMT"), nth=50
)
_mutant("http-etag-bare", "etag-format", "ETag has no quotes.").altered(_ANY, header("ETag", "a1"), anything)
