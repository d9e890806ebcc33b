"""Targets: paths that nobody knows, trailing slashes, targets and fields that are too long."""

from urllib.parse import urljoin, urlsplit

import pytest

from conformance.api.rest import by_hand
from conformance.api.rest.applicable import reads
from conformance.api.rest.calls import JSON, example_call
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.statuses import judge_status
from conformance.documents.openapi import inside_prefix, known_path, resources_of
from conformance.transport import raw
from conformance.transport.client import HttpClient
from conformance.transport.exchange import Exchange, NoAnswer, NoAnswerError
from conformance.verdict.evidence import Judge

pytestmark = [pytest.mark.phase("reading"), pytest.mark.needs("rest")]
_METHODS = ("GET", "HEAD", "PUT", "POST", "DELETE", "OPTIONS", "PATCH")
_STRANGE = "roaas-nobody-has-this"
# At quick effort; at any other one, all.
_FEW_PATHS = 4
_LONG_TARGETS = (9_000, 70_000)
_TARGET_TAKEN = 8_000
_LONG_FIELD = 128 * 1024


def _unknown_paths(api: RestInterface) -> list[str]:
    """Paths that are near to those of the contract, and match none of them."""
    literal = [item.template for item in resources_of(api.run.contract) if "{" not in item.template]
    near = [f"/{_STRANGE}", f"/{_STRANGE}/"]
    near += [path.rstrip("/") + f"/{_STRANGE}/" for path in literal[:4]]
    near += ["/".join([*path.strip("/").split("/")[:-1], _STRANGE]) for path in literal[:2]]
    paths = [path if path.startswith("/") else f"/{path}" for path in near]
    return [path for path in dict.fromkeys(paths) if not known_path(api.run.contract, path)]


@pytest.mark.requirement(
    "http/not-found",
    "http/problem-type",
    "http/problem-type-server",
    "http/problem-status",
    "http/no-traceback",
    "rest-formats/problem-xml",
)
def test_unknown_paths(api: RestInterface, rest: HttpClient, judge: Judge) -> None:
    """An unknown path is 404 for every method, and its problem is judged by the observers."""
    paths = _unknown_paths(api)
    for path in api.run.effort.draw(paths, 10 * _FEW_PATHS, f"{api.run.seed}/unknown paths"):
        for method in api.run.effort.subsample(_METHODS, 3):
            exchange = rest.send(method, path)
            status = exchange.response.status
            # Outside the contract's paths it may be anybody who answers, and the robot stands behind.
            refused = 400 <= status < 500 and not inside_prefix(api.run.contract, path)
            judge_status(
                judge,
                "http/not-found",
                status == 404 or refused or _leads_nowhere(api, exchange),
                exchange,
                f"404 for {method} of an unknown path, or a redirect to another one",
                cause=f"{method} {status}",
            )
        rest.send("GET", path, headers=[("Accept", "application/xml")])


def _leads_nowhere(api: RestInterface, exchange: Exchange) -> bool:
    """Whether it is a redirect to a path below the base URL that is not there either, or to another place."""
    location = exchange.response.header("location")
    if exchange.response.status not in {301, 302, 303, 307, 308} or location is None:
        return False
    target = urljoin(exchange.request.url, location)
    path = urlsplit(target).path.removeprefix(api.client.prefix)
    return not target.startswith(api.client.base_url) or not known_path(api.run.contract, path)


@pytest.mark.requirement("http/trailing-slash")
def test_trailing_slash(api: RestInterface, rest: HttpClient, judge: Judge) -> None:
    """Without its trailing slash a path is unknown, or redirected to the right one."""
    ending = [item for item in resources_of(api.run.contract) if item.template.endswith("/") and len(item.template) > 1]
    tried = 0
    for resource in ending:
        operation = resource.operations.get("GET")
        if operation is None or operation.optional:
            continue
        path = example_call(api, operation).path.split("?", 1)[0]
        cut = path.rstrip("/")
        if known_path(api.run.contract, cut):
            continue
        tried += 1
        exchange = rest.send("GET", cut)
        status = exchange.response.status
        right = status == 404 or (status in {301, 307, 308} and _leads_to(exchange, rest.prefix + path))
        location = exchange.response.header("location")
        judge.check(
            "http/trailing-slash",
            right,
            exchange,
            f"404, or 301, 307 or 308 to {path}",
            found=f"status {status}" + (f" to {location}" if location else ""),
            cause=f"{status}",
        )
    if not tried:
        judge.unclaimed("http/trailing-slash", "the contract has no path with a trailing slash to cut")


def _leads_to(exchange: Exchange, path: str) -> bool:
    location = exchange.response.header("location")
    return location is not None and urlsplit(urljoin(exchange.request.url, location)).path == path


@pytest.mark.requirement("http/uri-too-long", "http/declared-body")
def test_long_targets(api: RestInterface, rest: HttpClient, judge: Judge) -> None:
    """A long target is taken or refused, as far as the robot likes, and the next request is answered."""
    judge.at_risk = ("http/uri-too-long",)
    for call in [call for call in reads(api) if not call.operation.optional]:
        usual = call.send(api).response.status
        mark = "&" if "?" in call.path else "?"
        for length in _LONG_TARGETS:
            path = f"{call.path}{mark}roaas={'a' * length}"
            exchange: Exchange | None = None
            for second in (False, True):
                try:
                    exchange = rest.send("GET", path, fresh=True)
                    break
                except NoAnswerError as none:
                    # Who refuses in the middle of a long head may lose the answer with the connection (RFC 9112 9.6).
                    if none.kind is not NoAnswer.CLOSED or (second and length == min(_LONG_TARGETS)):
                        raise
            if exchange is None:
                continue
            status = exchange.response.status
            judge.check(
                "http/uri-too-long",
                status in {414, 400, 431, usual},
                exchange,
                f"414, 400 or 431, or {usual} as without the long query",
                found=f"status {status} for a target of {len(path):,} octets",
            )
        again = call.send(api, fresh=True)
        judge.check(
            "http/uri-too-long", again.response.status == usual, again, f"the next request answered {usual}, as ever"
        )


@pytest.mark.requirement("http/header-too-large")
def test_large_field(api: RestInterface, judge: Judge) -> None:
    """A field of 128 KiB is refused, or the connection closed, or the field ignored; never 5xx."""
    judge.at_risk = ("http/header-too-large",)
    for call in [call for call in reads(api) if not call.operation.optional][:3]:
        usual = call.send(api).response.status
        try:
            exchange = call.send(api, ("X-Roaas", "a" * _LONG_FIELD), fresh=True)
        except NoAnswerError as none:
            if none.kind is not NoAnswer.CLOSED:
                raise
            judge.check(
                "http/header-too-large", True, none.unanswered, "431, 400, 413, a closed connection, or no matter"
            )
            continue
        status = exchange.response.status
        judge.check(
            "http/header-too-large",
            status in {431, 400, 413, usual},
            exchange,
            "431, 400, 413, a closed connection, or no matter",
            found=f"status {status} for a field of {_LONG_FIELD:,} octets",
        )


@pytest.mark.requirement("http/target-length")
def test_targets_of_8000_octets(api: RestInterface, rest: HttpClient, judge: Judge) -> None:
    """A target of 8,000 octets is taken by whoever takes the same with a short query: RECOMMENDED (RFC 9110 4.1)."""
    for call in [call for call in reads(api) if not call.operation.optional]:
        path = f"{call.path}{'&' if '?' in call.path else '?'}roaas="
        usual = rest.send("GET", f"{path}a").response.status
        exchange = rest.send("GET", path + "a" * (_TARGET_TAKEN - len(rest.prefix) - len(path)))
        judge_status(
            judge,
            "http/target-length",
            exchange.response.status == usual,
            exchange,
            f"{usual} for a target of {_TARGET_TAKEN:,} octets, as for a short one",
        )


@pytest.mark.requirement("http/absolute-form")
def test_absolute_form(api: RestInterface, rest: HttpClient, judge: Judge) -> None:
    """A target with scheme and authority is the one without them (RFC 9112 3.2.2)."""
    for call in reads(api):
        usual = call.send(api, ("Accept", JSON)).response.status
        head = raw.head(rest, "GET", call.path, f"Accept: {JSON}", "Connection: close")
        absolute = head.replace(b" ", f" {rest.scheme}://{rest.authority}".encode(), 1)
        attempt, _ = raw.read_one(rest, absolute, by_hand.talk(api, absolute, answers=1), "GET")
        judge.check(
            "http/absolute-form",
            isinstance(attempt, Exchange) and attempt.response.status == usual,
            attempt,
            f"{usual}, as for {call.path}",
            cause=f"{attempt.came}",
        )
