"""Options, statement and WSDL: what is refused, and in which words."""

import re

import pytest
from click.testing import CliRunner

from conformance.commandline.exit_codes import ExitCode
from conformance.packs.table1.statement import Statement
from conformance.statement.endpoints import Endpoints
from conformance.statement.load import Load
from loadtests.cli import load
from loadtests.settings.settings import CliOptions, Settings, SettingsError
from loadtests.settings.settle import MOTION_RATE, settle

REST = {"rest": "http://robot:7003"}


def test_options_win_over_the_statement_and_defaults_fill_the_rest():
    said = Endpoints(rest="http://robot:7003", publishers_endpoint="http://robot:5555/p", timeout_s=3.0)
    found = settle(CliOptions.of(rest="http://other:1", rate=50.0), Statement(endpoints=said))
    robot, selection = found.robot, found.selection
    assert (robot.rest, robot.publishers, robot.timeout_s) == ("http://other:1", "http://robot:5555/p", 3.0)
    assert (found.load.rate, selection.operations) == (50.0, ("pose",))
    assert (selection.interfaces, selection.clients) == (("rest", "soap"), ("wire", "zeep"))
    assert Settings.from_json(found.to_json()) == found


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (CliOptions.of(), "no endpoint"),
        (CliOptions.of(rest="robot"), "'robot' does not begin with http"),
        (CliOptions.of(**REST, operations=("delivery",)), "--allow-motion"),
        (CliOptions.of(**REST, rate=10.0, users=2), "exclude each other"),
        (CliOptions.of(**REST, rate=0.0), "--rate 0 is out of range"),
        (CliOptions.of(**REST, rate=float("nan")), "--rate nan is out of range"),
        (CliOptions.of(**REST, users=0), "--users 0 is out of range"),
        (CliOptions.of(**REST, duration_s=-1.0), "--duration -1 is out of range"),
        (CliOptions.of(**REST, warmup_s=-1.0), "--warmup -1 is out of range"),
        (CliOptions.of(**REST, rate=501.0, allow_motion=True), "exceeds 500 requests/s (the default limit"),
        (CliOptions.of(**REST, duration_s=121.0, allow_motion=True), "exceeds 120 s (the default limit"),
        (
            CliOptions.of(**REST, token_file="/nonexistent"),  # noqa: S106 - a path
            "file '/nonexistent' with a secret cannot be read: No such file",
        ),
        (CliOptions.of(**REST, ca_file="/nonexistent"), "ca_file '/nonexistent'"),
        (CliOptions.of(**REST, interfaces=("soap",)), "--interface soap needs"),
    ],
)
def test_runs_that_must_not_be(options, message):
    with pytest.raises(SettingsError, match=re.escape(message)):
        settle(options, Statement())


@pytest.mark.parametrize(
    ("options", "allowed_s", "looks"),
    [
        ({}, None, (1, 2, 4)),
        ({}, 100.0, (1, 2)),
        ({}, 20.0, (1,)),
        ({"duration_s": 40.0}, None, (1,)),
        ({"repeat": 2}, None, (1,)),
    ],
)
def test_a_comparison_goes_on_unless_its_length_was_said(options, allowed_s, looks):
    other = Statement(endpoints=Endpoints(rest="http://other:1"), load=Load(max_duration_s=allowed_s))
    mine = Statement(load=Load(max_duration_s=20.0 if allowed_s == 20.0 else None))
    assert settle(CliOptions.of(**REST, against=other, **options), mine).against.looks == looks


def test_the_statements_limits_hold_and_lift():
    limits = Statement(endpoints=Endpoints(request_rate=80.0), load=Load(max_duration_s=5.0))
    assert settle(CliOptions.of(**REST), limits).load.rate == 80
    assert settle(CliOptions.of(**REST), limits).load.duration_s == 5
    with pytest.raises(
        SettingsError, match=re.escape("exceeds 80 requests/s (the statement's [endpoints] request_rate)")
    ):
        settle(CliOptions.of(**REST, rate=81.0), limits)
    lifted = Statement(load=Load(max_rate=2000.0, max_duration_s=900.0))
    found = settle(CliOptions.of(**REST, rate=1500.0, duration_s=600.0, allow_motion=True), lifted)
    assert (found.load.rate, found.limits.max_rate) == (1500.0, 2000.0)
    assert settle(CliOptions.of(**REST, rate=9000.0, duration_s=600.0), Statement()).load.rate == 9000.0, (
        "reads are not bounded"
    )
    assert settle(CliOptions.of(**REST, knee=True, allow_motion=True), Statement()).steps.most_rate is None, "of reads"
    assert settle(CliOptions.of(**REST, users=4, allow_motion=True), Statement()).limits.max_rate == MOTION_RATE


def test_a_slip_in_any_table_of_the_statement_is_refused(tmp_path):
    path = tmp_path / "statement.toml"
    path.write_text('[endpoints]\nrest = "http://127.0.0.1:1"\n[limts]\nlinear_m_s = 0.5\n')
    ended = CliRunner().invoke(load, [str(path), "--out", str(tmp_path / "out")])
    assert (ended.exit_code, "unknown key 'limts'" in ended.output) == (ExitCode.USAGE, True), ended.output


@pytest.mark.parametrize("content", [b"", b"a b", "schl\u00fcssel".encode(), b"\xff\xfe"])
def test_tokens_that_no_header_may_hold(tmp_path, content):
    path = tmp_path / "token"
    path.write_bytes(content)
    with pytest.raises(SettingsError, match="token"):
        settle(CliOptions.of(**REST, token_file=str(path)), Statement())
