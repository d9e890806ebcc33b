"""Run ``roaas certify`` with a motion map on a simulated device, over HTTP."""

import json
import sys

from arm import MAP
from processes import ended
from serving_apps import serving_app

QUICK = MAP.replace("seconds = 0.5", "seconds = 0.25").replace("speed = 4", "speed = 8")
#: So often a right device is judged at most.
RUNS = 5
#: The same without what is tried beyond limits, and without what a move says and how it is stopped.
MOVES = QUICK[: QUICK.index("[motion.action]")].replace('beyond_limits = "refused"\n', "")


def judged_by_map(serving, motion, tmp_path, api='openapi = "{url}/openapi.json"', only=()):
    """Return what a run says of a device, by requirement of the class motion.

    Args:
        serving: serves the device, and yields its address.
        motion: its motion map.
        tmp_path: for the run's files.
        api: where its description is.
        only: the names of the requirements that are judged; all without any.
    """
    statement, out = tmp_path / "device.toml", tmp_path / "out"
    with serving as url:
        statement.write_text(f"[api]\n{api.format(url=url)}\n{motion}", encoding="utf-8")
        chosen = [f"--select=motion/{name}" for name in only] or ["--class=motion"]
        more = ["--allow-motion", "--effort", "quick", *chosen, "--out", str(out)]
        done = ended(sys.executable, "-m", "roaas", "certify", str(statement), *more)
    assert "Traceback" not in done.stdout + done.stderr, done.stderr
    if not (out / "result.json").exists():
        return done, {}
    result = json.loads((out / "result.json").read_text(encoding="utf-8"))
    return done, {one["id"]: one["verdict"] for one in result["requirements"] if one["id"].startswith("motion/")}


def passed_but(missing, judge):
    """Check that a right device passes all but what its map does not declare; return the last run's command.

    A busy machine may keep a run from judging something, and never makes it fail: what was not judged is judged again.
    """
    left = None
    for _ in range(RUNS):
        done, judged = judge()
        assert judged, done.stdout + done.stderr
        assert not {"fail", "warn"} & set(judged.values()), done.stdout
        not_passed = {id_.removeprefix("motion/") for id_, verdict in judged.items() if verdict != "pass"}
        left = not_passed if left is None else left & not_passed
        if left == missing:
            break
    assert left == missing, done.stdout
    return done


def of_arm(arm, tmp_path, motion=QUICK, only=()):
    """Return the same of the arm, whose moves are short."""
    return judged_by_map(serving_app(arm.app()), motion, tmp_path, only=only)
