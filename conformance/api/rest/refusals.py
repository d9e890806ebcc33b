"""Refusals of invalid requests: by 4xx, by the fitting one, and with a detail that helps."""

from collections.abc import Callable

from conformance.api.expectation import expect
from conformance.api.rest import problem
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.statuses import is_cut_off, is_refusal
from conformance.documents.openapi import operations_of
from conformance.transport.exchange import Exchange, NoAnswer, NoAnswerError

_MALFORMED, _INVALID = 400, 422


def judge_refusal(
    api: RestInterface,
    send: Callable[[], Exchange],
    requirement: str,
    what: str,
    *,
    field: str = "",
    shown: str = "",
    malformed: bool | None = None,
    json: bool = True,
) -> bool:
    """Send one invalid request, judge the response, and return whether the request was refused.

    Args:
        api: the robot's REST interface.
        send: sends it.
        requirement: id of what asks for its refusal.
        what: what is wrong with it.
        field: name of the wrong field, where a problem can name it.
        shown: text of the wrong value, where a problem can name it.
        malformed: whether 400 (no JSON) or 422 (JSON of a wrong shape or value) fits better; None means either.
        json: whether its body is JSON (or meant to be).

    Raises:
        NoAnswerError: no response came, for a reason that other requirements judge.
    """
    judge = api.run.judge
    expected, kind = f"status 4xx for {what}", what.split(" at ", 1)[0]
    try:
        exchange = send()
    except NoAnswerError as none:
        refused = is_cut_off(none.unanswered)
        if not refused and (none.kind not in {NoAnswer.CLOSED, NoAnswer.MALFORMED} or not api.alive()):
            raise
        return expect(judge, requirement, none.unanswered).that(refused, expected, cause=f"{kind} {none.kind}")
    if is_cut_off(exchange):
        return expect(judge, requirement, exchange).that(holds=True, expected=expected)
    status = exchange.response.status
    if not expect(judge, requirement, exchange).that(is_refusal(exchange), expected, cause=f"{kind} {status}"):
        return False
    if json and malformed is not None:
        fitting, name = (_MALFORMED, "malformed") if malformed else (_INVALID, "invalid")
        expect(judge, f"strict-input/status-{name}", exchange).status(fitting, when=f"the request has {what}")
    if status in {_MALFORMED, _INVALID}:
        _judge_detail(api, exchange, what, field, shown)
    return True


def _judge_detail(api: RestInterface, exchange: Exchange, what: str, field: str, shown: str) -> None:
    detail = problem.detail_of(exchange.response)
    parameters = (item for operation in operations_of(api.run.contract) for item in operation.parameters)
    called = {field, *(name for item in parameters if item.name == field for name in item.also)}
    for requirement, wanted, named in (
        ("http/problem-detail", f"the field {field!r}", problem.names(detail, *called) if field else True),
        ("http/problem-value", f"the value {shown!r}", shown in detail),
    ):
        if field if requirement.endswith("detail") else shown:
            expect(api.run.judge, requirement, exchange).that(
                named,
                f"a problem whose detail names {wanted}, for {what}",
                f"the detail {detail[:200]!r}" if detail else "a problem without detail",
                cause="unnamed" if detail else "no detail",
            )
