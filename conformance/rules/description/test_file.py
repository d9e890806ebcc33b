"""The description itself: valid, with references that resolve, distinct operations and fitting examples."""

from __future__ import annotations

import pytest

from conformance.documents import description_faults as faults
from conformance.documents.description_faults import without_large
from conformance.verdict.evidence import Judge
from conformance.verdict.run import Run

pytestmark = pytest.mark.phase("describe")
_SHOWN = 8


def _tell(judge: Judge, requirement: str, found: list[str], expected: str) -> None:
    """Record whether a description has no fault of one kind; several faults are one finding with a list."""
    more = f", and {len(found) - _SHOWN} more" if len(found) > _SHOWN else ""
    observed = "; ".join(found[:_SHOWN]) + more
    judge.check(requirement, not found, None, expected, found=observed, subject="the description")


@pytest.mark.requirement("description/file-valid")
def test_valid(run: Run, judge: Judge) -> None:
    """Validate the description by the schema of its version, and its own schemas by JSON Schema."""
    found = faults.invalid(without_large(run.contract.original))
    _tell(judge, "description/file-valid", found, "a valid description")


@pytest.mark.requirement("description/references")
def test_references(run: Run, judge: Judge) -> None:
    """Follow every reference."""
    _tell(judge, "description/references", list(run.contract.dead_references), "references that lead to something")


@pytest.mark.requirement("description/ids-unique")
def test_ids(run: Run, judge: Judge) -> None:
    """Look for an operationId that several operations have."""
    _tell(judge, "description/ids-unique", faults.repeated_ids(run.contract.openapi), "each operationId once")


@pytest.mark.requirement("description/paths-distinct")
def test_paths(run: Run, judge: Judge) -> None:
    """Look for two templates of one path."""
    expected = "path templates that differ in more than the names of parameters"
    _tell(judge, "description/paths-distinct", faults.alike_paths(run.contract.openapi), expected)


@pytest.mark.requirement("description/file-examples")
def test_examples(run: Run, judge: Judge) -> None:
    """Validate examples and defaults by the schemas beside them."""
    found = faults.unfitting_examples(run.contract.openapi)
    _tell(judge, "description/file-examples", found, "examples and defaults that are valid by their schemas")
