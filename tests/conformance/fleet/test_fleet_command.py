"""``roaas certify --fleet``: each robot comes to its own end, and none waits for another's."""

import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from click.testing import CliRunner
from processes import ended

import roaas
from conformance.fleet.fleet_file import Member
from conformance.fleet.member_run import MemberResult, Outcome
from conformance.fleet.result import exit_code
from reports.attestation.envelope import ENVELOPE_NAME, open_envelope, statement_in
from reports.attestation.keys import PRIVATE_NAME, generate
from reports.reading import read_fleet


def fleet_file(folder: Path, robots: dict[str, str], **more: str) -> Path:
    tables = [
        f'[[robot]]\nname = "{name}"\nendpoints = {{ rest = "{rest}" }}\n{more.get(name, "")}'
        for name, rest in robots.items()
    ]
    path = folder / "fleet.toml"
    path.write_text("\n".join(tables))
    return path


def command(fleet: Path, *options: str) -> list[str]:
    words = [sys.executable, "-m", "roaas", "certify", "--fleet", str(fleet)]
    return [*words, "--out", str(fleet.parent / "out"), *options]


def test_each_robot_has_its_end_whatever_the_others_do(tmp_path, web_server, closed_port, listening):
    hanging = listening(lambda connection: time.sleep(300) or connection)
    generate(tmp_path / "keys")
    fleet = fleet_file(
        tmp_path, {"hangs": hanging, "down": closed_port, "poor": web_server, "unusable": f"{web_server}/x"},
        hangs="time_limit_s = 4", unusable='baseline = "missing.toml"',
    )  # fmt: skip
    old = tmp_path / "out" / "robots" / "hangs" / "result.json"
    old.parent.mkdir(parents=True)
    old.write_text('{"verdict": "conformant"}')
    options = ["--parallel", "3", "--class", "rest-resources", "--effort", "quick", "--timeout", "30"]
    options += ["--sign", str(tmp_path / "keys" / PRIVATE_NAME)]
    done = ended(*command(fleet, *options))
    assert done.returncode == 1, done.stderr
    found = {robot["name"]: robot for robot in read_fleet(tmp_path / "out" / "fleet.json")["robots"]}
    assert {name: robot["outcome"] for name, robot in found.items()} == {
        "hangs": "given-up", "down": "unreachable", "poor": "not-conformant", "unusable": "not-judged",
    }  # fmt: skip
    assert "4 s, its time limit" in found["hangs"]["reason"]
    assert "could not be reached" in found["down"]["reason"]
    assert "missing.toml" in found["unusable"]["reason"]
    assert [robot["trusted"] for robot in found.values()] == [[]] * 4
    assert found["hangs"].get("classes", {}).get("rest-resources") != "pass", "an earlier run's result does not count"
    assert (found["poor"]["classes"]["rest-resources"], found["poor"]["robot"]) == ("fail", {"name": "poor"})
    for name, end in (("hangs", "given-up"), ("down", "unreachable"), ("poor", "not-conformant")):
        assert f"{name}: started" in done.stderr
        assert f"judged | {name}: {end}" in done.stderr
        assert f"  {name} " in done.stdout
    assert "4/4 judged" in done.stderr
    assert 'href="robots/poor/certificate.html"' in (tmp_path / "out" / "fleet.html").read_text()
    assert (tmp_path / "out" / "robots" / "poor" / "certificate.html").exists()
    signed = statement_in(open_envelope((tmp_path / "out" / "robots" / "poor" / ENVELOPE_NAME).read_bytes()))
    assert signed.predicate.roaas.robot.name == "poor"


def test_a_program_reads_the_result_on_stdout_and_nobody_the_progress(tmp_path, closed_port):
    fleet = fleet_file(tmp_path, {"down": closed_port})
    done = ended(*command(fleet, "--class", "rest-resources", "--json", "--quiet"))
    assert (done.returncode, done.stderr) == (3, "")
    assert done.stdout == (tmp_path / "out" / "fleet.json").read_text(encoding="utf-8")


@pytest.mark.parametrize("other", ["--plan", "--init"])
def test_what_has_no_result_cannot_be_printed_as_json(other):
    done = CliRunner().invoke(roaas.main, ["certify", "robot.toml", "--json", other])
    assert (done.exit_code, done.stdout) == (2, "")
    assert "--json prints the result of a run" in done.stderr


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_fleet_ends_its_runs_and_keeps_what_it_has(tmp_path, listening, number):
    urls = {name: listening(lambda connection: time.sleep(300) or connection) for name in ("first", "second")}
    process = subprocess.Popen(
        command(fleet_file(tmp_path, urls), "--parallel", "1"), stderr=subprocess.PIPE, text=True
    )
    assert "first: started" in process.stderr.readline()
    listed = Path(f"/proc/{process.pid}/task/{process.pid}/children")
    until = time.monotonic() + 60
    while not (children := listed.read_text().split()):
        assert time.monotonic() < until
    process.send_signal(number)
    assert process.wait(60) == 130
    assert not any(Path(f"/proc/{child}").exists() for child in children)
    document = read_fleet(tmp_path / "out" / "fleet.json")
    assert document["interrupted"]
    assert [robot["outcome"] for robot in document["robots"]] == ["interrupted", "not-started"]
    assert "interrupted" in (tmp_path / "out" / "fleet.html").read_text()
    process.stderr.close()


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (["--parallel", "2", "--rest", "http://127.0.0.1:1"], "--parallel"),
        (["--fleet", "FLEET", "--rest", "http://127.0.0.1:1"], "--rest belongs to one robot"),
        (["--fleet", "FLEET", "--token-file", "FLEET"], "--token-file belongs to one robot"),
        (["--fleet", "FLEET", "--init"], "--init belongs to one robot"),
        (["--fleet", "FLEET", "robot.toml"], "STATEMENT"),
        (["--fleet", "EMPTY"], "names no robot"),
        (["--fleet", "FLEET", "--nonce", " "], "--nonce"),
        (["--fleet", "FLEET", "--sign", "FLEET"], "not a private key"),
        (["--fleet", "missing.toml"], "missing.toml"),
    ],
)
def test_wrong_usage_is_told_by_name(tmp_path, arguments, named):
    fleet = fleet_file(tmp_path, {"a": "http://127.0.0.1:1"})
    (tmp_path / "empty.toml").write_text("")
    given = {"FLEET": str(fleet), "EMPTY": str(tmp_path / "empty.toml")}
    words = ["certify", *(given.get(word, word) for word in arguments), "--out", str(tmp_path / "out")]
    done = CliRunner().invoke(roaas.main, words)
    assert (done.exit_code, (tmp_path / "out").exists()) == (2, False)
    assert named in done.stderr


def result(outcome: Outcome, code: int | None = 0, **document: object) -> MemberResult:
    return MemberResult(Member("x", None, None, ("x", ""), None, True, None), outcome, code, document=document or None)


@pytest.mark.parametrize(
    ("results", "code"),
    [
        ([result(Outcome.CONFORMANT)], 0),
        ([result(Outcome.CONFORMANT), result(Outcome.NOT_CONFORMANT, 0)], 0),  # a baseline accepts what fails
        ([result(Outcome.INCONCLUSIVE, 4), result(Outcome.UNREACHABLE, 3)], 3),
        ([result(Outcome.UNREACHABLE, 3), result(Outcome.NOT_JUDGED, 2)], 2),
        ([result(Outcome.NOT_JUDGED, -9), result(Outcome.NOT_CONFORMANT, 1)], 1),
        ([result(Outcome.GIVEN_UP, 130), result(Outcome.CONFORMANT)], 4),
        ([result(Outcome.INTERRUPTED, 130), result(Outcome.CONFORMANT)], 130),
    ],
)
def test_the_lowest_code_that_is_not_0_is_the_fleets(results, code):
    assert exit_code(results, interrupted=False) == code
    assert exit_code(results, interrupted=True) == 130


def test_who_may_be_trusted_follows_from_a_whole_run_with_nothing_accepted():
    classes = {"http": "pass", "safety": "pass", "describe": "fail", "equivalence": "inconclusive"}
    requirements = [{"class": "http", "expected_failure": {}}, {"class": "safety"}]
    whole = result(Outcome.NOT_CONFORMANT, 1, classes=classes, requirements=requirements, interrupted=False)
    assert whole.trusted_classes == ["safety"]
    part = result(Outcome.GIVEN_UP, 130, classes=classes, requirements=requirements, interrupted=True)
    assert (part.trusted_classes, result(Outcome.GIVEN_UP).trusted_classes) == ([], [])
