"""The yardstick finds each mutant that is noticed less surely than before, and each good device newly blamed."""

import json
import sys
from pathlib import Path

import pytest
from processes import ended

_SCRIPT = Path(__file__).parents[3] / "benchmarks" / "yardstick.py"
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
    return ended(sys.executable, _SCRIPT, "compare", *runs, "--yardstick", folder / "yardstick.gz")


@pytest.fixture
def yardstick(tmp_path):
    runs = [run_of(tmp_path, f"before{turn}", _BEFORE | {"now and then": ["http/allow"] * turn}) for turn in (0, 1)]
    done = ended(sys.executable, _SCRIPT, "gather", *runs, "--yardstick", tmp_path / "yardstick.gz", check=True)
    assert "4 mutants" in done.stdout
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
    assert said in done.stdout
    assert done.returncode == 1


def test_a_loss_in_one_of_several_runs_is_one(yardstick):
    runs = [run_of(yardstick, f"after{turn}", _BEFORE | ({"surely": []} if turn else {})) for turn in (0, 1)]
    assert compared(yardstick, *runs).returncode == 1


def test_the_same_merged_or_more_is_no_loss(yardstick):
    after = _BEFORE | {"merged": [_NEW], "now and then": [], "never": ["http/allow"]}
    done = compared(yardstick, run_of(yardstick, "after", after))
    assert (done.returncode, done.stdout) == (0, "nothing is lost\n")


def test_a_file_of_another_kind_is_told(yardstick):
    (yardstick / "other.json").write_text("[]")
    done = compared(yardstick, yardstick / "other.json")
    assert (done.returncode, "Traceback" in done.stderr) == (2, False)
