"""Whether what breaks the contract is refused: with 4xx, with the fitting one, and with a detail that helps."""

from collections.abc import Callable

from conformance.api.rest import problem
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.statuses import is_cut_off, is_refusal, judge_status
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
    closing: bool = False,
    json: bool = True,
) -> bool:
    """Send one invalid request, and judge what comes.

    Args:
        api: the robot's REST interface.
        send: sends it.
        requirement: id of what asks for its refusal.
        what: what is wrong with it.
        field: name of the wrong field, where a problem can name it.
        shown: text of the wrong value, where a problem can name it.
        malformed: whether 400 (no JSON) or 422 (JSON of a wrong shape or value) fits better; None: either.
        closing: whether closing the connection refuses it as well.
        json: whether its body is JSON (or meant to be).

    Returns:
        Whether it was refused.

    Raises:
        NoAnswerError: there was no answer where there had to be one.
    """
    judge = api.run.judge
    try:
        exchange = send()
    except NoAnswerError as none:
        if (closing and none.kind is NoAnswer.CLOSED) or is_cut_off(none.unanswered):
            return judge.check(
                requirement, holds=True, exchange=none.unanswered, expected="4xx, or a closed connection"
            )
        if none.kind not in {NoAnswer.CLOSED, NoAnswer.MALFORMED} or not api.alive():
            raise
        return judge.check(
            requirement,
            holds=False,
            exchange=none.unanswered,
            expected=f"4xx for {what}",
            found=str(none),
            cause=f"{what.split(' at ', 1)[0]} {none.kind}",
        )
    if is_cut_off(exchange):
        return judge.check(requirement, holds=True, exchange=exchange, expected="4xx, or a closed connection")
    status = exchange.response.status
    cause = f"{what.split(' at ', 1)[0]} {status}"
    if not judge_status(judge, requirement, is_refusal(exchange), exchange, f"4xx for {what}", cause=cause):
        return False
    if json and malformed is not None:
        fitting, name = (_MALFORMED, "malformed") if malformed else (_INVALID, "invalid")
        judge_status(judge, f"strict-input/status-{name}", status == fitting, exchange, f"{fitting} for {what}")
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
            api.run.judge.check(
                requirement,
                named,
                exchange,
                f"a detail that names {wanted}, for {what}",
                found=f"detail {detail[:200]!r}" if detail else "no detail",
                cause=("unnamed" if detail else "no detail"),
            )
