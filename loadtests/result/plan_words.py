"""The `plan` of latency.json: what was to be sent, and when."""

from pathlib import Path
from typing import Any

from conformance.commandline.without_folders import without_folders
from loadtests.clients.library import LIBRARY
from loadtests.clients.payloads import CATALOGUE
from loadtests.schedule.plan import Plan
from loadtests.schedule.segment import GAP_S
from loadtests.settings.settings import Settings

CLIENT_WORDS = {
    "wire": "our own HTTP/1.1 client on gevent and llhttp, the same for both interfaces; requests are built "
    "beforehand and each is sent once",
    "zeep": "what an ordinary user's program calls: zeep over SOAP, the requests library over REST",
}
_SCENARIO = (
    "our own HTTP/1.1 client on gevent and llhttp; requests are built when the scenario sends them, each is sent once"
)


def plan_words(settings: Settings, plan: Plan, pacing: str, parts: int) -> dict[str, Any]:
    """Return the `plan` of latency.json; an undecided comparison had several parts of the plan's length."""
    load, after, called = plan.load, settings.steps, plan.offered("rest", "wire")
    return {
        "model": "open" if plan.open_model else "closed",
        "arrivals": load.arrivals if plan.open_model else None,
        "rate": load.rate,
        "users": load.users,
        "duration_s": load.duration_s * parts,
        "warmup_s": load.warmup_s,
        "block_s": round(plan.block_s, 6),
        "gap_s": 0.0 if plan.scenario else GAP_S,
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
        "connection_steps": list(after.connections),
        "limits": {"max_rate": settings.limits.max_rate, "max_duration_s": settings.limits.max_duration_s},
        "step_rates": list(after.rates),
        "step_s": after.step_s if after.rates else None,
    }
