"""Write the certificate as Markdown of limited size, for a pull request or the summary of a CI job.

GitHub drops a job summary of more than 1 MiB, so without a limit a run with many failures would show nothing.
"""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from reports.certificate.page import page_values
from reports.findings import QUESTIONS, findings
from reports.pages.page import markdown_page

MOST_OCTETS = 512 * 1024
"""Limit for the details of single requirements; the number of verdicts, classes and reasons is limited as well."""
_MOST_SHOWN = 30
_MOST_NAMED = 500
_MOST_GROUPS = 30
_LIMITS = {"in_full": 10, "most_named": _MOST_NAMED}
_HEADINGS = {"fail": "What failed", "warn": "Warnings"}


class _Part(NamedTuple):
    """The requirements of one verdict: Markdown blocks of those with details, and the rest, listed by id only."""

    heading: str
    in_full: Sequence[str]
    rest: Sequence[Mapping[str, Any]]


def certificate_markdown(result: Mapping[str, Any]) -> str:
    """Return a valid `roaas-result/1` document as a Markdown certificate of less than 1 MiB."""
    values = page_values(result)
    parts, left = [], MOST_OCTETS
    for verdict, heading in _HEADINGS.items():
        found = sorted(values["certificate"].with_verdict(verdict), key=lambda r: (_topic(r), _urgency(r)))
        in_full: list[str] = []
        for requirement in found[:_MOST_SHOWN]:
            block = markdown_page("requirement.md.j2", r=requirement, found=findings([requirement], result), **_LIMITS)
            left -= len(block.encode())
            if left < 0:
                break
            in_full.append(block)
        if found:
            parts.append(_Part(heading, in_full, found[len(in_full) :]))
    return markdown_page("certificate.md.j2", parts=parts, most_named=_MOST_NAMED, most_groups=_MOST_GROUPS, **values)


def _topic(requirement: Mapping[str, Any]) -> int:
    """Return the place of the requirement's topic among all topics; -1 before contract 1.2."""
    return list(QUESTIONS).index(requirement["topic"]) if "topic" in requirement else -1


def _urgency(requirement: Mapping[str, Any]) -> int:
    """Return the lowest number of the requirement's findings, or 0; a vendor should look at number 1 first."""
    return min((failure.get("number", 0) for failure in requirement["failures"]), default=0)
