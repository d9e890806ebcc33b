"""Several deliveries at the same moment: each response must belong to its request."""

import pytest

from conformance.api.rest.interface import RestInterface
from conformance.api.rest.validity import require_valid
from conformance.packs.table1.robot.delivery import path_of
from conformance.transport.exchange import Unanswered
from conformance.transport.parallel import MOST_CLIENTS, Outgoing, is_busy, send_together
from conformance.verdict.evidence import Judge

pytestmark = pytest.mark.needs("rest")
_TURNS = 12
_COORDINATES = ("1.5", "2.5", "3.5", "4.5", "5.5", "6.5")
_NO_CODE = "none"


@pytest.mark.phase("acting")
@pytest.mark.motion
@pytest.mark.requirement("http/concurrent-answers")
def test_answers_to_deliveries_do_not_cross(api: RestInterface, judge: Judge) -> None:
    """Send valid and invalid deliveries at once: the robot must accept the valid ones and reject the others."""
    paths = [path_of(code, *_COORDINATES) for code in ("3", _NO_CODE)]
    require_valid(api.run.contract, "PUT", paths[0])
    # What is done with each alone is for others to judge.
    taken, refused = (api.client.send("PUT", path).response for path in paths)
    if not taken.ok or refused.ok:
        return
    turn = [Outgoing(api.client, "PUT", path) for path in paths] * (MOST_CLIENTS // len(paths))
    for came in send_together([turn] * api.run.effort.cases(_TURNS)):
        for request, attempt in zip(turn, came, strict=True):
            if isinstance(attempt, Unanswered) or is_busy(attempt):
                continue
            wanted = request.path == paths[0]
            judge.check(
                "http/concurrent-answers",
                attempt.response.ok == wanted,
                attempt,
                f"{'2xx' if wanted else '4xx'} for this delivery, while others are answered",
                cause="another's answer",
            )
