"""Answer the first four questions on a device's motion by a run's traces, each with a figure and a picture."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any, Final

from conformance.contract.described import MOTION
from conformance.measures.samples import SEVERAL, Sample, slope
from conformance.scenarios.motion.attempts import attempts_at_rest
from conformance.scenarios.motion.measuring import end_of_travel, speed_in
from conformance.scenarios.motion.moves import clamped_targets, stops, targets
from conformance.scenarios.motion.trace import Drive, Leg, Quiet, Reading
from conformance.scenarios.motion.velocities import WAYS, clamped_velocities, let_go, velocities
from conformance.scenarios.scenario import Recordings, Scenario
from conformance.statement.motion_map import MotionMap
from conformance.verdict.finding import count_of
from conformance.verdict.verdicts import Value, Verdict

#: The requirements that answer each question.
QUESTIONS: Final[dict[str, tuple[str, ...]]] = {
    "Does it move as told?": ("velocity", "reaches", "stays", "last-of-many", "new-target", "one-client"),
    "Does it stop when told?": ("velocity-stop", "stop", "stop-lasts"),
    "Does it stop when its client vanishes?": ("watchdog",),
    "Does it refuse what is beyond its limits?": ("beyond-limits", "refused-still"),
}
_BROKEN: Final = frozenset({"fail", "warn"})
_DRIVES_ON: Final = 0.5  # a released device that still has this share of its velocity drives on
_LONG: Final = 240  # longest answer, characters
_ENDS: Final = "it is sent to positions, and each move ends at its target"
_NO_LIMITS: Final = "no limits are declared that are refused"


def answers(motion: MotionMap | None, verdicts: Iterable[Verdict], recordings: Recordings) -> list[dict[str, str]]:
    """Return question, answer ("yes", "no" or "not seen"), figure and picture of each; empty without a map.

    The picture is what ``reports`` calls the drive or move: its name in the traces.
    """
    judged = {
        verdict.requirement.id.removeprefix(f"{MOTION}/"): verdict
        for verdict in verdicts
        if verdict.requirement.class_ == MOTION
    }
    if motion is None or all(verdict.value is Value.NOT_CLAIMED for verdict in judged.values()):
        return []
    figures = (_moves, _stops, _vanishes, _refuses)
    found = []
    for (question, ids), figure in zip(QUESTIONS.items(), figures, strict=True):
        own = [judged[id_] for id_ in ids if id_ in judged]
        value = _answer(own)
        said, picture = figure(motion, recordings)
        if value == "yes" and said == _NO_LIMITS:
            value = "not seen"
        if value == "no":
            said, picture = _fault(own, picture)
        elif value == "not seen" and said.startswith("no: "):
            value, said = "no", said.removeprefix("no: ")
        elif value == "not seen" and said not in {_NO_LIMITS, _ENDS}:
            # A requirement that could not be tried says more than one that the map does not declare.
            # Of a device that is sent to positions, what is said of velocities does not matter.
            of_velocity = motion.velocity is None
            tried = sorted(
                own,
                key=lambda verdict: (
                    verdict.value is Value.NOT_CLAIMED,
                    of_velocity and "velocity" in verdict.requirement.id,
                ),
            )
            said = next((verdict.reason for verdict in tried if verdict.reason), "") or said or "nothing was tried"
        found.append({"question": question, "answer": value, "figure": said[:_LONG], "picture": picture})
    return found


def _answer(verdicts: Sequence[Verdict]) -> str:
    values = {verdict.value for verdict in verdicts}
    return "no" if values & _BROKEN else "yes" if "pass" in values else "not seen"


def _fault(verdicts: Sequence[Verdict], picture: str) -> tuple[str, str]:
    """Return the first finding's expected and observed texts, and its picture."""
    findings = [finding for item in verdicts if item.value in _BROKEN for finding in item.evidence.findings.values()]
    if not findings:
        return "", picture
    said = f"{findings[0].observed}; expected {findings[0].expected}"
    named = findings[0].expected.rpartition("(")[2].rstrip(")")
    return said, named or picture


def _parts(recordings: Recordings, *scenarios: Scenario) -> Iterator[Any]:
    for scenario in scenarios:
        recording = recordings.played.get(scenario.name)
        trace = recording.trace if recording else None
        yield from trace if isinstance(trace, tuple) else [trace] if trace is not None else []


def _drives(recordings: Recordings, *scenarios: Scenario) -> list[Drive]:
    return [drive for drive in _parts(recordings, *scenarios) if isinstance(drive, Drive)]


def _moves(motion: MotionMap, recordings: Recordings) -> tuple[str, str]:
    """Return how far the velocities, or the targets, were off at most."""
    worst: tuple[float, str, str] | None = None
    count, drives = 0, _drives(recordings, velocities)
    so_far = [reading for drive in drives for reading in drive.readings]
    for drive in drives:
        begun = drive.settled_at(motion.velocity.settle_s if motion.velocity else 0.0)
        seen = [reading for reading in drive.under_way if reading.sent >= begun]
        for name, wanted in drive.wanted.items():
            found = speed_in(seen, name, motion) if wanted else None
            # The rule does not judge a drive that ended at an end of travel either.
            if found is not None and end_of_travel(drive.under_way, name, wanted, motion, so_far) is None:
                count += 1
                said = f"{name} {found:.3g} in place of {wanted:.3g} per second"
                worst = max(worst or (-1.0, "", ""), (abs(found - wanted), said, drive.what))
    if worst:
        many = "velocity" if count == 1 else "velocities"
        return f"{worst[1]} is the farthest off of {count} {many}", worst[2]
    for leg in (one for one in _parts(recordings, targets) if isinstance(one, Leg) and one.readings):
        goal, last = leg.commands[-1].targets, leg.after(0.0)[-1:]
        for name, wanted in goal.items() if last else ():
            count += 1
            off = abs(motion.state.axes[name].apart(last[0].values[name], wanted))
            worst = max(
                worst or (-1.0, "", ""), (off, f"{name} {last[0].values[name]:.3g} in place of {wanted:.3g}", leg.what)
            )
    return (f"{worst[1]} is the farthest off of {count_of(count, 'target')}", worst[2]) if worst else ("", "")


def _stops(motion: MotionMap, recordings: Recordings) -> tuple[str, str]:
    """Return how long a device took to rest at most."""
    ended = [(drive, drive.end) for drive in _drives(recordings, velocities) if drive.end is not None]
    took = [(took_s, one.what) for one, end in ended if (took_s := _rested_s(one, end.answered, motion)) is not None]
    if took:
        longest, what = max(took)
        return (
            f"it went on for {max(0.0, longest):.2f} s after velocity 0 at most, in {count_of(len(took), 'drive')}",
            what,
        )
    stopped = [leg for leg in _parts(recordings, stops) if isinstance(leg, Leg)]
    return (f"stopped under way {count_of(len(stopped), 'time')}", stopped[0].what) if stopped else ("", "")


def _vanishes(motion: MotionMap, recordings: Recordings) -> tuple[str, str]:
    """Return how long a device went on after its last command, by how its client vanished."""
    if motion.velocity is None:
        return _ENDS, ""
    said, on, picture = dict.fromkeys(WAYS, -1.0), "", ""
    for drive in _drives(recordings, let_go):
        way = next((one for one in WAYS if drive.what.endswith(one)), "")
        took_s = _rested_s(drive, drive.commands[-1].answered, motion)
        picture = picture or drive.what
        lapse_s = drive.after[-1].received - drive.commands[-1].answered if drive.after else 0.0
        if _drives_on(drive, motion):
            gone = way.removeprefix("and the ") or "it was let go"
            on, picture = on or f"no: it still drove {lapse_s:.1f} s later when {gone}", drive.what
        elif took_s is not None and way:
            said[way] = max(0.0, took_s, said[way])
    if on:
        return on, picture
    seen = [f"{took_s:.2f} s ({way.removeprefix('and ')})" for way, took_s in said.items() if took_s >= 0]
    return f"it went on for at most {', '.join(seen)}" if seen else "", picture


def _drives_on(drive: Drive, motion: MotionMap) -> bool:
    """Return whether the last readings of a drive show it at half of its velocity or more."""
    last = list(drive.after)[-2 * SEVERAL - 1 :]
    for name, wanted in drive.wanted.items():
        found = speed_in(last, name, motion) if wanted else None
        if found is not None and found * wanted > 0 and abs(found) >= _DRIVES_ON * abs(wanted):
            return True
    return False


def _rested_s(drive: Drive, since: float, motion: MotionMap) -> float | None:
    """Return how long after a moment a device came to rest, s, by its remaining way; None if that was not seen."""
    name = max(drive.wanted, key=lambda text: abs(drive.wanted[text]), default="")
    speed = motion.velocity.axes.get(name) if motion.velocity else None
    if speed is None or not drive.under_way or len(drive.after) < SEVERAL:
        return None
    if not speed.of:
        moving = [
            reading.received
            for reading in drive.after
            if abs(reading.speeds.get(name, 0.0)) > _DRIVES_ON * abs(drive.wanted[name])
        ]
        # Nobody looks while a client is silent: then it rested when it was seen next.
        return (max(moving) if moving else drive.after[0].sent) - since
    under_way, after = _samples(drive.under_way, speed.of), _samples(drive.after, speed.of)
    rate = slope(under_way[len(under_way) // 2 :])
    if not rate or len(after) < SEVERAL:
        return None
    end = sorted(value for _, value in after[-SEVERAL:])[SEVERAL // 2]
    # Use the middle of the last readings while moving, because a single one has noise.
    there = sorted(under_way[-SEVERAL:], key=lambda pair: pair[1])[SEVERAL // 2]
    return there[0] + (end - there[1]) / rate - since


def _samples(readings: Sequence[Reading], axis: str) -> list[Sample]:
    return [((reading.sent + reading.received) / 2, reading.values[axis]) for reading in readings if reading.values]


def _refuses(_motion: MotionMap, recordings: Recordings) -> tuple[str, str]:
    """Return how many targets and velocities beyond the limits were refused."""
    tried = [
        attempt
        for quiet in _parts(recordings, attempts_at_rest)
        if isinstance(quiet, Quiet)
        for attempt in quiet.tried
        if attempt.kind == "beyond" and attempt.exchange is not None
    ]
    if not tried:
        clamped = next(_parts(recordings, clamped_targets, clamped_velocities), None)
        return ("they are clamped" if clamped else _NO_LIMITS), ""
    refused = sum(not attempt.exchange.response.ok for attempt in tried if attempt.exchange)
    return f"{refused} of {len(tried)} beyond the limits were refused, the first {tried[0].what}", ""
