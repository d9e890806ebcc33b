"""Robots that break HTTP's rules of methods, negotiation and statuses."""

from collections.abc import Callable

from conformance.mutation.changes import (
    JSON,
    altered,
    anything,
    becomes,
    header,
    instead,
    page,
    plain,
    problem,
    refusal,
    rest,
    rewritten,
    status,
    success,
    values,
)
from conformance.mutation.messages import Forward, Request, Response
from conformance.mutation.mutant import of_class
from conformance.packs.table1.mutants.paths import GOAL, POSE, RESOURCES, SENSORS, SERVICES, VELOCITY

_ANY, _GET, _HEAD, _OPTIONS = rest(), rest("GET"), rest("HEAD"), rest("OPTIONS")
_INPUT = rest("PUT", *RESOURCES)


def _with_body(request: Request, forward: Forward) -> Response:
    """HEAD is answered with the body of GET."""
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


def _cancelling(request: Request, forward: Forward) -> Response:
    """HEAD and OPTIONS of the goal cancel it."""
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


def _not_found(request: Request, forward: Forward) -> Response:
    """Unknown paths are 405 for what is not GET."""
    response = forward(request)
    if (
        response.status == 404
        and request.side == "rest"
        and request.method not in {"GET", "HEAD"}
        and request.path not in RESOURCES
    ):
        response = problem(405, "not here", ("Allow", "GET"))(request)
    return response


_mutant = of_class("http", "rest")


MUTANTS = (
    _mutant("http-203", "The sensors come with 203.", "declared-status", altered(rest("GET", SENSORS), becomes(203))),
    _mutant(
        "http-202-delete", "DELETE of a goal is 202.", "declared-status", altered(rest("DELETE", GOAL), becomes(202))
    ),
    _mutant(
        "http-wrapped",
        "Lists are wrapped in an object.",
        "declared-body",
        altered(rest("GET", SERVICES), values(lambda items: {"services": items})),
    ),
    _mutant(
        "http-html",
        "The services come as text/html.",
        "declared-body",
        altered(rest("GET", SERVICES), header("Content-Type", "text/html")),
    ),
    _mutant(
        "http-crash-on-input",
        "What is refused is refused with 500.",
        "no-server-error",
        altered(_INPUT, becomes(500), refusal),
    ),
    _mutant(
        "http-crash-on-query",
        "A bad query is answered 500.",
        "no-server-error",
        altered(rest("GET", "/robot/navigation/service/plan"), becomes(500), refusal),
    ),
    _mutant(
        "http-crash-sometimes",
        "One answer in 50 is 502.",
        "declared-status",
        altered(_GET, becomes(502), anything, nth=50),
    ),
    _mutant(
        "http-post-reads",
        "POST is answered like GET.",
        "method-not-allowed",
        lambda: (
            lambda request, forward: forward(
                request.copy(method="GET") if _ANY(request) and request.method == "POST" else request
            )
        ),
    ),
    _mutant(
        "http-404-for-405",
        "A method that is not there is 404.",
        "method-not-allowed",
        altered(_ANY, becomes(404), status(405)),
    ),
    _mutant(
        "http-unknown-method-404",
        "A method that nobody knows is 404.",
        "unknown-method",
        altered(_strange, becomes(404), anything),
    ),
    _mutant(
        "http-unknown-method-reads",
        "A method that nobody knows is taken for GET.",
        "unknown-method-refused",
        lambda: lambda request, forward: forward(request.copy(method="GET") if _strange(request) else request),
    ),
    _mutant(
        "http-405-without-allow", "405 comes without Allow.", "allow", altered(_ANY, header("Allow", None), status(405))
    ),
    _mutant("http-no-head", "HEAD is 405.", "head", instead(_HEAD, plain(405, b"", "", ("Allow", "GET, OPTIONS")))),
    _mutant(
        "http-head-other-type",
        "HEAD says text/html.",
        "head-content-type",
        altered(_HEAD, header("Content-Type", "text/html")),
    ),
    _mutant("http-head-with-body", "HEAD is answered with a body.", "head-no-body", lambda: _with_body),
    _mutant(
        "http-no-options",
        "OPTIONS is 405.",
        "options",
        instead(_OPTIONS, problem(405, "no OPTIONS", ("Allow", "GET, HEAD"))),
    ),
    _mutant("http-options-mute", "OPTIONS comes without Allow.", "options", altered(_OPTIONS, header("Allow", None))),
    _mutant(
        "http-allow-get-only",
        "Allow names GET alone.",
        "allow-agrees",
        altered(_ANY, _allow(lambda _: ["GET", "HEAD", "OPTIONS"]), anything),
    ),
    _mutant(
        "http-allow-too-much",
        "Allow names DELETE everywhere.",
        "allow-agrees",
        altered(_ANY, _allow(lambda methods: sorted({*methods, "DELETE", "PATCH"})), anything),
    ),
    _mutant(
        "http-unknown-path-page",
        "An unknown path is answered with a page.",
        "not-found",
        altered(
            lambda request: _ANY(request) and request.path not in RESOURCES,
            page(200, b"<html><body>Welcome</body></html>", "text/html"),
            status(404),
        ),
    ),
    _mutant("http-unknown-path-405", "An unknown path is 405 for PUT.", "not-found", lambda: _not_found),
    _mutant(
        "http-slash-served",
        "A path without its slash is served.",
        "trailing-slash",
        lambda: (
            lambda request, forward: forward(
                request.copy(target=request.target.replace(request.path, f"{request.path}/", 1))
                if _missing_slash(request)
                else request
            )
        ),
    ),
    _mutant(
        "http-slash-lost",
        "A path without its slash leads to the front page.",
        "trailing-slash",
        instead(_missing_slash, plain(302, b"", "", ("Location", "/"))),
    ),
    _mutant(
        "http-accepts-anything",
        "Accept is not looked at.",
        "not-acceptable",
        rewritten(_GET, lambda request: request.put("Accept", JSON)),
    ),
    _mutant(
        "http-406-as-400",
        "Where nothing is acceptable, the answer is 400.",
        "not-acceptable",
        altered(_GET, becomes(400), status(406)),
    ),
    _mutant(
        "http-q-zero-ignored", "JSON is sent although its quality is 0.", "q-zero", rewritten(_GET, _q_zero_ignored)
    ),
    _mutant(
        "http-any-type",
        "A body of any type is read as JSON.",
        "unsupported-media-type",
        rewritten(_INPUT, _typed_as_json),
    ),
    _mutant(
        "http-415-as-400",
        "An unknown media type is 400.",
        "unsupported-media-type",
        altered(_ANY, becomes(400), status(415)),
    ),
    _mutant(
        "http-no-charset",
        "A charset parameter is refused.",
        "charset",
        instead(_charset, problem(415, "Content-Type: parameters are not taken")),
    ),
    _mutant("http-unsafe-head", "HEAD and OPTIONS of the goal cancel it.", "safe", lambda: _cancelling),
    _mutant(
        "http-put-once",
        "The same PUT right after itself is 409.",
        "put-idempotent",
        lambda: _SecondTime("PUT", problem(409, "linear.x: that is so already")),
    ),
    _mutant(
        "http-delete-crash",
        "A second DELETE is 500.",
        "delete-idempotent",
        lambda: _SecondTime("DELETE", problem(500, "no goal")),
    ),
    _mutant(
        "http-no-content-type",
        "Answers have no Content-Type.",
        "content-type",
        altered(_ANY, header("Content-Type", None), anything),
    ),
    _mutant(
        "http-no-content-type-sometimes",
        "One answer in 50 has no Content-Type.",
        "content-type",
        altered(rest("GET", POSE, VELOCITY), header("Content-Type", None), nth=50),
    ),
    _mutant("http-no-date", "Answers have no Date.", "date", altered(_ANY, header("Date", None), anything)),
)
