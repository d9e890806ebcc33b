"""What a client will not have is not sent (RFC 9110 12.4.2, 12.5.1, 15.5.7)."""

import pytest

from conformance.api.rest.accept import quality
from conformance.api.rest.applicable import answered
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.statuses import judge_status
from conformance.verdict.evidence import Judge

pytestmark = [pytest.mark.phase("reading"), pytest.mark.needs("rest")]
# Nothing that a robot could have beside the formats of the contract.
_NOTHING = ("image/png", "application/vnd.roaas-nobody-has-this", "audio/*;q=0.5, video/*")


@pytest.mark.requirement("http/not-acceptable")
def test_no_acceptable_format(api: RestInterface, judge: Judge) -> None:
    """Where nothing that the robot has is acceptable, it says so."""
    cases = [(call, accept) for call in answered(api) for accept in _NOTHING]
    for call, accept in api.run.effort.draw(cases, 120, f"{api.run.seed}/not acceptable"):
        exchange = call.send(api, ("Accept", accept))
        status = exchange.response.status
        judge_status(judge, "http/not-acceptable", status == 406, exchange, f"406 for Accept: {accept}")


@pytest.mark.requirement("http/q-zero")
def test_quality_zero(api: RestInterface, judge: Judge) -> None:
    """A format with q=0 is not sent, whatever else is: another one, or 406."""
    for call in api.run.effort.subsample(answered(api), 2):
        first = call.operation.formats[0] if call.operation.formats else "application/json"
        others = [name for name in call.operation.formats if name != first]
        refused = [f"{first};q=0", f"{first};q=0.000, */*", f"{first} ; q=0"]
        refused += [f"{name};q=0, {first};q=0, */*;q=0.5" for name in others[:1]]
        refused += [*(f"{name};q=0" for name in others), "*/*;q=0"]
        for accept in api.run.effort.draw(refused, 20, f"{api.run.seed}/{call.operation.id}"):
            exchange = call.send(api, ("Accept", accept))
            answer = exchange.response
            sent = answer.media_type if answer.ok else ""
            judge.check(
                "http/q-zero",
                not sent or quality(sent, accept) > 0,
                exchange,
                f"no format with q=0 in Accept: {accept}",
                found=f"{sent} is sent",
                cause=sent,
            )


@pytest.mark.requirement("http/accept-parameters")
def test_charset_in_accept(api: RestInterface, judge: Judge) -> None:
    """Many clients write the charset that they can read into Accept."""
    cases = [(call, media_type) for call in answered(api) for media_type in call.operation.formats]
    for call, media_type in api.run.effort.draw(cases, 20, f"{api.run.seed}/accept charset"):
        if call.send(api, ("Accept", media_type)).response.media_type != media_type:
            continue
        exchange = call.send(api, ("Accept", f"{media_type}; charset=utf-8"))
        judge.check(
            "http/accept-parameters",
            exchange.response.ok and exchange.response.media_type == media_type,
            exchange,
            f"{media_type} for Accept: {media_type}; charset=utf-8",
        )
