"""Run ``roaas certify`` with a motion map on a simulated device, over HTTP."""

import gzip
import json
import sys
import tomllib

import msgspec
from arm import MAP
from processes import ended
from serving_apps import serving_app

from conformance.scenarios.stored import TRACES_NAME
from conformance.statement.motion_calls import written_out
from conformance.statement.motion_map import MotionMap

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
    judged = {one["id"]: one["verdict"] for one in result["requirements"] if one["id"].startswith("motion/")}
    stays_within(out, motion, judged)
    return done, judged


def stays_within(out, motion, judged):
    """Check that no reading of a run is beyond the limits of its map, if the run blames the device for nothing."""
    given = tomllib.loads(motion)
    if not {"fail", "warn"} & set(judged.values()) and (out / TRACES_NAME).exists():
        written = written_out(given["motion"], given.get("values", {}))
        assert places_beyond(out / TRACES_NAME, msgspec.convert(written, MotionMap)) == []


def places_beyond(traces, motion):
    """Return what the readings of a run have beyond the limits of the map, by axis, once they were within them.

    A device may begin beyond them, as one does that is homed.
    """
    whole = sorted(_readings(json.loads(gzip.decompress(traces.read_bytes()))), key=lambda reading: reading["sent"])
    assert any(reading["values"] for reading in whole) or not motion.state.axes, "a run whose telemetry shows nothing"
    found = []
    for name, axis in motion.state.axes.items():
        (least, most), room = axis.limits, motion.tolerance(name)
        places = [reading["values"][name] for reading in whole if reading["values"] and not axis.angle]
        begun = next((at for at, place in enumerate(places) if least <= place <= most), len(places))
        found += [(name, place) for place in places[begun:] if not least - room <= place <= most + room]
    return found


def _readings(value):
    """Yield the readings within traces, which are what has positions and a stamp."""
    parts = value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()
    if isinstance(value, dict) and {"values", "stamp"} <= value.keys():
        yield value
    else:
        for part in parts:
            yield from _readings(part)


def until(is_seen, run):
    """Return what the first run found in which everything was seen, or the last of several.

    A loaded machine may keep a run from seeing something, and never makes a right device fail.
    """
    found = run()
    for _ in range(RUNS - 1):
        if is_seen(*found):
            break
        found = run()
    return found


def passed_but(missing, judge):
    """Check that a right device passes all but what its map does not declare; return the last run's command."""
    passed = set()

    def run():
        done, judged = judge()
        assert judged, done.stdout + done.stderr
        assert not {"fail", "warn"} & set(judged.values()), done.stdout
        passed.update(id_ for id_, verdict in judged.items() if verdict == "pass")
        return done, {id_.removeprefix("motion/") for id_ in judged.keys() - passed}

    done, left = until(lambda _, left: left == missing, run)
    assert left == missing, done.stdout
    return done


def blamed_for(names, judge):
    """Check that a wrong device fails the requirements with these names, and that it is told."""
    ids = {f"motion/{name}" for name in names}
    done, judged = until(lambda _, judged: all(judged[id_] == "fail" for id_ in ids), judge)
    assert {id_: judged[id_] for id_ in ids} == dict.fromkeys(ids, "fail"), done.stdout


def of_arm(arm, tmp_path, motion=QUICK, only=()):
    """Return the same of the arm, whose moves are short."""
    return judged_by_map(serving_app(arm.app()), motion, tmp_path, only=only)
