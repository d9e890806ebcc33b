"""Compare a self-test with earlier ones: which requirements notice each mutant, and which good devices fail.

Several earlier runs give each kill a probability. A mutant is lost if all of them killed it and a later one did not; if
some of them did, and now fewer than chance leaves; or if a requirement that noticed it in all of them, or one that it
has been merged into, does no longer. What a later run did not try is not compared.
"""

import gzip
import json
from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping
from math import comb
from pathlib import Path
from typing import Any, Final

from conformance.commandline.given_files import read_json, read_octets, unzipped

_FORMAT: Final = "roaas-yardstick/1"
# A smaller probability rules out chance.
_NO_CHANCE: Final = 0.05
# The number of runs, and by requirement the runs in which it failed or warned, by mutant or good device.
Table = dict[str, tuple[int, dict[str, int]]]


def gather(runs: Iterable[Mapping[str, Any]]) -> dict[str, Table]:
    """Return how often each requirement noticed each mutant and blamed each good device, of the runs of a self-test."""
    seen: dict[str, Counter[str]] = defaultdict(Counter)
    by: dict[tuple[str, str], Counter[str]] = defaultdict(Counter)
    for run in runs:
        rows = [("mutants", item["name"], item["caught"]) for item in run["faults"] if not item["not_tried"]]
        rows += [
            ("by_rule", item["name"], item["by"])
            for item in run.get("generated", {}).get("mutants", ())
            if item["outcome"] in {"caught", "survived"}
        ]
        rows += [
            ("good", " ".join(filter(None, (item["robot"], item["variant"]))), item["blamed"])
            for item in run["good_robots"]
            if not item["not_tried"]
        ]
        for table, name, ids in rows:
            seen[table][name] += 1
            by[table, name].update(set(ids))
    return {
        table: {name: (count, dict(sorted(by[table, name].items()))) for name, count in sorted(names.items())}
        for table, names in sorted(seen.items())
    }


def losses(before: Mapping[str, Table], after: Mapping[str, Table], names: Mapping[str, str]) -> list[str]:
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
            ever, kills = max(by.values(), default=0), max(now.values(), default=0)
            if not surely and _chance(kills, later, ever / runs) < _NO_CHANCE:
                said.append(f"{name}: noticed in {kills} of {later} runs, and in {ever} of {runs} before")
            elif surely and kills < later:
                said.append(f"{name}: survived, which {', '.join(sorted(surely))} noticed in {runs} of {runs} runs")
            elif gone:
                said.append(f"{name}: no longer noticed by {', '.join(gone)}")
    for name, (_, by) in after.get("good", {}).items():
        known = {names.get(id_, id_) for id_ in before.get("good", {}).get(name, (0, {}))[1]}
        said += [f"{name}: newly blamed by {id_}" for id_ in sorted({names.get(id_, id_) for id_ in by} - known)]
    return said


def _chance(kills: int, runs: int, probability: float) -> float:
    """Return how likely at most so many kills are in so many runs."""
    rest = 1 - probability
    return sum(comb(runs, count) * probability**count * rest ** (runs - count) for count in range(kills + 1))


def read(paths: Iterable[Path]) -> dict[str, Table]:
    """Return the tables of stored runs: of a yardstick, or of each run's selftest.json; either may be gzipped.

    Raises:
        OSError: a file cannot be read.
        ValueError: it is neither, or a yardstick among other files.
    """
    documents = []
    for path in paths:
        octets = read_octets(path)
        documents.append(read_json(unzipped(octets) if octets.startswith(b"\x1f\x8b") else octets))
    try:
        if len(documents) == 1 and documents[0].get("format") == _FORMAT:
            tables = {table: names for table, names in documents[0].items() if table != "format"}
            return {
                table: {name: (int(count), {**by}) for name, (count, by) in names.items()}
                for table, names in tables.items()
            }
        return gather(documents)
    except (AttributeError, LookupError, TypeError) as error:
        raise ValueError(f"no results of a self-test: {error!r}") from error


def file_content(tables: Mapping[str, Table]) -> bytes:
    """Return the content of a yardstick's file."""
    return gzip.compress(json.dumps({"format": _FORMAT, **tables}, indent=0, sort_keys=True).encode(), mtime=0)
