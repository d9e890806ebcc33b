"""The odometry's stamp must be right in every format."""

import pytest

from conformance.api.rest.applicable import reads
from conformance.api.rest.calls import JSON
from conformance.api.rest.interface import RestInterface
from conformance.documents.representation import UnreadableError, read
from conformance.packs.table1.robot.message_shapes import ODOMETRY
from conformance.packs.table1.robot.robot import POSE
from conformance.transport.exchange import Exchange
from conformance.verdict.evidence import Judge

pytestmark = [pytest.mark.phase("resting"), pytest.mark.needs("rest")]
_FORMATS = ("application/xml", "text/plain")
_TURNS = 3


@pytest.mark.requirement("rest-formats/same-values")
def test_stamps_lie_between(api: RestInterface, judge: Judge) -> None:
    """Read JSON, another format, and JSON again: the stamp in the middle must lie between the other two."""
    pose = next((call for call in reads(api) if call.operation.template == POSE), None)
    for media_type in _FORMATS if pose is not None else ():
        if pose is None or media_type not in pose.operation.formats:
            continue
        found = ""
        # A single time, a clock may be set or a response late.
        for _ in range(_TURNS):
            exchanges = [pose.send(api, ("Accept", name)) for name in (JSON, media_type, JSON)]
            first, other, last = map(_stamp, exchanges)
            if first is None or other is None or last is None or first <= other <= last or last < first:
                found = ""
                break
            found = f"the stamp {_seconds(other)}, between JSON's {_seconds(first)} and {_seconds(last)}"
        judge.check(
            "rest-formats/same-values",
            not found,
            exchanges[1],
            f"a stamp in {media_type} that lies between the stamps of the JSON responses before and after it",
            found=found,
            cause="stamp",
        )


def _seconds(stamp: tuple[float, float]) -> str:
    """Return seconds and nanoseconds as a number of seconds."""
    return f"{stamp[0]:.0f}.{stamp[1]:09.0f} s"


def _stamp(exchange: Exchange) -> tuple[float, float] | None:
    """Return seconds and nanoseconds of an odometry in any format; None where it cannot be read."""
    answer = exchange.response
    if not answer.ok:
        return None
    try:
        stamp = read(answer.media_type, answer.body, ODOMETRY.schema)["header"]["stamp"]
        return float(stamp["sec"]), float(stamp["nanosec"])
    except (UnreadableError, TypeError, KeyError, ValueError):
        return None
