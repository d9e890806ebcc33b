"""Requests that Schemathesis generates for each operation of a described API."""

from __future__ import annotations

import time
from contextlib import suppress
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any, Final

from conformance.api.rest.applicable import allows
from conformance.api.rest.inputs import Inputs
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.values import Values
from conformance.api.rest.variations import Kind, Variation
from conformance.documents.openapi import Operation, operations_of
from conformance.scenarios.drawing import SLOW_SHARE
from conformance.scenarios.scenario import NotPossibleError, PartialTraceError, scenario
from conformance.scenarios.stage import Leaves, Need, Stage
from conformance.scenarios.survey import BUDGETS, COVERAGE, FUZZED, Survey, Surveyor
from conformance.transport.exchange import NoAnswerError, NotPermittedError
from conformance.verdict.explorer import Explorer

if TYPE_CHECKING:
    from conformance.api.rest.generated import Target

# Share of a time limit after which generated requests end.
_GENERATED_SHARE: Final = 0.85


@scenario(needs={Need.REST}, leaves=Leaves.UNTOUCHED, stage=Stage.DESCRIBE)
def generated_requests(api: RestInterface, values: Values, explore: Explorer) -> Survey:
    """Send requests that Schemathesis generates for each operation."""
    # Imported late: that takes half a second.
    from conformance.api.rest.generated import NOT_GENERATED, targets  # noqa: PLC0415

    run = api.run
    operations = {
        item.label: item for item in operations_of(run.contract) if allows(api, item) and item.label not in api.streams
    }
    surveyor = Surveyor(api, values)
    for target in targets(run.contract):
        operation = operations.get(target.label)
        if operation is None:
            continue
        if run.limit.is_past(_GENERATED_SHARE):
            run.limit.shortened.add(target.label)
            continue
        try:
            _send_generated(surveyor, operation, target, explore)
        except NOT_GENERATED:
            continue
        except (NoAnswerError, NotPossibleError, NotPermittedError, PartialTraceError):
            raise
        except Exception as error:  # noqa: BLE001 - as in survey(): others are generated
            run.judge.fault(f"generated requests of {operation.label}", error)
    return Survey(tuple(surveyor.probes))


def _send_generated(surveyor: Surveyor, operation: Operation, target: Target, explore: Explorer) -> None:
    """Send the generated requests of one operation."""
    from conformance.api.rest.generated import NOT_GENERATED  # noqa: PLC0415 - see generated_requests()

    run = surveyor.api.run
    if operation.safe and not target.has_input:
        return  # there is only one such request, and the survey has sent it
    until = time.monotonic() + BUDGETS * run.effort.budget_s
    count = COVERAGE // (SLOW_SHARE if operation.label in surveyor.api.slow else 1)
    chosen = run.effort.draw_passing(target.covering(), count, f"{run.seed}/coverage {target.label}")
    run.tally.planned += len(chosen)
    for case in chosen:
        if time.monotonic() > until:
            surveyor.cut_short(f"generated requests of {target.label}")
            continue
        _send_case(surveyor, operation, case)
    if run.effort.name == "quick" or run.effort.slow or not target.has_input:
        return
    for negative in (True, False):
        with suppress(*NOT_GENERATED):
            explore(target.strategy(negative=negative), partial(_send_case, surveyor, operation), cases=FUZZED)


def _send_case(surveyor: Surveyor, operation: Operation, case: Any) -> None:
    """Send a case of Schemathesis, and record it."""
    from conformance.api.rest.generated import as_request, own_headers  # noqa: PLC0415 - see generated_requests()

    if surveyor.api.run.limit.is_past(_GENERATED_SHARE):
        surveyor.api.run.limit.shortened.add(operation.label)
        return
    request, headers = as_request(case), own_headers(case)
    if request is None or headers is None or operation.label in surveyor.given_up:
        return
    whole = replace(request, headers=(*headers, *request.headers))
    if whole not in surveyor.api.judged:
        whole = surveyor.reaching.complete(operation, whole)
        surveyor.send(operation, Variation(Kind.GENERATED, "", "", Inputs()), whole)
