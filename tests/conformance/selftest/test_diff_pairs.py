"""`roaas diff` on real pairs, a good robot and a faulty one; `benchmarks/diff_pairs.py` takes a hundred."""

import sys
from pathlib import Path

from processes import ended

_SCRIPT = Path(__file__).parents[3] / "benchmarks" / "diff_pairs.py"


def test_diff_names_exactly_what_broke_and_in_reverse_what_was_fixed():
    command = [sys.executable, str(_SCRIPT), "--pairs", "3", "--faults", "openapi-*"]
    done = ended(*command)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "3 of 3 pairs right, there and back" in done.stdout
