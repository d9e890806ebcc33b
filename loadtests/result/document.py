"""latency.json: everything that a run found out, whatever became of it."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

from conformance.contract.exit_codes import ExitCode
from loadtests.clients.library import LIBRARY
from loadtests.clients.payloads import CATALOGUE
from loadtests.measuring.environment import describe
from loadtests.result.files import FORMAT
from loadtests.schedule.arrivals import Schedule, arrivals_due
from loadtests.schedule.plan import GAP_S, step_operation
from loadtests.statistics import against, end_to_end, figures, steps, verdict
from loadtests.statistics.recorder import Recorder
from loadtests.statistics.third_way import other_ways

if TYPE_CHECKING:
    from loadtests.measuring.preflight import Findings
    from loadtests.result.outcome import Outcome, RunAborted
    from loadtests.schedule.plan import Plan
    from loadtests.settings.settings import Settings

CLIENT_WORDS = {
    "wire": "our own HTTP/1.1 client on gevent and llhttp, the same for both interfaces; requests built beforehand, "
    "each sent once",
    "zeep": "as an ordinary user's program calls: zeep over SOAP, the requests library over REST",
}


def compose(outcome: Outcome, plan: Plan, aborted: RunAborted | None) -> tuple[int, dict[str, Any]]:
    """Exit code and latency.json of a duel's plan, carried out or `aborted` before."""
    executor, settings = outcome.executor, outcome.settings
    recorder = executor.recorder if executor is not None else Recorder()
    measured = figures.Measured(plan, recorder)
    generator = _generator(outcome, measured)
    pacing = executor.pacing if executor else ""
    reasons, notes = ([str(aborted)], []) if aborted else verdict.invalid_because(generator, plan, pacing)
    reasons = _endings(outcome, plan) + reasons + outcome.invalid
    workers, losses = _workers(outcome, plan)
    judged = [] if aborted else verdict.judge(measured, settings.thresholds)
    noise_floor = figures.noise_floor(measured)
    compared = _against(outcome, measured, noise_floor)
    code = _code(outcome, aborted, reasons, judged, compared)
    document = {
        "format": FORMAT,
        "valid": not reasons,
        "invalid_because": reasons,
        "notes": outcome.notes + notes + losses,
        "interrupted": outcome.interrupted or outcome.dead_at is not None,
        "exit_code": code,
        "started": _stamp(outcome.started),
        "finished": _stamp(datetime.now(UTC)),
        "environment": describe(outcome.robots[0], settings.output, outcome.findings.servers),
        "plan": _plan_words(settings, plan, pacing),
        "generator": generator,
        "workers": workers,
        "series": figures.series(measured, outcome.findings.sizes),
        "comparisons": figures.comparisons(measured),
        "noise_floor": noise_floor,
        "other_ways": other_ways(measured),
        **_end_to_end(outcome),
        **({"against": compared} if compared else {}),
        "time_series": figures.time_series(measured),
        "steps": outcome.steps,
        "knee": _knee(outcome, plan),
        "knee_search": outcome.knee_searches,
        "over_connections": outcome.over_connections,
        "errors": figures.errors(recorder, plan.operations) + _early_errors(outcome.findings),
        "thresholds": judged,
    }
    return code, document


def _generator(outcome: Outcome, measured: figures.Measured) -> dict[str, Any]:
    plan = measured.plan
    asked = sum(arrivals_due(plan, outcome.elapsed_s, phase=phase) for phase in ("duel", "aa", "against"))
    elapsed_s = max(0.0, outcome.elapsed_s - plan.load.warmup_s)
    return verdict.generator_figures(measured, asked, elapsed_s, outcome.cpu_share)


def _endings(outcome: Outcome, plan: Plan) -> list[str]:
    """Why the plan was not carried out to its end."""
    found = []
    if outcome.dead_at is not None:
        found.append(f"no request succeeded from {outcome.dead_at:.1f} s on")
    if outcome.interrupted:
        found.append(f"interrupted after {outcome.elapsed_s:.1f} of {plan.length_s:.1f} s")
    return found


def _against(outcome: Outcome, measured: figures.Measured, noise_floor: list[dict[str, Any]]) -> dict[str, Any] | None:
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
    )
    return {"end_to_end": {"domain_id": settings.domain_id, "topic": outcome.robots[0].delivery_topic, "ways": ways}}


def _code(
    outcome: Outcome,
    aborted: RunAborted | None,
    reasons: list[str],
    judged: list[dict[str, Any]],
    compared: dict[str, Any] | None,
) -> int:
    if aborted is not None:
        return aborted.code
    if outcome.interrupted:
        return ExitCode.INTERRUPTED
    if reasons:
        return ExitCode.INCONCLUSIVE
    outcomes = {entry["outcome"] for entry in judged}
    following = against.code_of(compared)
    if "missed" in outcomes or following == ExitCode.FAILED:
        return ExitCode.FAILED
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


def _workers(outcome: Outcome, plan: Plan) -> tuple[list[dict[str, Any]], list[str]]:
    """The `workers`, and a sentence on each that was lost."""
    found, losses = [], []
    present = outcome.executor.members if outcome.executor else []
    for number, member in enumerate(present):
        missing = None
        if member.state == "lost":
            arrivals = ""
            if plan.open_model:
                schedule = Schedule(plan, number, len(present))
                share = sum(schedule.share(index) for index in range(schedule.count()))
                missing = max(0, share - member.accounted)
                arrivals = f", {missing} of its arrivals were never made or never reported"
            losses.append(
                f"worker {member.id} ({member.host}) was lost {member.lost_at_s or 0.0:.1f} s into the run: "
                f"{member.requests} of its requests are in the result{arrivals}"
            )
        found.append(
            {
                "id": member.id,
                "host": member.host,
                "pid": member.pid,
                "state": member.state,
                "requests": member.requests,
                "cpu_share": figures.rounded(member.cpu_share),
                "lost_at_s": figures.rounded(member.lost_at_s),
                "last_report_s": figures.rounded(member.last_report_s),
                "arrivals_lost": missing if member.state == "lost" else 0,
            }
        )
    return found, losses


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
        "zeep_rate": plan.rate_of(LIBRARY) if plan.open_model and LIBRARY in plan.clients else None,
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
