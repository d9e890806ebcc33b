"""The `workers` of latency.json, and remarks on those that did not do all of their share."""

from typing import Any

from loadtests.measuring.executor import Member
from loadtests.schedule.segment import GAP_S
from loadtests.statistics import figures


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
