"""latency.json: everything that a run found out, however the run ended."""

import os
from datetime import datetime
from pathlib import Path
from typing import Any, NamedTuple

import msgspec

from conformance.commandline.exit_codes import ExitCode
from conformance.commandline.out_folder import without_folders
from conformance.commandline.secrecy import SECRETS
from loadtests.clients.payloads import CATALOGUE, LIBRARY
from loadtests.measuring.executor import Member
from loadtests.measuring.machine import Moment, busy_text, conditions
from loadtests.measuring.preflight import Findings
from loadtests.measuring.robot_process import describe, same_machine
from loadtests.measuring.streams import stream_figures
from loadtests.result.files import FORMAT
from loadtests.result.outcome import Outcome, RunAborted
from loadtests.schedule.plan import GAP_S, Plan
from loadtests.settings.settings import Settings
from loadtests.statistics import counts, figures, modes, over_time, service_levels
from loadtests.statistics.against import EXIT_CODES, Against, against
from loadtests.statistics.comparisons import AaControl, aa_controls, further_interfaces, soap_over_rest
from loadtests.statistics.headline import Found, failures, generator_figures, headline, invalid_because, says_nothing
from loadtests.statistics.measured import Measured
from loadtests.statistics.over_time import stage_figures
from loadtests.statistics.overload import overload
from loadtests.statistics.recorder import SHARED, Recorder
from loadtests.statistics.rounds import between_runs

CLIENT_WORDS = {
    "wire": "our own HTTP/1.1 client on gevent and llhttp, the same for both interfaces; requests are built "
    "beforehand and each is sent once",
    "zeep": "what an ordinary user's program calls: zeep over SOAP, the requests library over REST",
}
_SCENARIO = (
    "our own HTTP/1.1 client on gevent and llhttp; requests are built when the scenario sends them, each is sent once"
)


def process_figures(members: list[Member]) -> tuple[list[dict[str, Any]], list[str]]:
    """Return an entry for each process, and remarks on those that did not do their share."""
    found, remarks = [], []
    for member in members:
        lost = member.state == "lost"
        missing = 0 if not lost else None if member.share is None else max(0, member.share - member.accounted)
        remarks += _remarks(member, missing)
        found.append(
            {
                "id": member.id,
                "host": member.host,
                "pid": member.pid,
                "state": member.state,
                "requests": member.requests,
                "cpu_share": figures.rounded(member.cpu_share),
                "joined_at_s": figures.rounded(member.joined_at_s),
                "lost_at_s": figures.rounded(member.lost_at_s),
                "last_report_s": figures.rounded(member.last_report_s),
                "arrivals_lost": missing,
                "clock": member.clock.figures() if member.clock is not None else None,
            }
        )
    return found, remarks


def _remarks(member: Member, missing: int | None) -> list[str]:
    """Return remarks on one process."""
    name, said = f"worker {member.id} ({member.host})", []
    if member.state == "lost":
        arrivals = "" if missing is None else f", {missing} of its arrivals were not sent or not reported"
        said.append(
            f"{name} was lost {member.lost_at_s or 0.0:.1f} s into the run: "
            f"{member.requests} of its requests are in the result{arrivals}"
        )
    if member.state == "late":
        said.append(
            f"{name} joined {member.joined_at_s or 0.0:.1f} s into the run, after the schedule had been distributed: "
            "it took no part"
        )
    clock = member.clock
    if clock is not None and not clock.shared and clock.uncertainty_ns > GAP_S * 1e9:
        said.append(
            f"{name}: its clock is known to {clock.uncertainty_ns / 1e6:.1f} ms only, more than the gap of "
            f"{GAP_S * 1e3:g} ms between blocks, so that it may still send over one interface while others "
            "send over the next"
        )
    return said


def plan_words(settings: Settings, plan: Plan, pacing: str, parts: int) -> dict[str, Any]:
    """Return the `plan` of latency.json; an undecided comparison had several parts of the plan's length."""
    load, after, called = plan.load, settings.steps, plan.choices("rest", "wire")
    return {
        "model": "open" if plan.open_model else "closed",
        "arrivals": load.arrivals if plan.open_model else None,
        "rate": load.rate,
        "stages": [[rate, seconds] for rate, seconds in load.stages],
        "users": load.users,
        "duration_s": load.duration_s * parts,
        "warmup_s": load.warmup_s,
        "block_s": round(plan.block_s, 6),
        "gap_s": 0.0 if plan.scenario or plan.alone else GAP_S,
        "blocks": plan.blocks * parts,
        "seed": load.seed,
        "timeout_s": plan.timeout_s,
        "operations": [plan.operations[number] for number in called] if plan.scenario else list(plan.operations),
        "interfaces": list(plan.interfaces),
        "clients": {name: _SCENARIO if plan.scenario else CLIENT_WORDS[name] for name in plan.clients},
        "zeep_rate": load.rate if plan.open_model and LIBRARY in plan.clients else None,
        "repeats": settings.repeats.number,
        "restart_command": without_folders(settings.repeats.restart_command or "") or None,
        "methods": {
            name: CATALOGUE[name].element for name in plan.operations if not settings.description and name in CATALOGUE
        },
        "weights": dict(zip(plan.operations, plan.weights, strict=True)) if plan.weights else {},
        "description": settings.description and without_folders(settings.description),
        "scenario": settings.scenario
        and {"file": Path(settings.scenario.file).name, "sha256": settings.scenario.sha256},
        "processes": plan.workers,
        "connections": plan.connections,
        "pacing": pacing,
        "limits": {"max_rate": settings.limits.max_rate, "max_duration_s": settings.limits.max_duration_s},
        "step_s": after.step_s if after.has_searches else None,
    }


def compose(outcome: Outcome, plan: Plan, aborted: RunAborted | None) -> tuple[int, dict[str, Any]]:
    """Return the exit code and latency.json of a run.

    Args:
        outcome: the results of the run.
        plan: the plan of the comparison, for a run that was aborted before.
        aborted: why the run ended before it measured, or None.
    """
    executor, settings = outcome.executor, outcome.settings
    recorder = executor.recorder if executor else Recorder()
    measured = Measured([carried.plan for carried in outcome.carried] or [plan], recorder)
    generator = generator_figures(measured, outcome.cpu_share)
    counted = counts.counts(measured, ((one.plan, one.elapsed_s) for one in outcome.carried))
    pacing = executor.pacing if executor else ""
    machine, spoilt = conditions(outcome.before, Moment.now())
    deviation = between_runs(outcome.before.load, len(measured.repeats))
    comparisons = soap_over_rest(measured, deviation)
    reasons, notes = ([str(aborted)], []) if aborted else invalid_because(generator, counted, plan, pacing, spoilt)
    stopped = _silence(outcome, counted, plan.timeout_s)
    reasons = [stopped] if stopped else _endings(outcome, plan) + reasons + outcome.invalid
    overloaded = None if aborted or reasons or outcome.interrupted else overload(measured, counted)
    undecided = (
        []
        if aborted or reasons
        else [overloaded.sentence()]
        if overloaded
        else [*_why_undecided(settings, counted), *says_nothing(comparisons), *_silent(outcome)]
    )
    workers, losses = process_figures(executor.members if executor else [])
    controls = aa_controls(measured)
    compared = _against(outcome, measured, controls, deviation)
    levels = [] if aborted else service_levels.levels(measured, settings.slo)
    kept = [level.outcome for level in levels]
    code = _code(outcome, aborted, Reasons(reasons, undecided), kept, compared)
    series = figures.series(measured, outcome.findings.sizes)
    for entry in series:
        entry.modes = modes.modes(measured.total(entry.name, "duel").service)
    grown = over_time.add_growth(measured, series)
    grown = [] if overloaded else grown  # its queue grows, and the headline says so
    found = Found(
        measured.plan,
        settings.limits.max_rate,
        series,
        comparisons,
        compared,
        reasons,
        undecided,
        kept,
        overloaded,
        outcome.knee_searches,
        interrupted=outcome.interrupted and len(reasons) == 1 and bool(counted.answered),
        stopped=stopped,
        busy=busy_text(machine, os.cpu_count() or 1),
    )
    document = {
        "format": FORMAT,
        "headline": headline(found),
        "valid": not reasons and not undecided,
        "trustworthy": not reasons,
        "invalid_because": reasons + undecided,
        "notes": [*settings.notes, *outcome.notes, *notes, *grown, *spoilt, *losses, *SECRETS.notes],
        "interrupted": outcome.interrupted or outcome.dead_at is not None,
        "exit_code": code,
        "started": _stamp(outcome.started.at),
        "finished": _stamp(outcome.started.now),
        "environment": describe(outcome.robots[0], settings.output, outcome.findings.servers, outcome.robot_process)
        | {"machine": machine},
        "plan": plan_words(settings, plan, pacing, 1 + max(one.part for one in measured.plans)),
        "counts": counted,
        "overload": overloaded,
        "generator": generator,
        "workers": workers,
        "stages": stage_figures(measured),
        "series": series,
        "comparisons": comparisons,
        "heat_map": modes.heat_map(measured),
        "noise_floor": controls,
        "further_interfaces": further_interfaces(measured),
        "streams": _streams(outcome),
        **({"against": compared} if compared else {}),
        "time_series": over_time.time_series(measured),
        "blocks": over_time.blocks(measured),
        "knee_search": outcome.knee_searches,
        "errors": over_time.errors(recorder, plan.operations) + _early_errors(outcome.findings),
        "slo": levels,
    }
    builtins: dict[str, Any] = msgspec.to_builtins(document)
    return code, builtins


def _why_undecided(settings: Settings, counted: counts.Counts) -> list[str]:
    """Return why failed requests leave nothing to compare, unless a service level judges those of each operation."""
    levels = [settings.slo.get(name) for name in settings.selection.operations]
    judged = all(level is not None and level.error_rate is not None for level in levels)
    return [] if judged else failures(counted)


def _silence(outcome: Outcome, counted: counts.Counts, timeout_s: float) -> str:
    """Return from when on the robot answered nothing, and whether the load may be why; empty if it went on."""
    if outcome.dead_at is None:
        return ""
    said = f"no request succeeded from {outcome.dead_at:.1f} s on"
    if next(iter(counted.failed), "") != "timeout" or counted.asked_rate is None:
        return said
    return (
        f"{said}; they took over {timeout_s:g} s: a lower --rate shows whether {counted.asked_rate:,.0f}/s was too much"
    )


def _endings(outcome: Outcome, plan: Plan) -> list[str]:
    """Return why the plan was not carried out to its end."""
    faults = outcome.executor.recorder.faults if outcome.executor else []
    found = [f"the scenario failed: {fault}" for fault in faults]
    if outcome.interrupted:
        done = sum(carried.elapsed_s for carried in outcome.carried)
        begun_s = sum(carried.plan.length_s for carried in outcome.carried)
        whole = max(begun_s, outcome.settings.repeats.number * plan.length_s)
        found.append(f"interrupted after {done:.1f} of {whole:.1f} s")
    return found


def _against(outcome: Outcome, measured: Measured, controls: list[AaControl], deviation: float) -> Against | None:
    """Return the comparison with another robot, or None if the run had only one."""
    settings = outcome.settings.against
    if settings is None:
        return None
    other = outcome.robots[1].addresses_by_name
    return against(measured, controls, settings.tolerance, len(settings.looks), other, deviation)


def _streams(outcome: Outcome) -> list[dict[str, Any]]:
    """Return the `streams` of the result: each stream's messages, and the polled responses beside them."""
    here, found = same_machine(outcome.robots[0]), []
    for message in outcome.heard:
        offset = None if message.clock is None else SHARED if here else message.clock.offset
        clock = "not known" if offset is None else "shared" if here else "estimated"
        figures_of = stream_figures(message.moments_ns, message.ages_ms, message.listened_s, offset)
        found.append({"name": message.name, "kind": message.kind, "clock": clock, "error": message.error} | figures_of)
    return found


def _silent(outcome: Outcome) -> list[str]:
    """Return which streams could not be listened to for the whole time."""
    return [f"{message.name} ({message.kind}): {message.error}" for message in outcome.heard if message.error]


class Reasons(NamedTuple):
    """Why a run is not valid.

    Attributes:
        worthless: its figures say nothing about the robot.
        undecided: they leave nothing to compare; a service level that they break is broken all the same.
    """

    worthless: list[str]
    undecided: list[str]


def _code(
    outcome: Outcome, aborted: RunAborted | None, reasons: Reasons, outcomes: list[str], compared: Against | None
) -> int:
    if aborted is not None:
        return aborted.code
    if outcome.interrupted:
        return ExitCode.INTERRUPTED
    if reasons.worthless:
        return ExitCode.INCONCLUSIVE
    following = ExitCode.PASSED if compared is None else EXIT_CODES[compared.verdict]
    if service_levels.BROKEN in outcomes or following == ExitCode.FAILED:
        return ExitCode.FAILED
    unknown = service_levels.NOT_KNOWN in outcomes
    return ExitCode.INCONCLUSIVE if reasons.undecided or unknown else following


def _early_errors(findings: Findings) -> list[dict[str, Any]]:
    """Return the calls that failed before the run."""
    return [
        figures.name_fields(name)
        | {"phase": "preflight", "kind": failure.kind, "message": str(failure)}
        | {"count": 1, "first_s": None, "last_s": None}
        for name, failure in findings.failures.items()
    ]


def _stamp(moment: datetime) -> str:
    return moment.isoformat(timespec="milliseconds").replace("+00:00", "Z")
