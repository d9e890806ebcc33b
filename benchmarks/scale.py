"""Nothing is lost and nothing counted twice with several workers: `python benchmarks/scale.py`.

It has three parts. Recorders: processes record a million requests, fixed by a seed, and report them each second as
workers do; the merged result is compared with one recorder of all requests, histogram by histogram. A run: `roaas load`
with workers and closed-model users against a bare server that counts its requests; all counts must agree exactly.
Alike: runs on a described device with 1, 2 and 4 workers at one rate; the 95 % intervals of their medians must overlap,
and each count agree. The exit code is 1 where anything differs.
"""

import argparse
import json
import multiprocessing
import signal
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import msgpack
import numpy as np
from fixed import POSE, Answer, running_bare
from programs import machine, roaas_load

from loadtests.statistics.recorder import Recorder

_SEGMENTS = 600
_REPORTED = 4000  # requests in a report: what a worker at 4,000/s has to tell after a second
_BLOCKS = 10  # that it tells of
_OPERATION = {"get": {"responses": {"200": {"description": "state", "content": {"application/json": {}}}}}}
_TEXT = json.dumps({"openapi": "3.1.0", "info": {"title": "bare", "version": "1"}, "paths": {"/state": _OPERATION}})
_DESCRIPTION = Answer(
    "/openapi.json", 200, [("content-type", "application/json"), ("content-length", str(len(_TEXT)))], _TEXT
)
_SERIES = {segment: 4 + 2 * (segment % 2) for segment in range(_SEGMENTS)}


def record(book: Recorder, seed: int, first: int, requests: int) -> None:
    """Record numbered requests, starting at `first`: one in 500 fails, one in 1,000 never starts."""
    rng = np.random.default_rng([seed, first])
    service = rng.lognormal(np.log(150_000), 0.6, requests).astype(int).tolist()
    lag = rng.exponential(30_000, requests).astype(int).tolist()
    for number in range(requests):
        segment = (first // _REPORTED * _BLOCKS + number * _BLOCKS // _REPORTED) % _SEGMENTS
        operation, due = number & 1, (first + number) * 250_000
        start = due + lag[number]
        done = start + service[number]
        if number % 1000 == 999:  # noqa: PLR2004 -- see above
            book.drop(segment, operation, 10**10)
        elif number % 500 == 499:  # noqa: PLR2004 -- see above
            book.fail(segment, operation, "closed", "connection closed", due, (done - start, done - due))
        else:
            book.record(segment, operation, due, start, start + 2000, done - 3000, done, service[number] // 2)


def reports(first: int, requests: int) -> Iterator[tuple[int, int]]:
    """Yield the reports of a worker's share: the first request and the number of each."""
    for at in range(first, first + requests, _REPORTED):
        yield at, min(_REPORTED, first + requests - at)


def work(seed: int, first: int, requests: int, pipe: Any) -> None:
    """Record a worker's share, and report as often as a worker does, packed as for the network."""
    book = Recorder(_SERIES)
    for at, number in reports(first, requests):
        record(book, seed, at, number)
        pipe.send_bytes(msgpack.dumps(book.take()))
    pipe.send_bytes(b"")


def contents(book: Recorder) -> dict[str, Any]:
    """Return all records in an order that does not depend on which worker reported first."""
    return {name: sorted(map(repr, dict(part).items())) for name, part in _parts(book).items()}


def _parts(book: Recorder) -> dict[str, Any]:
    cells = {
        key: [{name: one.pack() for name, one in cell.histograms().items()}, cell.errors, cell.late, cell.dropped]
        for key, cell in book.cells.items()
    }
    spans = {key: {name: one.pack() for name, one in series.parts().items()} for key, series in book.spans.items()}
    return {"cells": cells, "spans": spans, "failures": book.failures, "counters": book.counters}


def recorders(requests: int, workers: int, seed: int) -> bool:
    """Compare the workers' merged reports with one recorder of all requests."""
    share = requests // workers
    context = multiprocessing.get_context("spawn")
    ends = []
    merged, received, octets, spent = Recorder(), 0, 0, 0.0
    for number in range(workers):
        ours, theirs = context.Pipe(duplex=False)
        process = context.Process(target=work, args=(seed, number * share, share, theirs))
        process.start()
        theirs.close()
        ends.append((process, ours))
    for process, pipe in ends:
        while report := pipe.recv_bytes():
            began = time.process_time()
            merged.merge(Recorder.unpack(msgpack.loads(report, strict_map_key=False)))
            spent += time.process_time() - began
            received, octets = received + 1, octets + len(report)
        process.join()
    whole = Recorder(_SERIES)
    for worker in range(workers):
        for at, number in reports(worker * share, share):
            record(whole, seed, at, number)
    whole.flush()
    found, wanted = contents(merged), contents(whole)
    cells = merged.cells.values()
    answered, failed, dropped = (
        sum(cell.service.total for cell in cells),
        sum(cell.errors for cell in cells),
        sum(cell.dropped for cell in cells),
    )
    same = found == wanted and answered + failed + dropped == share * workers
    print(
        f"recorders: {answered:,} answered, {failed:,} failed, {dropped:,} never started, of {share * workers:,} over "
        f"{workers} processes; {received} reports, {octets / 1e6:.1f} MB, {spent * 1e3 / received:.1f} ms of the "
        f"master's processor each; all {sum(map(len, wanted.values())):,} entries of the merged whole are "
        f"{'the same as' if same else 'NOT those of'} one recorder of all"
    )
    return same


def run(seconds: float, workers: int, users: int) -> bool:
    """Run `roaas load` with workers, and compare its counts with the server's count of requests."""
    with running_bare([POSE], "--count") as (port, server):
        options = ["--users", users, "--duration", f"{seconds:g}", "--warmup", "0", "--processes", workers]
        found = roaas_load("--rest", f"http://127.0.0.1:{port}", *options)
        server.send_signal(signal.SIGINT)
        return balance(found, int(server.stdout.readline() if server.stdout else 0))


def alike(seconds: float, rate: float) -> bool:
    """Measure a described device with 1, 2 and 4 workers, and compare the counts and the medians."""
    medians, balanced = [], True
    with running_bare([replace(POSE, target="/state"), _DESCRIPTION]) as (port, _):
        for workers in (1, 2, 4):
            found = roaas_load(
                f"http://127.0.0.1:{port}/openapi.json",
                *("--operation", "GET /state", "--rate", f"{rate:g}", "--duration", f"{seconds:g}"),
                *("--processes", workers, "--expect-workers", workers),
            )
            told, series = found["counts"], found["series"][0]
            reported = sum(worker["requests"] for worker in found["workers"])
            balanced = balanced and told["asked"] == told["answered"] and len(found["workers"]) == workers
            medians.append(series["ci95_ms"]["p50"])
            print(
                f"alike: {workers} workers, {told['asked']:,} due, {told['answered']:,} answered, {reported:,} "
                f"reported; median {series['service_ms']['p50']:.3f} ms (95 % {medians[-1][0]:.3f} to "
                f"{medians[-1][1]:.3f}), lag {found['generator']['lag_ms']['p50']:.3f} ms"
            )
    overlap = max(low for low, _ in medians) <= min(high for _, high in medians)
    print(f"alike: the medians' intervals {'overlap' if overlap else 'do NOT overlap'}")
    return balanced and overlap


def balance(found: dict[str, Any], reached: int) -> bool:
    """Return whether the counts agree: what was due, what workers reported, and what the server received."""
    told = found["counts"]
    due, answered, failed, dropped = told["asked"], told["answered"], sum(told["failed"].values()), told["not_sent"]
    reported = sum(worker["requests"] for worker in found["workers"])
    other = 1 + sum(map(_after_pauses, found["series"]))  # one call looked whether the robot answers
    lag_ms = found["generator"]["lag_ms"]["p50"]
    good = due == answered + failed + dropped and reported == answered + failed
    good = good and answered <= reached - other <= answered + failed  # of those that failed some may have reached it
    print(
        f"run: {due:,} due; {answered:,} answered, {failed:,} failed, {dropped:,} never started; {reported:,} in the "
        f"reports of {len(found['workers'])} workers; {reached:,} seen by the server, {other:,} of them before and "
        f"after the run; lag {lag_ms:.2f} ms median: the books {'balance' if good else 'do NOT balance'}"
    )
    return good


def _after_pauses(series: dict[str, Any]) -> int:
    """Return how many requests a series sent after pauses; the first turn is not among its counts."""
    paused = series["after_pause"]
    if not paused or not paused["cold_count"]:
        return 0
    return int((paused["cold_count"] + 1) * (1 + paused["warm_count"] // paused["cold_count"]))


def main() -> int:
    """Count everything twice."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--requests", type=int, default=1_000_000, help="for the recorders [1,000,000]")
    parser.add_argument("--workers", type=int, default=4, help="processes that record or load [4]")
    parser.add_argument("--seconds", type=float, default=150.0, help="of the run [150]")
    parser.add_argument("--users", type=int, default=16, help="of the run, each with one request under way [16]")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", choices=["recorders", "run", "alike"], help="one part alone")
    parser.add_argument("--rate", type=float, default=200.0, help="of the runs that have to be alike [200]")
    options = parser.parse_args()
    print(machine())
    met = []
    if options.only in {None, "recorders"}:
        met.append(recorders(options.requests, options.workers, options.seed))
    if options.only in {None, "run"}:
        met.append(run(options.seconds, options.workers, options.users))
    if options.only in {None, "alike"}:
        met.append(alike(options.seconds / 5, options.rate))
    return 0 if all(met) else 1


if __name__ == "__main__":
    sys.exit(main())
