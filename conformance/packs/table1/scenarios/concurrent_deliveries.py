"""Valid and invalid deliveries at the same moment."""

from typing import Final

from conformance.api.rest.interface import RestInterface
from conformance.api.rest.validity import require_valid
from conformance.packs.table1.robot.delivery import path_of
from conformance.scenarios.scenario import scenario
from conformance.scenarios.stage import Leaves, Need, Stage
from conformance.transport.exchange import Exchange, Outgoing, Unanswered
from conformance.transport.parallel import MOST_CLIENTS, is_busy, send_together

_TURNS: Final = 12
_COORDINATES: Final = ("1.5", "2.5", "3.5", "4.5", "5.5", "6.5")
_NO_CODE: Final = "none"


@scenario(needs={Need.REST, Need.MOTION}, leaves=Leaves.UNTOUCHED, stage=Stage.ACTING)
def concurrent_deliveries(api: RestInterface) -> tuple[tuple[bool, Exchange], ...]:
    """Send valid and invalid deliveries at once; record whether each was valid, and its exchange.

    Empty where the robot rejects a valid delivery alone, or accepts an invalid one; and at quick, where no mutant was
    told apart by it that other requests at once did not tell apart as well.
    """
    if api.run.effort.name == "quick":
        return ()
    paths = [path_of(code, *_COORDINATES) for code in ("3", _NO_CODE)]
    require_valid(api.run.contract, "PUT", paths[0])
    # What is done with each alone is for others to judge.
    taken, refused = (api.client.send("PUT", path).response for path in paths)
    if not taken.ok or refused.ok:
        return ()
    turn = [(api.client, Outgoing("PUT", path)) for path in paths] * (MOST_CLIENTS // len(paths))
    return tuple(
        (request.target == paths[0], attempt)
        for came in send_together([turn] * api.run.effort.cases(_TURNS))
        for (_, request), attempt in zip(turn, came, strict=True)
        if not isinstance(attempt, Unanswered) and not is_busy(attempt)
    )
