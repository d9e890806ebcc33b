"""Checks that the lamp reports and reaches the brightness that a client sets."""

import json
from collections.abc import Iterator

import pytest

from conformance.api.rest.interface import RestInterface
from conformance.observe.clock import WALL_CLOCK, poll_for
from conformance.scenarios.rule import Case, Outcome, rule
from conformance.scenarios.scenario import scenario
from conformance.scenarios.stage import Need
from conformance.transport.exchange import Exchange
from conformance.verdict.evidence import Judge

JSON = (("Content-Type", "application/json"),)
FADES_S = 0.5
TARGET = 0.8123456789  # with so many digits that none may be lost
Trace = list[tuple[float, float, Exchange]]


def shown(exchange: Exchange) -> dict[str, float]:
    """Return brightness and target from a response, or an empty dict if they are missing or not numbers."""
    try:
        state = json.loads(exchange.response.body)
        return {name: float(state[name]) for name in ("brightness", "target")}
    except (ValueError, TypeError, KeyError):
        return {}


def put(api: RestInterface, brightness: float) -> Exchange:
    """Send ``PUT /lamp`` with a brightness."""
    return api.client.send("PUT", "/lamp", headers=JSON, body=json.dumps({"brightness": brightness}).encode())


@pytest.mark.requirement("lamp/state")
def test_state(api: RestInterface, judge: Judge) -> None:
    """Check that ``GET /lamp`` returns 200 with a brightness and a target from 0 to 1."""
    exchange = api.client.send("GET", "/lamp")
    state = shown(exchange)
    holds = exchange.response.status == 200 and bool(state) and all(0 <= one <= 1 for one in state.values())
    judge.check("lamp/state", holds, exchange, "200 with a brightness and a target from 0 to 1")


@pytest.mark.motion
@pytest.mark.requirement("lamp/out-of-range")
def test_out_of_range(api: RestInterface, judge: Judge) -> None:
    """Check that a brightness outside 0 to 1 is answered 422 and leaves the target unchanged."""
    for before, wrong in ((0.25, 1.01), (0.5, -0.01), (0.75, 1e308)):
        put(api, before)
        refusal, after = put(api, wrong), shown(api.client.send("GET", "/lamp"))
        kept = after.get("target") == before
        holds = refusal.response.status == 422 and kept
        judge.check("lamp/out-of-range", holds, refusal, f"422 for {wrong}, and the target {before} afterwards")


@scenario(needs={Need.REST, Need.MOTION})
def fading(api: RestInterface) -> Trace:
    """Set the lamp from 0 to the target and read its state every 20 ms while it fades."""
    put(api, 0.0)
    WALL_CLOCK.sleep(FADES_S)
    begun = WALL_CLOCK.now()
    taken = put(api, TARGET)  # its response is the first reading
    trace = [(WALL_CLOCK.now() - begun, shown(taken).get("brightness", -1.0), taken)]
    for _ in poll_for(WALL_CLOCK, 0.02, FADES_S):
        exchange = api.client.send("GET", "/lamp")
        trace.append((WALL_CLOCK.now() - begun, shown(exchange).get("brightness", -1.0), exchange))
    return trace


@rule("lamp/target", on=(fading,))
def target(trace: Trace) -> Iterator[Outcome]:
    """Judge whether the response to the PUT and every reading during the fade report the requested target."""
    for _, _, exchange in trace:
        yield Case(shown(exchange).get("target") == TARGET, exchange, f"the target {TARGET} that was sent")


@rule("lamp/fades", on=(fading,))
def fades(trace: Trace) -> Iterator[Outcome]:
    """Judge whether the lamp has reached the requested brightness in the last reading."""
    at, brightness, exchange = trace[-1]
    yield Case(
        abs(brightness - TARGET) < 0.01, exchange, f"{TARGET} after {FADES_S} s", f"{brightness:.2f} after {at:.2f} s"
    )


@rule("lamp/in-between", on=(fading,))
def in_between(trace: Trace) -> Iterator[Outcome]:
    """Judge whether every brightness during the fade lies between the old and the new target."""
    for at, brightness, exchange in trace:
        yield Case(
            0 <= brightness <= TARGET,
            exchange,
            f"a brightness from 0 to {TARGET}",
            f"{brightness:.2f} after {at:.2f} s",
        )
