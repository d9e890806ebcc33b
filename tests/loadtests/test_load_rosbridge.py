"""The third way: rosbridge beside REST and SOAP, by its published protocol over a real WebSocket."""

import pytest

from conformance.commandline.exit_codes import ExitCode

RUN = "--rate 100 --duration 3 --warmup 0.4"


@pytest.fixture
def bridge(started):
    """Start a toy rosbridge with options; gives its URL."""
    return lambda *options: f"ws://127.0.0.1:{started('toy_rosbridge.py', *options)[1]}"


def test_rosbridge_is_a_third_line_of_the_duel(toy, bridge, load):
    run = load(*toy().both(), "--rosbridge", bridge("--delay", "0.03"), RUN, "--allow-motion")
    result = run.result
    assert run.code == (ExitCode.PASSED if result["valid"] else ExitCode.INCONCLUSIVE), run.out + run.err
    names = {(entry["operation"], entry["interface"], entry["client"]) for entry in result["series"]}
    both = {(o, i, c) for o in ("delivery", "pose") for i in ("rest", "soap") for c in ("wire", "zeep")}
    assert names == both | {("delivery", "rosbridge", "wire"), ("pose", "rosbridge", "wire")}
    delivery, pose = run.series("delivery", "rosbridge"), run.series("pose", "rosbridge")
    assert delivery["count"] > 15
    assert delivery["errors"] == pose["errors"] == 0
    assert delivery["service_ms"]["p50"] >= 30, "an echo takes the bridge 30 ms"
    assert 3 <= pose["service_ms"]["p50"] <= 100, "there is odometry every 50 ms"
    ratio = next(
        entry
        for entry in result["further_interfaces"]
        if (entry["operation"], entry["quantile"]) == ("delivery", "p50")
    )
    assert ratio["ratio"] > 1
    assert ratio["minus_rest_ms"] > 1
    assert len(result["comparisons"]) == 16, "SOAP and REST are compared as without it"
    assert "rosbridge takes" in run.out
    assert any("its echo is back" in note for note in result["notes"])


@pytest.mark.parametrize(
    ("options", "operation", "told"),
    [
        (["--refuse", "no such type"], "delivery", "rosbridge: no such type"),
        (["--deaf"], "pose", "no echo or message within 1 s"),
    ],
)
def test_a_bridge_that_does_not_answer_gives_no_valid_run(bridge, load, options, operation, told):
    run = load(
        "--rosbridge",
        bridge(*options),
        f"--interface rosbridge --operation {operation} --allow-motion --timeout 1",
        RUN,
    )
    assert (run.code, told in run.err) == (ExitCode.INCONCLUSIVE, True), run.err


def test_who_speaks_no_websocket_is_told_from_who_is_not_there(toy, load, free_port):
    port = toy().port
    for there, code, told in (
        (port, ExitCode.INCONCLUSIVE, "does not speak WebSocket"),
        (free_port, ExitCode.UNREACHABLE, "connection refused"),
    ):
        run = load(f"--rosbridge ws://127.0.0.1:{there} --interface rosbridge", RUN)
        assert (run.code, told in run.err) == (code, True), run.err
