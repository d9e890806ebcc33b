"""Robots that break HTTP's rules of methods, negotiation and statuses."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from conformance.selftest.mutants.changes import (
    GOAL,
    JSON,
    POSE,
    RESOURCES,
    SENSORS,
    SERVICES,
    VELOCITY,
    altered,
    anything,
    becomes,
    header,
    instead,
    plain,
    problem,
    refusal,
    remembering,
    rest,
    rewritten,
    status,
    success,
    values,
)
from conformance.selftest.mutants.mutant import Fault

if TYPE_CHECKING:
    from collections.abc import Callable

    from conformance.selftest.wire import Answer, Ask

    Forward = Callable[[Ask], Answer]

_ANY, _GET, _HEAD, _OPTIONS = rest(), rest("GET"), rest("HEAD"), rest("OPTIONS")
_INPUT = rest("PUT", *RESOURCES)
_COMMON = {"GET", "PUT", "DELETE", "POST", "PATCH"}


def _with_body(ask: Ask, forward: Forward) -> Answer:
    """HEAD is answered with the body of GET."""
    answer = forward(ask)
    if _HEAD(ask) and success(answer):
        body = forward(ask.copy(method="GET")).body
        head = answer.wire().split(b"\r\n\r\n")[0]
        answer.raw = head + b"\r\n\r\n" + body
    return answer


def _accept_anything(ask: Ask) -> None:
    ask.put("Accept", JSON)


def _q_zero_ignored(ask: Ask) -> None:
    given = ask.field("Accept") or ""
    if "q=0" in given.replace(" ", "") and "json" in given:
        ask.put("Accept", JSON)


def _typed_as_json(ask: Ask) -> None:
    if ask.media_type not in {JSON, "application/xml"}:
        ask.put("Content-Type", JSON)


def _charset(ask: Ask) -> bool:
    return _INPUT(ask) and "charset" in (ask.field("Content-Type") or "").lower()


def _allow(edit: Callable[[list[str]], list[str]]) -> Callable[[Answer], None]:
    def apply(answer: Answer) -> None:
        allow = answer.field("Allow")
        if allow is not None:
            answer.put("Allow", ", ".join(edit([one.strip() for one in allow.split(",")])))

    return apply


def _missing_slash(ask: Ask) -> bool:
    return ask.side == "rest" and not ask.path.endswith("/") and f"{ask.path}/" in RESOURCES


def _cancelling(ask: Ask, forward: Forward) -> Answer:
    """HEAD and OPTIONS of the goal cancel it."""
    answer = forward(ask)
    if ask.side == "rest" and ask.path == GOAL and ask.method in {"HEAD", "OPTIONS"}:
        forward(ask.copy(method="DELETE"))
    return answer


class _SecondTime:
    """The same request right after itself is answered otherwise."""

    def __init__(self, method: str, answer: Callable[[Ask], Answer]) -> None:
        self._method, self._answer = method, answer
        self._last: tuple[str, bytes] | None = None

    def __call__(self, ask: Ask, forward: Forward) -> Answer:
        if ask.side != "rest" or ask.method in {"GET", "HEAD", "OPTIONS"}:
            return forward(ask)
        now, before = (ask.method + ask.target, ask.body), self._last
        if ask.method == self._method and now == before:
            return self._answer(ask)
        answer = forward(ask)
        self._last = now if success(answer) or answer.status == 404 else None
        return answer


def _not_found(ask: Ask, forward: Forward) -> Answer:
    """Unknown paths are 405 for what is not GET."""
    answer = forward(ask)
    if answer.status == 404 and ask.side == "rest" and ask.method not in {"GET", "HEAD"} and ask.path not in RESOURCES:
        answer = problem(405, "not here", ("Allow", "GET"))(ask)
    return answer


def _fault(name: str, says: str, id_: str, make: Any) -> Fault:
    return Fault(name, says, (f"http/{id_}",), "rest", make)


def _page(answer: Answer) -> None:
    answer.status, answer.reason, answer.body = 200, "", b"<html><body>Welcome</body></html>"
    answer.put("Content-Type", "text/html")


FAULTS = (
    _fault("http-203", "The sensors come with 203.", "declared-status", altered(rest("GET", SENSORS), becomes(203))),
    _fault(
        "http-202-delete", "DELETE of a goal is 202.", "declared-status", altered(rest("DELETE", GOAL), becomes(202))
    ),
    _fault(
        "http-wrapped",
        "Lists are wrapped in an object.",
        "declared-body",
        altered(rest("GET", SERVICES), values(lambda items: {"services": items})),
    ),
    _fault(
        "http-html",
        "The services come as text/html.",
        "declared-body",
        altered(rest("GET", SERVICES), header("Content-Type", "text/html")),
    ),
    _fault(
        "http-crash-on-input",
        "What is refused is refused with 500.",
        "no-server-error",
        altered(_INPUT, becomes(500), refusal),
    ),
    _fault(
        "http-crash-on-query",
        "A bad query is answered 500.",
        "no-server-error",
        altered(rest("GET", "/robot/navigation/service/plan"), becomes(500), refusal),
    ),
    _fault(
        "http-crash-sometimes",
        "One answer in 50 is 502.",
        "no-server-error",
        altered(_GET, becomes(502), anything, nth=50),
    ),
    _fault(
        "http-post-reads",
        "POST is answered like GET.",
        "method-not-allowed",
        lambda: lambda ask, forward: forward(ask.copy(method="GET") if _ANY(ask) and ask.method == "POST" else ask),
    ),
    _fault(
        "http-404-for-405",
        "A method that is not there is 404.",
        "method-not-allowed",
        altered(_ANY, becomes(404), status(405)),
    ),
    _fault(
        "http-405-without-allow", "405 comes without Allow.", "allow", altered(_ANY, header("Allow", None), status(405))
    ),
    _fault("http-no-head", "HEAD is 405.", "head", instead(_HEAD, plain(405, b"", "", ("Allow", "GET, OPTIONS")))),
    _fault("http-head-other-type", "HEAD says text/html.", "head", altered(_HEAD, header("Content-Type", "text/html"))),
    _fault("http-head-with-body", "HEAD is answered with a body.", "head-no-body", lambda: _with_body),
    _fault(
        "http-no-options",
        "OPTIONS is 405.",
        "options",
        instead(_OPTIONS, problem(405, "no OPTIONS", ("Allow", "GET, HEAD"))),
    ),
    _fault("http-options-mute", "OPTIONS comes without Allow.", "options", altered(_OPTIONS, header("Allow", None))),
    _fault(
        "http-allow-get-only",
        "Allow names GET alone.",
        "allow-agrees",
        altered(_ANY, _allow(lambda _: ["GET", "HEAD", "OPTIONS"]), anything),
    ),
    _fault(
        "http-allow-too-much",
        "Allow names DELETE everywhere.",
        "allow-agrees",
        altered(_ANY, _allow(lambda methods: sorted({*methods, "DELETE", "PATCH"})), anything),
    ),
    _fault(
        "http-unknown-path-page",
        "An unknown path is answered with a page.",
        "not-found",
        altered(lambda ask: _ANY(ask) and ask.path not in RESOURCES, _page, status(404)),
    ),
    _fault("http-unknown-path-405", "An unknown path is 405 for PUT.", "not-found", lambda: _not_found),
    _fault(
        "http-slash-served",
        "A path without its slash is served.",
        "trailing-slash",
        lambda: (
            lambda ask, forward: forward(
                ask.copy(target=ask.target.replace(ask.path, f"{ask.path}/", 1)) if _missing_slash(ask) else ask
            )
        ),
    ),
    _fault(
        "http-slash-lost",
        "A path without its slash leads to the front page.",
        "trailing-slash",
        instead(_missing_slash, plain(302, b"", "", ("Location", "/"))),
    ),
    _fault("http-accepts-anything", "Accept is not looked at.", "not-acceptable", rewritten(_GET, _accept_anything)),
    _fault(
        "http-406-as-400",
        "Where nothing is acceptable, the answer is 400.",
        "not-acceptable",
        altered(_GET, becomes(400), status(406)),
    ),
    _fault(
        "http-q-zero-ignored", "JSON is sent although its quality is 0.", "q-zero", rewritten(_GET, _q_zero_ignored)
    ),
    _fault(
        "http-any-type",
        "A body of any type is read as JSON.",
        "unsupported-media-type",
        rewritten(_INPUT, _typed_as_json),
    ),
    _fault(
        "http-415-as-400",
        "An unknown media type is 400.",
        "unsupported-media-type",
        altered(_ANY, becomes(400), status(415)),
    ),
    _fault(
        "http-no-charset",
        "A charset parameter is refused.",
        "charset",
        instead(_charset, problem(415, "Content-Type: parameters are not taken")),
    ),
    _fault("http-unsafe-head", "HEAD and OPTIONS of the goal cancel it.", "safe", lambda: _cancelling),
    _fault(
        "http-put-once",
        "The same PUT right after itself is 409.",
        "put-idempotent",
        remembering(lambda: _SecondTime("PUT", problem(409, "linear.x: that is so already"))),
    ),
    _fault(
        "http-delete-crash",
        "A second DELETE is 500.",
        "delete-idempotent",
        remembering(lambda: _SecondTime("DELETE", problem(500, "no goal"))),
    ),
    _fault(
        "http-no-content-type",
        "Answers have no Content-Type.",
        "content-type",
        altered(_ANY, header("Content-Type", None), anything),
    ),
    _fault(
        "http-no-content-type-sometimes",
        "One answer in 50 has no Content-Type.",
        "content-type",
        altered(rest("GET", POSE, VELOCITY), header("Content-Type", None), nth=50),
    ),
    _fault("http-no-date", "Answers have no Date.", "date", altered(_ANY, header("Date", None), anything)),
)
