"""The robot must reject invalid parameters, and requests without a required one."""

from collections.abc import Callable, Iterator
from functools import partial

import pytest

from conformance.api.rest.applicable import applicable_operations, readable
from conformance.api.rest.calls import JSON, XML, Call, example_call
from conformance.api.rest.inputs import Inputs
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.parameters import Wrong, wrong_texts
from conformance.api.rest.refusals import judge_refusal
from conformance.api.rest.statuses import is_taken
from conformance.documents.openapi import Operation, operations_of

pytestmark = pytest.mark.needs("rest")
_QUERY = "strict-input/query-parameter"
_MISSING = "strict-input/query-missing"
_PATH = "strict-input/path-parameter"
_PROBLEMS = ("http/problem-detail", "http/problem-value")
# Wrong texts of one operation at standard effort.
_STANDARD = 120


def _has(where: str, operation: Operation) -> bool:
    return any(wrong_texts(item) for item in operation.parameter(where))


@pytest.mark.phase("settling")
@pytest.mark.requirement(_QUERY, *_PROBLEMS, "rest-formats/problem-xml")
def test_query_parameters(api: RestInterface) -> None:
    """Send text, nothing, NaN, Infinity and 1e400 in place of a number in a query."""
    for call in _valid_calls(api, _QUERY, partial(_has, "query"), "takes numbers in its query"):
        chosen = _choose_wrong(api, call.operation, "query")
        for item in chosen:
            _try(api, call, item, _QUERY)
        for item in chosen[:1]:
            # The checkers judge the format of the refusal.
            call.having(item.name, item.text).send(api, ("Accept", XML))
    operations = operations_of(api.run.contract)
    if not any(JSON in item.bodies or _has("query", item) or _has("path", item) for item in operations):
        for id_ in _PROBLEMS:
            api.run.judge.note_unclaimed(id_, "the contract has no input in which a field could be wrong")


@pytest.mark.phase("settling")
@pytest.mark.requirement(_MISSING, "http/problem-detail")
def test_missing_query_parameters(api: RestInterface) -> None:
    """Leave out each required parameter of a query."""

    def has_required(operation: Operation) -> bool:
        return any(item.required for item in operation.parameter("query"))

    for call in _valid_calls(api, _MISSING, has_required, "requires a query parameter"):
        operation = call.operation
        for item in operation.parameter("query"):
            if item.required:
                lacking, what = call.having(item.name, None), f"no parameter {item.name}"
                judge_refusal(api, partial(lacking.send, api), _MISSING, what, field=item.name, json=False)
        bare = Call(operation, Inputs(path=call.inputs.path))
        judge_refusal(api, partial(bare.send, api), _MISSING, "no parameter at all", json=False)


@pytest.mark.phase("acting")
@pytest.mark.requirement(_PATH, *_PROBLEMS)
def test_path_parameters(api: RestInterface) -> None:
    """Send text, NaN, Infinity, 1e400 and values that are not allowed in a path."""
    for call in _valid_calls(api, _PATH, partial(_has, "path"), "takes numbers in its path"):
        for item in _choose_wrong(api, call.operation, "path"):
            # Two slashes in a row are another path, which servers may shorten.
            if item.text:
                _try(api, call, item, _PATH)
        if call.operation.motion:
            api.device.halt(api)


def _valid_calls(
    api: RestInterface, requirement: str, wanted: Callable[[Operation], bool], what: str
) -> Iterator[Call]:
    """Yield valid requests that the robot accepts, so that only a later change can be refused."""
    for operation in applicable_operations(api, [requirement], wanted, what):
        call = readable(api, operation) if operation.method == "GET" else example_call(api, operation)
        exchange = call.send(api)
        if is_taken(exchange):
            yield call
        else:
            reason = f"not tried on {operation.id}: a valid request for it got {exchange.came}"
            api.run.judge.skip(requirement, reason)


def _choose_wrong(api: RestInterface, operation: Operation, where: str) -> list[Wrong]:
    """Return invalid texts for parameters: at quick effort one of each kind and a few more."""
    wrong = [item for parameter in operation.parameter(where) for item in wrong_texts(parameter)]
    first: dict[str, Wrong] = {}
    for item in wrong:
        first.setdefault(item.text, item)
    named: dict[str, Wrong] = {}
    for item in wrong:
        named.setdefault(item.name, item)
    if api.run.effort.slow:
        return api.run.effort.alternatives(wrong, 6)
    basic = list(dict.fromkeys([*first.values(), *named.values()]))
    return list(dict.fromkeys(basic + api.run.effort.draw(wrong, _STANDARD, f"{api.run.seed}/{operation.id}")))


def _try(api: RestInterface, call: Call, item: Wrong, requirement: str) -> None:
    send = partial(call.having(item.name, item.text).send, api)
    refused = judge_refusal(api, send, requirement, item.what, field=item.name, shown=item.shown, json=False)
    if not refused and call.operation.motion:
        api.device.halt(api)
