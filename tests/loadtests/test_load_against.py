"""Two robots in one duel: which of them is slower, or whether that can be told at all."""

import pytest

from conformance.commandline.exit_codes import ExitCode

FAST = "--rate 150 --duration 3.2 --warmup 0.2 --client wire"
#: A slow robot's, in seconds. In three seconds an interface gets six pairs of blocks: on a machine where processes wait
#: for 0.2 s at a time, and some blocks of the quick robot with them, 0.03 s could rightly not be told from that.
DELAY_S = 0.25


def against(other, folder):
    """Options that name the other robot's interfaces, by a statement."""
    words, statement = other.both(), folder / "other.toml"
    keys = [word.strip("-").replace("-", "_") for word in words[::2]]
    lines = [f'{key} = "{value}"' for key, value in zip(keys, words[1::2], strict=True)]
    statement.write_text("\n".join(["[endpoints]", *lines]))
    return ["--against", str(statement)]


def change(result, interface, quantile="p50"):
    return next(
        entry
        for entry in result["against"]["changes"]
        if (entry["interface"], entry["quantile"]) == (interface, quantile)
    )


def test_a_robot_that_is_slower_than_another_is_told_from_it(toy, load, tmp_path):
    quick, slow = toy(), toy("--delay", DELAY_S)
    for _ in range(8):
        run = load(*slow.both(), *against(quick, tmp_path), FAST, "--tolerance 50%")
        result = run.result
        verdicts = {change(result, interface)["verdict"] for interface in ("rest", "soap")}
        if "unclear" not in verdicts | {result["against"]["verdict"]}:
            break  # a machine that stands still for seconds leaves some runs in the dark, and not all
    assert run.code == (ExitCode.FAILED if result["valid"] else ExitCode.INCONCLUSIVE), run.out + run.err
    assert result["against"]["verdict"] == "slower"
    for interface in ("rest", "soap"):
        found = change(result, interface)
        assert found["difference_ms"] > 500 * DELAY_S
        assert found["ci95"][0] > 1.5
        assert found["verdict"] == "slower"
    assert result["comparisons"] == [], "no interface met another one: robots did"
    assert "slower" in run.out
    assert all(entry["count"] for entry in (*result["series"], *result["against"]["series"]))


def test_what_cannot_be_told_is_not_said(toy, load, tmp_path):
    robot = toy()
    other = against(robot, tmp_path)
    run = load(*robot.both(), *other, "--rate 60 --duration 0.6 --warmup 0.1 --client wire --tolerance 0.001%")
    assert (run.code, run.result["against"]["verdict"]) == (ExitCode.INCONCLUSIVE, "unclear")


def test_a_quicker_robot_is_cleared_by_workers_that_share_the_load_on_both(toy, load, tmp_path):
    other = tmp_path / "other.toml"
    other.write_text(f'[endpoints]\nrest = "{toy("--delay", DELAY_S).url}"\n')
    run = load("--rest", toy().url, "--against", other, FAST, "--processes 2 --tolerance 50%")
    assert run.code == (ExitCode.PASSED if run.result["valid"] else ExitCode.INCONCLUSIVE), run.out + run.err
    assert run.result["against"]["verdict"] == "not slower"
    assert [entry["interface"] for entry in run.result["against"]["series"]] == ["rest"]
    assert change(run.result, "rest")["ci95"][1] < 1
    assert run.result["counts"]["asked"] == run.result["counts"]["sent"]


def test_the_other_robot_has_to_be_there_as_well(toy, load, free_port):
    run = load("--rest", toy().url, f"--against http://127.0.0.1:{free_port}", FAST)
    assert (run.code, "the robot of --against cannot be reached" in run.err) == (ExitCode.UNREACHABLE, True), run.err


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ("--against http://b:2 --interface soap --publishers-wsdl a.wsdl", "without soap"),
        ("--against b:2", "b:2"),
        ("--against http://b:2 --tolerance much", "'much' is not a percentage"),
        ("--against http://b:2 --tolerance 0", "--tolerance 0.000% is out of range"),
        ("--against http://b:2 --knee", "one after the other"),
        ("--against slow.toml --rate 90", "--rate 90 exceeds 80 requests/s (the statement's [endpoints] request_rate"),
        ("--against slow.toml --rate 9 --duration 6 --repeat 2", "--duration 6 2 times exceeds 10 s"),
    ],
)
def test_comparisons_that_cannot_be(usage_error, options, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "slow.toml").write_text(
        '[endpoints]\nrest = "http://b:2"\nrequest_rate = 80\n[load]\nmax_duration_s = 10\n'
    )
    assert message in usage_error("--rest http://a:1", options)
