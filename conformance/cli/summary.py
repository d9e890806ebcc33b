"""What ``roaas certify`` says at its end: classes, findings with a command to replay each, the verdict."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, Any

import click

from conformance.commandline.exit_codes import ExitCode
from conformance.commandline.terminal import inert

if TYPE_CHECKING:
    from conformance.engine.certification import Certification

_MARKS = {"pass": "pass", "fail": "FAIL", "inconclusive": "inconclusive", "not-claimed": "not claimed"}
_SHOWN_CURL = 1000


def print_summary(outcome: Certification) -> None:
    """Print a certification to stdout; that the robot was not reached, to stderr."""
    document = outcome.document
    if outcome.exit_code == ExitCode.UNREACHABLE:
        reasons = (item["reason"] for item in document["requirements"] if item["verdict"] == "error")
        click.echo(f"error: {inert(next(reasons, 'the robot could not be reached'))}", err=True)
        click.echo(f"result: {outcome.path}")
        return
    click.echo()
    for name, value in document["classes"].items():
        reason = document["class_reasons"].get(name, "")
        click.echo(f"  {name:<20} {_MARKS[value]:<13}{reason[:300]}".rstrip())
    for requirement in document["requirements"]:
        if requirement["verdict"] in {"fail", "warn"}:
            _print_finding(requirement)
    counts = Counter(requirement["verdict"] for requirement in document["requirements"])
    told = ", ".join(f"{count} {value}" for value, count in sorted(counts.items()))
    accepted = f", accepted by the baseline until {document['accepted_until']}" if "accepted_until" in document else ""
    click.echo(
        f"\n{document['verdict']}{accepted}: {told}; "
        f"{document['requests']} requests in {document['duration_s']:.1f} s, seed {document['seed']}"
    )
    click.echo(f"result: {outcome.path}")


def _print_finding(requirement: dict[str, Any]) -> None:
    verdict, level = requirement["verdict"].upper(), requirement["level"]
    click.echo(f"\n{verdict} {requirement['id']} ({level}, {requirement['source']})\n  {requirement['text']}")
    for failure in requirement["failures"]:
        click.echo(f"  expected: {inert(failure['expected'])}")
        click.echo(f"  found:    {inert(failure['message'])} (seen {failure['seen']}x)")
        if failure["request"]:
            click.echo(f"  replay:   {inert(failure['request']['curl'][:_SHOWN_CURL])}")
