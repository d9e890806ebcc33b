"""Parameters that break the contract are refused, and so is leaving out those that are required."""

from functools import partial

import pytest

from conformance.documents.openapi import Operation
from conformance.rest.applicable import applicable_operations, readable
from conformance.rest.calls import Call, example_call
from conformance.rest.interface import RestInterface
from conformance.rest.parameters import Wrong, wrong_texts
from conformance.rest.refusals import judge_refusal
from conformance.robot.stopping import stop_robot
from conformance.verdict.evidence import Judge

pytestmark = pytest.mark.needs("rest")
_QUERY = "strict-input/query-parameter"
_MISSING = "strict-input/query-missing"
_PATH = "strict-input/path-parameter"


def _has(where: str, operation: Operation) -> bool:
    return any(wrong_texts(item) for item in operation.parameter(where))


@pytest.mark.phase("reading")
@pytest.mark.requirement(_QUERY, "http/problem-detail", "http/problem-value")
def test_query_parameters(api: RestInterface, judge: Judge) -> None:
    """Text, nothing, NaN, Infinity and 1e400 are refused where a number belongs."""
    for operation in applicable_operations(api, [_QUERY], partial(_has, "query"), "takes numbers in its query"):
        call = _valid_call(api, operation)
        if not _valid(api, judge, call, _QUERY):
            continue
        wrong = [item for parameter in operation.parameter("query") for item in wrong_texts(parameter)]
        for item in _chosen(api, wrong, 120, operation):
            _try(api, call, item, _QUERY)


@pytest.mark.phase("reading")
@pytest.mark.requirement(_MISSING, "http/problem-detail")
def test_missing_query_parameters(api: RestInterface, judge: Judge) -> None:
    """Each required parameter is missed when it is left out."""

    def required(operation: Operation) -> bool:
        return any(item.required for item in operation.parameter("query"))

    for operation in applicable_operations(api, [_MISSING], required, "requires a query parameter"):
        call = _valid_call(api, operation)
        if not _valid(api, judge, call, _MISSING):
            continue
        bare = Call(operation, {item.name: call.values[item.name] for item in operation.parameter("path")})
        for item in operation.parameter("query"):
            if item.required:
                lacking = call.having(item.name, None)
                judge_refusal(
                    api, partial(lacking.send, api), _MISSING, f"no parameter {item.name}", field=item.name, json=False
                )
        judge_refusal(api, partial(bare.send, api), _MISSING, "no parameter at all", json=False)


@pytest.mark.phase("delivery")
@pytest.mark.requirement(_PATH, "http/problem-detail", "http/problem-value")
def test_path_parameters(api: RestInterface, judge: Judge) -> None:
    """Text, nothing, NaN, Infinity, 1e400 and values not enumerated are refused in a path."""
    for operation in applicable_operations(api, [_PATH], partial(_has, "path"), "takes numbers in its path"):
        call = example_call(api, operation)
        if not _valid(api, judge, call, _PATH):
            continue
        wrong = [item for parameter in operation.parameter("path") for item in wrong_texts(parameter)]
        for item in _chosen(api, wrong, 120, operation):
            if not item.text:
                continue  # two slashes in a row are another path, which servers may shorten
            _try(api, call, item, _PATH)
        if operation.motion:
            stop_robot(api)


def _valid_call(api: RestInterface, operation: Operation) -> Call:
    return readable(api, operation) if operation.method == "GET" else example_call(api, operation)


def _valid(api: RestInterface, judge: Judge, call: Call, requirement: str) -> bool:
    """Whether the valid request is taken, so that a refusal of another one has to do with what was changed."""
    exchange = call.send(api)
    if exchange.response.ok or exchange.response.status == 409:
        return True
    judge.skip(requirement, f"a valid {call.operation.id} is answered {exchange.came}, so nothing was made of it")
    return False


def _chosen(api: RestInterface, wrong: list[Wrong], standard: int, operation: Operation) -> list[Wrong]:
    """With little effort, one of each kind and some more."""
    first: dict[str, Wrong] = {}
    for item in wrong:
        first.setdefault(item.text, item)
    named: dict[str, Wrong] = {}
    for item in wrong:
        named.setdefault(item.name, item)
    if api.run.effort.slow:
        return api.run.effort.subsample(wrong, 6)
    basic = list(dict.fromkeys([*first.values(), *named.values()]))
    return list(dict.fromkeys(basic + api.run.effort.draw(wrong, standard, f"{api.run.seed}/{operation.id}")))


def _try(api: RestInterface, call: Call, item: Wrong, requirement: str) -> None:
    refused = judge_refusal(
        api,
        partial(call.having(item.name, item.text).send, api),
        requirement,
        item.what,
        field=item.name,
        shown=item.shown,
        json=False,
    )
    if not refused and call.operation.motion:
        stop_robot(api)
