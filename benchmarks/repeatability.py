"""Whether runs of `roaas load` agree: `python benchmarks/repeatability.py` measures one robot ten times.

There are ten runs of 20 s, one after the other, of deliveries by the wire client at 200 requests/s. The benchmark
prints whether the ten intervals of SOAP's median over REST's overlap, and whether the ratios lie within 5 %. It also
prints by how much the ratios scatter beyond their intervals: Birge's ratio, 1 where the intervals explain all of it
(Physical Review 40, 1932), and the probability of that scatter (Cochran's Q).

Correct 95 % intervals overlap less often than one expects: all of ten do in about 85 % of such experiments.
"""

import argparse
import math
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from programs import machine, median_of, roaas_load, running_robot
from scipy import stats

_WITHIN = 0.05
_NORMAL_95 = 1.96
_STATEMENT = Path(__file__).parents[1] / "reference_robot" / "statement.toml"


class Run(NamedTuple):
    """The median's ratio in one run, and its 95 % interval."""

    ratio: float
    low: float
    high: float


def measured(rest: str, soap: str, seconds: float, seed: int) -> Run:
    """Run `roaas load` once."""
    services = ["--publishers-wsdl", soap, "--subscribers-wsdl", soap.replace("publisher", "subscriber")]
    what = ["--allow-motion", "--operation", "delivery", "--rate", "200", "--warmup", "1"]
    times = ["--duration", f"{seconds:g}", "--seed", seed]
    found = roaas_load(_STATEMENT, "--rest", rest, *services, *what, *times)
    median = median_of(found)
    low, high = median["ci95"] or (math.nan, math.nan)
    print(
        f"run {seed}: {median['ratio']:.3f} ({low:.3f} to {high:.3f}), {median['judgement']}, "
        f"{'valid' if found['valid'] else '; '.join(found['invalid_because'])}, {machine()}",
        flush=True,
    )
    return Run(median["ratio"], low, high)


def agreement(runs: Sequence[Run]) -> bool:
    """Print how far the runs agree; returns whether they do."""
    lows, highs, ratios = (np.array(column) for column in zip(*[(r.low, r.high, r.ratio) for r in runs], strict=True))
    overlap = bool(lows.max() <= highs.min())
    spread = float(ratios.max() / ratios.min() - 1)
    errors = np.log(highs / lows) / (2 * _NORMAL_95)
    logs, weights = np.log(ratios), 1 / errors**2
    centre = float((logs * weights).sum() / weights.sum())
    q = float((((logs - centre) / errors) ** 2).sum())
    print(
        f"{len(runs)} runs: ratios {ratios.min():.3f} to {ratios.max():.3f}, within {spread:.1%} (5 %): "
        f"{'met' if spread <= _WITHIN else 'MISSED'}; all intervals overlap: {'met' if overlap else 'MISSED'} "
        f"(highest lower bound {lows.max():.3f}, lowest upper bound {highs.min():.3f}); Birge's ratio "
        f"{math.sqrt(q / (len(runs) - 1)):.2f}, p = {stats.chi2.sf(q, len(runs) - 1):.2f}"
    )
    return overlap and spread <= _WITHIN


def main() -> int:
    """Measure repeatedly; the exit code is 1 where the runs do not agree."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=10, help="[10]")
    parser.add_argument("--seconds", type=float, default=20.0, help="of each [20]")
    parser.add_argument("--domain-id", default="50", help="ROS domain of the robot [50]")
    options = parser.parse_args()
    with running_robot(f"--domain-id={options.domain_id}") as robot:
        rest = f"http://{robot.rest.host}:{robot.rest.port}"
        soap = f"http://{robot.soap.host}:{robot.soap.port}{robot.soap.target}?wsdl"
        runs = [measured(rest, soap, options.seconds, seed) for seed in range(1, options.runs + 1)]
    return 0 if agreement(runs) else 1


if __name__ == "__main__":
    sys.exit(main())
