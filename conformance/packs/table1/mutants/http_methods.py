"""Robots that break HTTP's rules of methods, negotiation and statuses."""

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


@_mutant("http-head-with-body", "head-no-body", "HEAD is answered with a body.")
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


@_mutant("http-unsafe-head", "safe", "HEAD and OPTIONS of the goal cancel it.")
def _cancelling(request: Request, forward: Forward) -> Response:
    response = forward(request)
    if request.side == "rest" and request.path == GOAL and request.method in {"HEAD", "OPTIONS"}:
        forward(request.copy(method="DELETE"))
    return response


class _SecondTime:
    """The same request right after itself is answered otherwise."""

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


@_mutant("http-unknown-path-405", "not-found", "An unknown path is 405 for PUT.")
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


_mutant("http-203", "declared-status", "The sensors come with 203.").altered(rest("GET", SENSORS), becomes(203))
_mutant("http-202-delete", "declared-status", "DELETE of a goal is 202.").altered(rest("DELETE", GOAL), becomes(202))
_mutant("http-wrapped", "declared-body", "Lists are wrapped in an object.").json(
    rest("GET", SERVICES), lambda items: {"services": items}
)
_mutant("http-html", "declared-body", "The services come as text/html.").altered(
    rest("GET", SERVICES), header("Content-Type", "text/html")
)
_mutant("http-crash-on-input", "no-server-error", "What is refused is refused with 500.").altered(
    _INPUT, becomes(500), refusal
)
_mutant("http-crash-on-query", "no-server-error", "A bad query is answered 500.").altered(
    rest("GET", "/robot/navigation/service/plan"), becomes(500), refusal
)
_mutant("http-crash-sometimes", "declared-status", "One answer in 50 is 502.").altered(
    _GET, becomes(502), anything, nth=50
)
_mutant("http-post-reads", "method-not-allowed", "POST is answered like GET.")(
    lambda request, forward: forward(
        request.copy(method="GET") if _ANY(request) and request.method == "POST" else request
    )
)
_mutant("http-404-for-405", "method-not-allowed", "A method that is not there is 404.").altered(
    _ANY, becomes(404), status(405)
)
_mutant("http-unknown-method-404", "unknown-method", "A method that nobody knows is 404.").altered(
    _strange, becomes(404), anything
)
_mutant("http-unknown-method-reads", "unknown-method-refused", "A method that nobody knows is taken for GET.")(
    lambda request, forward: forward(request.copy(method="GET") if _strange(request) else request)
)
_mutant("http-405-without-allow", "allow", "405 comes without Allow.").altered(_ANY, header("Allow", None), status(405))
_mutant("http-no-head", "head", "HEAD is 405.").instead(_HEAD, plain(405, b"", "", ("Allow", "GET, OPTIONS")))
_mutant("http-head-other-type", "head-content-type", "HEAD says text/html.").altered(
    _HEAD, header("Content-Type", "text/html")
)
_mutant("http-no-options", "options", "OPTIONS is 405.").instead(
    _OPTIONS, problem(405, "no OPTIONS", ("Allow", "GET, HEAD"))
)
_mutant("http-options-mute", "options", "OPTIONS comes without Allow.").altered(_OPTIONS, header("Allow", None))
_mutant("http-allow-get-only", "allow-agrees", "Allow names GET alone.").altered(
    _ANY, _allow(lambda _: ["GET", "HEAD", "OPTIONS"]), anything
)
_mutant("http-allow-too-much", "allow-agrees", "Allow names DELETE everywhere.").altered(
    _ANY, _allow(lambda methods: sorted({*methods, "DELETE", "PATCH"})), anything
)
_mutant("http-unknown-path-page", "not-found", "An unknown path is answered with a page.").altered(
    lambda request: _ANY(request) and request.path not in RESOURCES,
    page(200, b"<html><body>Welcome</body></html>", "text/html"),
    status(404),
)
_mutant("http-slash-served", "trailing-slash", "A path without its slash is served.")(
    lambda request, forward: forward(
        request.copy(target=request.target.replace(request.path, f"{request.path}/", 1))
        if _missing_slash(request)
        else request
    )
)
_mutant("http-slash-lost", "trailing-slash", "A path without its slash leads to the front page.").instead(
    _missing_slash, plain(302, b"", "", ("Location", "/"))
)
_mutant("http-accepts-anything", "not-acceptable", "Accept is not looked at.").rewritten(
    _GET, lambda request: request.put("Accept", JSON)
)
_mutant("http-406-as-400", "not-acceptable", "Where nothing is acceptable, the answer is 400.").altered(
    _GET, becomes(400), status(406)
)
_mutant("http-q-zero-ignored", "q-zero", "JSON is sent although its quality is 0.").rewritten(_GET, _q_zero_ignored)
_mutant("http-any-type", "unsupported-media-type", "A body of any type is read as JSON.").rewritten(
    _INPUT, _typed_as_json
)
_mutant("http-415-as-400", "unsupported-media-type", "An unknown media type is 400.").altered(
    _ANY, becomes(400), status(415)
)
_mutant("http-no-charset", "charset", "A charset parameter is refused.").instead(
    _charset, problem(415, "Content-Type: parameters are not taken")
)
_mutant("http-put-once", "put-idempotent", "The same PUT right after itself is 409.").made(
    lambda: _SecondTime("PUT", problem(409, "linear.x: that is so already"))
)
_mutant("http-delete-crash", "delete-idempotent", "A second DELETE is 500.").made(
    lambda: _SecondTime("DELETE", problem(500, "no goal"))
)
_mutant("http-no-content-type", "content-type", "Answers have no Content-Type.").altered(
    _ANY, header("Content-Type", None), anything
)
_mutant("http-no-content-type-sometimes", "content-type", "One answer in 50 has no Content-Type.").altered(
    rest("GET", POSE, VELOCITY), header("Content-Type", None), nth=50
)
_mutant("http-no-date", "date", "Answers have no Date.").altered(_ANY, header("Date", None), anything)
