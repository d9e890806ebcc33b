"""What the suite is worth, before and after a change: what notices each mutant, and which good devices are blamed.

``roaas selftest`` writes one selftest.json for a run. This command gathers several of them into the yardstick, so that
each kill has a probability, and compares later runs with it:

    python benchmarks/yardstick.py gather out/one/selftest.json out/two/selftest.json out/three/selftest.json
    python benchmarks/yardstick.py compare out/later/selftest.json

A mutant is lost if all runs of the yardstick killed it and a later one did not, or if a requirement that noticed it in
all of them, or one that it has been merged into, does no longer. Exit code: 0 if nothing is lost and no good device is
newly blamed, 1 otherwise, 2 for a file that cannot be read.
"""

import argparse
import gzip
import json
import sys
from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Final

from conformance.contract.ledger import renamed
from conformance.contract.pack import Contract

YARDSTICK: Final = Path(__file__).parents[1] / "tests" / "conformance" / "data" / "yardstick.json.gz"
_FORMAT: Final = "roaas-yardstick/1"
# By mutant or good device: in how many runs it was seen, and in how many each requirement failed or warned.
Table = dict[str, tuple[int, dict[str, int]]]


def gathered(runs: Iterable[Mapping[str, Any]]) -> dict[str, Table]:
    """Return how often each requirement noticed each mutant and blamed each good device, of the runs of a self-test."""
    seen: dict[str, Counter[str]] = defaultdict(Counter)
    by: dict[tuple[str, str], Counter[str]] = defaultdict(Counter)
    for run in runs:
        rows = [("mutants", one["name"], one["caught"]) for one in run["faults"] if not one["not_tried"]]
        rows += [
            ("by_rule", one["name"], one["by"])
            for one in run.get("generated", {}).get("mutants", ())
            if one["outcome"] in {"caught", "survived"}
        ]
        rows += [
            ("good", " ".join(filter(None, (one["robot"], one["variant"]))), one["blamed"])
            for one in run["good_robots"]
            if not one["not_tried"]
        ]
        for table, name, ids in rows:
            seen[table][name] += 1
            by[table, name].update(set(ids))
    return {
        table: {name: (count, dict(sorted(by[table, name].items()))) for name, count in sorted(names.items())}
        for table, names in sorted(seen.items())
    }


def lost(before: Mapping[str, Table], after: Mapping[str, Table], names: Mapping[str, str]) -> list[str]:
    """Return a sentence on each mutant that is no longer noticed as surely, and on each good device newly blamed.

    Args:
        before: the yardstick.
        after: later runs; what they did not try is not compared.
        names: the present id of each requirement that was renamed or merged.
    """
    said = []
    for table in ("mutants", "by_rule"):
        for name, (runs, by) in before.get(table, {}).items():
            later, found = after.get(table, {}).get(name, (0, {}))
            now = {names.get(id_, id_): count for id_, count in found.items()}
            if not later:
                continue
            surely = {names.get(id_, id_) for id_, count in by.items() if count == runs}
            gone = sorted(id_ for id_ in surely if now.get(id_, 0) < later)
            if surely and max(now.values(), default=0) < later:
                said.append(f"{name}: survived, which {', '.join(sorted(surely))} noticed in {runs} of {runs} runs")
            elif gone:
                said.append(f"{name}: no longer noticed by {', '.join(gone)}")
    for name, (_, by) in after.get("good", {}).items():
        known = {names.get(id_, id_) for id_ in before.get("good", {}).get(name, (0, {}))[1]}
        said += [f"{name}: newly blamed by {id_}" for id_ in sorted({names.get(id_, id_) for id_ in by} - known)]
    return said


def main() -> int:
    """Gather or compare; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("gather", "compare"))
    parser.add_argument("runs", nargs="+", type=Path, metavar="selftest.json")
    parser.add_argument("--yardstick", type=Path, default=YARDSTICK, help="its file")
    options = parser.parse_args()
    try:
        found = gathered(json.loads(path.read_text(encoding="utf-8")) for path in options.runs)
        if options.what == "gather":
            octets = json.dumps({"format": _FORMAT, **found}, indent=0, sort_keys=True).encode()
            options.yardstick.write_bytes(gzip.compress(octets, mtime=0))
            print(f"{options.yardstick}: {', '.join(f'{len(table)} {name}' for name, table in found.items())}")
            return 0
        before = json.loads(gzip.decompress(options.yardstick.read_bytes()))
        said = lost(before, found, renamed(Contract.load().ledger))
    except (OSError, ValueError, LookupError, TypeError) as error:
        print(f"{type(error).__name__}: {error}", file=sys.stderr)
        return 2
    print("\n".join([*said, f"{len(said)} differences to the worse" if said else "nothing is lost"]))
    return 1 if said else 0


if __name__ == "__main__":
    sys.exit(main())
