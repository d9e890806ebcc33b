"""How often `roaas load` claims a difference where there is none, and how often it finds an existing difference.

`python benchmarks/calibration.py` prints the table of docs/load.md, `--quick` a rougher one. Most runs are artificial:
the schedule of a real plan goes through the real recorder and the real statistics, with service times that are
log-normal around a drifting level. The level is a first-order autoregressive series (lag-1 autocorrelation of the
per-second medians about 0.6, as measured on a shared machine). Some runs are real: `roaas load` over HTTP against
`noisy_robot.py`.
"""

import argparse
import math
import multiprocessing
import os
import sys
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor

import numpy as np
from programs import HERE, machine, roaas_load, started
from scipy import signal, stats

from conformance.papers_robot.statement import CONTRACT_DIR
from loadtests.schedule.arrivals import Schedule
from loadtests.schedule.plan import SHORT_BLOCK_S, Load, Plan
from loadtests.statistics.comparisons import aa_interval, comparison
from loadtests.statistics.measured import Measured
from loadtests.statistics.recorder import Recorder
from loadtests.statistics.rounds import IDLE_MACHINE

RATE, LEVEL_NS, FAST, DRIFT, MEMORY_S = 200.0, 2_000_000, 0.2, 0.1, 2.0
_STEP_S = 0.01
SHIFT = 1.05
REAL_SAME_S, REAL_PLANTED_S = 20.0, 60.0
MOST_CLAIMS, LEAST_POWER = 0.05, 0.95
CLAIMS = frozenset({"differs", "bounded"})


def made_run(seed: int, seconds: float, shift: float) -> Measured:
    """Return a run in which only the robot's times are artificial; SOAP's are `shift` times REST's."""
    load = Load(RATE, None, seconds, 0.0, "constant", seed)
    plan = Plan(("pose",), ("rest", "soap"), ("wire",), load, 10.0, 1, 32, least_block_s=SHORT_BLOCK_S)
    schedule, recorder = Schedule(plan, 0, 1), Recorder(plan.series_of())
    rng = np.random.default_rng([seed, 99])
    kept, before = math.exp(-_STEP_S / MEMORY_S), int(10 * MEMORY_S / _STEP_S)
    steps = rng.normal(0.0, DRIFT * math.sqrt(1 - kept * kept), before + int(seconds / _STEP_S) + 2)
    level = signal.lfilter([1.0], [1.0, -kept], steps)[before:]
    for index, segment in enumerate(plan.segments):
        factor = shift if segment.interface == "soap" else 1.0
        for due in schedule.due_ns(index):
            took = int(LEVEL_NS * factor * math.exp(level[int(due / 1e9 / _STEP_S)] + rng.normal(0.0, FAST)))
            recorder.record(index, 0, due, due, due, due + took, due + took, -1)
    recorder.flush()
    return Measured([plan], recorder)


def judged(run: tuple[int, float, float, str]) -> tuple[str, bool, bool]:
    """Return the judgement of an artificial run, and whether the intervals of duel and A/A control miss the truth."""
    seed, seconds, shift, quantile = run
    measured = made_run(seed, seconds, shift)
    control = aa_interval(measured, "pose", quantile)
    entry = comparison(measured, "pose", "wire", quantile, control, IDLE_MACHINE)
    low, high = entry.ci95
    return entry.judgement, not low <= shift <= high, control is None or not control[0] <= 1 <= control[1]


def real_run(seed: int, seconds: float, shift: float) -> str:
    """Return the judgement of `roaas load` on a robot with artificial noise; print the run's figures to stderr."""
    with started(sys.executable, HERE / "noisy_robot.py", seed, shift) as (_, port):
        url = f"http://127.0.0.1:{port}"
        wsdl = ["--subscribers-wsdl", CONTRACT_DIR / "subscribers.wsdl", "--subscribers-endpoint", f"{url}/subscribers"]
        entries = roaas_load("--rest", url, *wsdl, "--duration", f"{seconds:g}", "--seed", seed)["comparisons"]
        found = next(entry for entry in entries if entry["quantile"] == "p50")
    told = (found[key] for key in ("ratio", "ci95", "noise_ci95", "judgement"))
    print(f"seed {seed}, {seconds:g} s, {shift:g} planted:", *told, file=sys.stderr, flush=True)
    return str(found["judgement"])


def share(number: int, runs: int) -> str:
    """Return a share with its own 95 % interval."""
    low, high = stats.binomtest(number, runs).proportion_ci(method="wilson")
    return f"{number} of {runs} = {number / runs:.1%} ({low:.1%} to {high:.1%})"


def row(words: str, cell: str, aim: str, *, met: bool) -> bool:
    """Print a row of the table."""
    print(f"| {words} | {cell} | {aim} | {'met' if met else 'MISSED'} |", flush=True)
    return met


def made_rows(pool: ProcessPoolExecutor, runs: int) -> list[bool]:
    """Print the rows of artificial runs."""
    met = []
    for quantile, seconds in (("p50", 20.0), ("p99", 60.0)):
        found = list(pool.map(judged, [(seed, seconds, 1.0, quantile) for seed in range(runs)]))
        said = f"A/A, {quantile}, {seconds:g} s, made"
        claims = sum(verdict in CLAIMS for verdict, _, _ in found)
        wrong = sum(left_out for _, left_out, _ in found)
        met.append(row(f"{said}: claims a difference", share(claims, runs), "at most 5 %", met=_few(claims, runs)))
        met.append(row(f"{said}: interval without 1", share(wrong, runs), "at most 5 %", met=_few(wrong, runs)))
    found = list(pool.map(judged, [(seed, 60.0, SHIFT, "p50") for seed in range(1000, 1000 + runs)]))
    hits = sum(verdict in CLAIMS for verdict, _, _ in found)
    wrong = sum(left_out for _, left_out, _ in found)
    said = "5 % planted, p50, 60 s, made"
    met.append(row(f"{said}: found", share(hits, runs), "at least 95 %", met=hits >= LEAST_POWER * runs))
    met.append(row(f"{said}: interval without 1.05", share(wrong, runs), "at most 5 %", met=_few(wrong, runs)))
    return met


def _few(number: int, runs: int) -> bool:
    return number <= MOST_CLAIMS * runs


def real_rows(same: int, planted: int) -> list[bool]:
    """Print the rows of real runs, one run for each processor at a time: robot and load generator mostly sleep.

    They are too few for a rate of their own; they show that the artificial runs are realistic.
    """
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        alike = list(pool.map(lambda seed: real_run(seed, REAL_SAME_S, 1.0), range(same)))
        other = list(pool.map(lambda seed: real_run(seed, REAL_PLANTED_S, SHIFT), range(100, 100 + planted)))
    claims, hits = (sum(verdict in CLAIMS for verdict in verdicts) for verdicts in (alike, other))
    at, found = f"A/A, p50, {REAL_SAME_S:g} s, HTTP", f"5 % planted, p50, {REAL_PLANTED_S:g} s, HTTP: found"
    return [
        row(f"{at}: claims a difference", share(claims, same), "at most 1", met=claims <= 1),
        row(found, share(hits, planted), "all but 1", met=hits >= planted - 1),
    ]


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table; the exit code is 1 when a target is missed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="a tenth of the runs, and one real one of each kind")
    parser.add_argument("--runs", type=int, help="made runs of each kind [200]")
    parser.add_argument("--only", choices=["made", "real"], help="one part alone")
    options = parser.parse_args(arguments)
    runs = options.runs or (20 if options.quick else 200)
    real = 1 if options.quick else 10
    began = time.monotonic()
    print("| what | how often (95 % interval) | aim | |\n|---|---|---|---|")
    met = []
    if options.only != "real":
        # As in `roaas load`: threads of NumPy's linear algebra would spin beside the other process. It reads that when
        # it is imported, hence processes that do so anew.
        os.environ["OPENBLAS_NUM_THREADS"] = "1"
        with ProcessPoolExecutor(os.cpu_count(), multiprocessing.get_context("spawn")) as pool:
            met += made_rows(pool, runs)
    if options.only != "made":
        met += real_rows(real, real)
    print(f"\n{time.monotonic() - began:.0f} s, {machine()}")
    return 0 if all(met) else 1


if __name__ == "__main__":
    sys.exit(main())
