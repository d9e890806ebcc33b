"""A stop that a device refuses matters if the run has moved the device since it was last stopped, and only then."""

import time
from contextlib import suppress
from dataclasses import dataclass

import msgspec
import pytest
from aiohttp import web
from small_device import REFUSED, answers, described, error, reading, small_device

from conformance.api.rest.stops import UNDELIVERED
from conformance.contract.described import MOTION
from conformance.engine.robot_under_test import RobotUnderTest
from conformance.statement.endpoints import Endpoints
from conformance.statement.statement import Calls, empty_statement
from conformance.target.describing import described_contract
from conformance.transport.client import Connection
from conformance.transport.exchange import NoAnswerError
from conformance.verdict.run import Run
from conformance.verdict.verdicts import ClassValue, Overall, overall, verdict_line

_RESPONSES = {"200": answers({"type": "object"}), "4XX": REFUSED, "5XX": REFUSED}
_DESCRIPTION = described(
    {
        "/state": reading({"type": "object"}),
        "/go": {"post": {"responses": _RESPONSES}},
        "/stop": {"post": {"responses": _RESPONSES, "x-roaas-stop": True}},
    }
)


@dataclass(frozen=True)
class Belt:
    """A conveyor belt without a motion map.

    Attributes:
        name: of the case.
        resting, moving: status of its stop while it rests, and while it moves.
        go: status of the request that moves it.
        sent: what the run sends.
        moves: whether it moves although it refuses that.
        may_move: whether the belt may still move at the end.
    """

    name: str
    resting: int
    moving: int = 200
    go: int = 200
    sent: tuple[str, ...] = ("POST /go",)
    moves: bool = False
    may_move: bool = False


BELTS = (
    Belt("nothing moves it", 409, sent=()),
    Belt("it is only read", 409, sent=("GET /state",)),
    Belt("nothing moves it, and it knows no stop then", 404, sent=()),
    Belt("nothing moves it, and its stop is out of order", 503, sent=()),
    Belt("it refuses to move", 409, go=409),
    Belt("it is locked", 403, go=423),
    Belt("it says no and moves", 409, moving=409, go=409, moves=True, may_move=True),
    Belt("it says no and moves until it is stopped", 409, go=422, moves=True),
    Belt("the run stops it", 409, sent=("POST /go", "POST /stop")),
    Belt("it moves", 409),
    Belt("it moves again after a stop", 409, sent=("POST /go", "POST /stop", "POST /go")),
    Belt("it moves on after a stop", 409, moving=409, sent=("POST /go", "POST /stop"), may_move=True),
    Belt("it is never stopped", 409, moving=409, may_move=True),
    Belt("its stop is never there", 404, moving=404, may_move=True),
    Belt("it moves and says 500", 409, moving=409, go=500, may_move=True),
    Belt("something unknown is sent to it", 409, sent=("PUT /other",)),
)


@pytest.mark.parametrize("belt", BELTS, ids=lambda belt: belt.name)
def test_a_refused_stop_is_told_if_the_run_has_moved_the_device(belt, tmp_path):
    moves = False

    async def state(_):
        return web.json_response({"belt": {"position": time.monotonic() if moves else 0.0, "uptime": time.monotonic()}})

    async def go(_):
        nonlocal moves
        moves |= belt.moves or not 400 <= belt.go < 500
        return error(belt.go, "no") if belt.go >= 400 else web.json_response({})

    async def stop(_):
        nonlocal moves
        status = belt.moving if moves else belt.resting
        moves &= status >= 400
        return error(status, "no") if status >= 400 else web.json_response({})

    connection = Connection()
    with small_device(_DESCRIPTION, {"/state": {"GET": state}, "/go": {"POST": go}, "/stop": {"POST": stop}}) as url:
        contract, where, _ = described_contract(
            f"{url}/openapi.json", (), None, Endpoints(), connection, tmp_path, mapped={MOTION}
        )
        statement = msgspec.structs.replace(empty_statement(contract), endpoints=where, calls=Calls(("*",)))
        run = Run(statement, contract, allow_motion=True, stop_s=0.5)
        robot = RobotUnderTest(run, connection)
        robot.connect()
        for request in belt.sent:
            with suppress(NoAnswerError):
                robot.rest.client.send(*request.split())
        for _ in range(2):  # the run stops it after the checks, and again after it has sent findings once more
            robot.is_at_rest = False
            robot.leave_at_rest()
    assert moves == belt.may_move
    assert run.stop_undelivered.startswith(f"{UNDELIVERED}: POST /stop got status" if moves else "")
    assert bool(run.stop_undelivered) == moves
    value = overall({"http": (ClassValue.PASS, "")}, enough=run.is_decided)
    assert value is (Overall.INCONCLUSIVE if moves else Overall.CONFORMANT)
    assert (UNDELIVERED in verdict_line(run, value, ())) == moves
