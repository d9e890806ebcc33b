"""latency.json: everything that a run found out, whatever became of it."""

import os
from datetime import UTC, datetime
from typing import Any, NamedTuple

from conformance.commandline.exit_codes import ExitCode
from loadtests.clients.library import LIBRARY
from loadtests.clients.payloads import CATALOGUE
from loadtests.measuring.command_line import without_folders
from loadtests.measuring.end_to_end import LOST_S
from loadtests.measuring.environment import describe
from loadtests.measuring.machine import Moment, conditions
from loadtests.measuring.pauses import PAUSE_S
from loadtests.measuring.preflight import Findings
from loadtests.result.files import FORMAT
from loadtests.result.outcome import Outcome, RunAborted
from loadtests.result.processes import process_figures
from loadtests.schedule.arrivals import arrivals_due
from loadtests.schedule.plan import GAP_S, Plan, step_operation
from loadtests.settings.settings import Settings
from loadtests.statistics import against, end_to_end, figures, modes, over_time, steps, threshold, verdict
from loadtests.statistics.between_runs import between_runs
from loadtests.statistics.further_interfaces import further_interfaces
from loadtests.statistics.headline import headline
from loadtests.statistics.intervals import order_interval_ms
from loadtests.statistics.measured import Measured
from loadtests.statistics.recorder import Recorder

CLIENT_WORDS = {
    "wire": "our own HTTP/1.1 client on gevent and llhttp, the same for both interfaces; requests built beforehand, "
    "each sent once",
    "zeep": "as an ordinary user's program calls: zeep over SOAP, the requests library over REST",
}


def compose(outcome: Outcome, plan: Plan, aborted: RunAborted | None) -> tuple[int, dict[str, Any]]:
    """Exit code and latency.json of a duel's plan, carried out or `aborted` before."""
    executor, settings = outcome.executor, outcome.settings
    recorder = executor.recorder if executor is not None else Recorder()
    measured = Measured([carried.plan for carried in outcome.carried] or [plan], recorder)
    generator = _generator(outcome, measured)
    pacing = executor.pacing if executor else ""
    machine, spoilt = conditions(outcome.before, Moment.now())
    deviation = between_runs(machine, os.cpu_count() or 1, len(measured.plans))
    comparisons = figures.comparisons(measured, deviation)
    reasons, notes = ([str(aborted)], []) if aborted else verdict.invalid_because(generator, plan, pacing, spoilt)
    reasons = _endings(outcome, plan) + reasons + outcome.invalid
    undecided = [] if aborted or reasons else verdict.failures(generator) + verdict.says_nothing(comparisons)
    workers, losses = process_figures(outcome.executor.members if outcome.executor else [])
    judged = [] if aborted else threshold.judge(measured, settings.thresholds)
    noise_floor = figures.noise_floor(measured)
    compared = _against(outcome, measured, noise_floor)
    code = _code(outcome, aborted, Reasons(reasons, undecided), judged, compared)
    words = _plan_words(settings, plan, pacing)
    document = {
        "valid": not reasons and not undecided,
        "invalid_because": reasons + undecided,
        "notes": outcome.notes + notes + spoilt + losses,
        "interrupted": outcome.interrupted or outcome.dead_at is not None,
        "exit_code": code,
        "started": _stamp(outcome.started),
        "finished": _stamp(datetime.now(UTC)),
        "environment": describe(outcome.robots[0], settings.output, outcome.findings.servers, outcome.robot_process)
        | {"machine": machine},
        "plan": words,
        "generator": generator,
        "workers": workers,
        "series": [
            entry | {"after_pause": _after_pause(outcome, entry), "modes": modes.of_series(measured, entry)}
            for entry in figures.series(measured, outcome.findings.sizes)
        ],
        "comparisons": comparisons,
        "heat_map": modes.heat_map(measured),
        "noise_floor": noise_floor,
        "further_interfaces": further_interfaces(measured),
        **_end_to_end(outcome),
        **({"against": compared} if compared else {}),
        "time_series": over_time.time_series(measured),
        "blocks": over_time.blocks(measured),
        "steps": outcome.steps,
        "knee": _knee(outcome, plan),
        "knee_search": outcome.knee_searches,
        "over_connections": outcome.over_connections,
        "errors": over_time.errors(recorder, plan.operations) + _early_errors(outcome.findings),
        "thresholds": judged,
    }
    return code, {"format": FORMAT, "headline": headline(document, reasons, undecided)} | document


def _generator(outcome: Outcome, measured: Measured) -> dict[str, Any]:
    phases = ("duel", "aa", "against")
    asked, active_s = 0, 0.0
    for carried in outcome.carried:
        asked += sum(arrivals_due(carried.plan, carried.elapsed_s, phase=phase) for phase in phases)
        active_s += carried.plan.active_s(carried.elapsed_s, phases)
    return verdict.generator_figures(measured, asked, active_s, outcome.cpu_share)


def _after_pause(outcome: Outcome, entry: dict[str, Any]) -> dict[str, Any] | None:
    """What a series' requests cost after a pause, and behind one another; None where that was not measured."""
    paused = outcome.paused.get((entry["operation"], entry["interface"], entry["client"]))
    if paused is None:
        return None
    return {
        "pause_s": PAUSE_S,
        "spacing_s": figures.rounded(paused.spacing_s),
        "failed": paused.failed,
        "cold_count": paused.cold.total,
        "warm_count": paused.warm.total,
        "cold_ms": figures.plain_quantiles(paused.cold),
        "warm_ms": figures.plain_quantiles(paused.warm),
        "cold_ci95_ms": figures.rounded_interval(order_interval_ms(paused.cold, 0.5)),
        "warm_ci95_ms": figures.rounded_interval(order_interval_ms(paused.warm, 0.5)),
    }


def _endings(outcome: Outcome, plan: Plan) -> list[str]:
    """Why the plan was not carried out to its end."""
    found = []
    if outcome.dead_at is not None:
        found.append(f"no request succeeded from {outcome.dead_at:.1f} s on")
    if outcome.interrupted:
        done = sum(carried.elapsed_s for carried in outcome.carried)
        whole = outcome.settings.repeats.number * plan.length_s
        found.append(f"interrupted after {done:.1f} of {whole:.1f} s")
    return found


def _against(outcome: Outcome, measured: Measured, noise_floor: list[dict[str, Any]]) -> dict[str, Any] | None:
    """What became of the comparison with another robot, where there is one."""
    settings = outcome.settings.against
    if settings is None:
        return None
    other = outcome.robots[1]
    return {
        "robot": {"rest": other.rest, "publishers": other.publishers, "subscribers": other.subscribers}
    } | against.against(measured, noise_floor, settings.tolerance)


def _end_to_end(outcome: Outcome) -> dict[str, Any]:
    """The `end_to_end`, where deliveries were followed to the application."""
    settings, journeys = outcome.settings.end_to_end, outcome.journeys
    if settings is None or not journeys:
        return {}
    ways = end_to_end.ways(
        {way: one.to_application_ns for way, one in journeys.items()},
        {way: one.answer_ns for way, one in journeys.items()},
        {way: len(one.errors) for way, one in journeys.items()},
        int(LOST_S * 1e9),
    )
    return {"end_to_end": {"domain_id": settings.domain_id, "topic": outcome.robots[0].delivery_topic, "ways": ways}}


class Reasons(NamedTuple):
    """Why a run is not valid.

    Attributes:
        worthless: its figures say nothing about the robot.
        undecided: they do, and leave nothing to compare; a threshold that they miss is missed all the same.
    """

    worthless: list[str]
    undecided: list[str]


def _code(
    outcome: Outcome,
    aborted: RunAborted | None,
    reasons: Reasons,
    judged: list[dict[str, Any]],
    compared: dict[str, Any] | None,
) -> int:
    if aborted is not None:
        return aborted.code
    if outcome.interrupted:
        return ExitCode.INTERRUPTED
    if reasons.worthless:
        return ExitCode.INCONCLUSIVE
    outcomes = {entry["outcome"] for entry in judged}
    following = against.code_of(compared)
    if "missed" in outcomes or following == ExitCode.FAILED:
        return ExitCode.FAILED
    if reasons.undecided:
        return ExitCode.INCONCLUSIVE
    return ExitCode.INCONCLUSIVE if "inconclusive" in outcomes else following


def _early_errors(findings: Findings) -> list[dict[str, Any]]:
    """Calls that failed before the run."""
    return [
        figures.named(name)
        | {
            "phase": "preflight",
            "kind": failure.kind,
            "message": str(failure),
            "count": 1,
            "first_s": None,
            "last_s": None,
        }
        for name, failure in findings.failures.items()
    ]


def _knee(outcome: Outcome, plan: Plan) -> list[dict[str, Any]]:
    if not outcome.steps:
        return []
    operation = plan.operations[step_operation(plan.operations)]
    criterion = steps.Criterion.of(outcome.settings.thresholds, operation)
    return steps.knee(outcome.steps, plan.interfaces, criterion)


def _plan_words(settings: Settings, plan: Plan, pacing: str) -> dict[str, Any]:
    return {
        "model": "open" if plan.open_model else "closed",
        "arrivals": plan.load.arrivals if plan.open_model else None,
        "rate": plan.load.rate,
        "users": plan.load.users,
        "duration_s": plan.load.duration_s,
        "warmup_s": plan.load.warmup_s,
        "block_s": round(plan.block_s, 6),
        "gap_s": GAP_S,
        "blocks": plan.blocks,
        "seed": plan.load.seed,
        "timeout_s": plan.timeout_s,
        "operations": list(plan.operations),
        "interfaces": list(plan.interfaces),
        "clients": {name: CLIENT_WORDS[name] for name in plan.clients},
        "zeep_rate": plan.load.rate if plan.open_model and LIBRARY in plan.clients else None,
        "repeats": settings.repeats.number,
        "restart_command": without_folders(settings.repeats.restart_command or "") or None,
        "methods": {name: CATALOGUE[name].element for name in plan.operations},
        "processes": plan.workers,
        "connections": plan.connections,
        "pacing": pacing,
        "connection_steps": list(settings.steps.connections),
        "limits": {"max_rate": settings.limits.max_rate, "max_duration_s": settings.limits.max_duration_s},
        "step_rates": list(settings.steps.rates),
        "step_s": settings.steps.step_s if settings.steps.rates else None,
    }


def _stamp(moment: datetime) -> str:
    return moment.isoformat(timespec="milliseconds").replace("+00:00", "Z")
