"""The yardstick finds each mutant that is noticed less surely than before, and each good device newly blamed."""

import json

import pytest
from click.testing import CliRunner

from proof.selftest.against import file_content, read
from roaas import main

# An id that was merged into another one, as the ledger's aliases say.
_OLD, _NEW = "rest-formats/specific-range", "rest-formats/q-values"
_BEFORE = {"surely": ["http/allow", "http/head"], "merged": [_OLD], "now and then": ["http/allow"], "never": []}


def run_of(folder, name, mutants, blamed=(), by_rule=("http/date",)):
    path = folder / f"{name}.json"
    document = {
        "faults": [{"name": key, "caught": ids, "not_tried": ""} for key, ids in mutants.items()],
        "good_robots": [{"robot": "good", "variant": "", "blamed": list(blamed), "not_tried": ""}],
        "generated": {"mutants": [{"name": "rule", "outcome": "caught" if by_rule else "survived", "by": by_rule}]},
    }
    path.write_text(json.dumps(document))
    return path


def compared(folder, *runs):
    words = [word for run in runs for word in ("--results", str(run))]
    return CliRunner().invoke(main, ["selftest", "--against", str(folder / "yardstick.gz"), *words])


@pytest.fixture
def yardstick(tmp_path):
    runs = [run_of(tmp_path, f"before{turn}", _BEFORE | {"now and then": ["http/allow"] * turn}) for turn in (0, 1)]
    (tmp_path / "yardstick.gz").write_bytes(file_content(read(runs)))
    return tmp_path


@pytest.mark.parametrize(
    ("after", "more", "said"),
    [
        ({"surely": ["http/head"]}, {}, "surely: no longer noticed by http/allow"),
        ({"surely": []}, {}, "surely: survived, which http/allow, http/head noticed in 2 of 2 runs"),
        ({"merged": []}, {}, f"merged: survived, which {_NEW}"),
        ({}, {"blamed": ["http/date"]}, "good: newly blamed by http/date"),
        ({}, {"by_rule": []}, "rule: survived"),
    ],
)
def test_each_loss_is_found(yardstick, after, more, said):
    done = compared(yardstick, run_of(yardstick, "after", _BEFORE | after, **more))
    assert said in done.output
    assert done.exit_code == 1


def test_a_loss_in_one_of_several_runs_is_one(yardstick):
    runs = [run_of(yardstick, f"after{turn}", _BEFORE | ({"surely": []} if turn else {})) for turn in (0, 1)]
    assert compared(yardstick, *runs).exit_code == 1


def test_the_same_merged_or_more_is_no_loss(yardstick):
    after = _BEFORE | {"merged": [_NEW], "now and then": [], "never": ["http/allow"]}
    done = compared(yardstick, run_of(yardstick, "after", after))
    assert (done.exit_code, done.output) == (0, "nothing is worse\n")


def test_what_was_noticed_now_and_then_may_be_missed_by_chance(yardstick):
    runs = [run_of(yardstick, f"after{turn}", _BEFORE | {"now and then": []}) for turn in range(5)]
    assert compared(yardstick, *runs[:4]).exit_code == 0
    done = compared(yardstick, *runs)
    assert "now and then: noticed in 0 of 5 runs, and in 1 of 2 before" in done.output
    assert done.exit_code == 1


def test_single_results_are_compared_too(yardstick):
    before, after = run_of(yardstick, "one", _BEFORE), run_of(yardstick, "other", _BEFORE | {"surely": []})
    words = ["selftest", "--against", str(before), "--results", str(after)]
    assert CliRunner().invoke(main, words).exit_code == 1


@pytest.mark.parametrize("content", ["[]", "{}", "{", '{"format": "roaas-yardstick/1", "mutants": {"a": 1}}'])
def test_a_file_of_another_kind_is_told(yardstick, content):
    (yardstick / "other.json").write_text(content)
    done = compared(yardstick, yardstick / "other.json")
    assert (done.exit_code, "Traceback" in done.output) == (2, False)
