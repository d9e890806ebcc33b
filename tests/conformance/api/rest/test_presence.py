"""Whether an operation is there: what a robot's own resource may leave open is not held against it."""

from types import SimpleNamespace

import pytest

from conformance.api.rest.calls import Call
from conformance.api.rest.inputs import Inputs
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.presence import judge_there
from conformance.contract.pack import Contract
from conformance.documents.openapi import Body, Operation
from conformance.documents.parameters import Parameter
from conformance.transport.exchange import Exchange, Request, Response
from conformance.verdict.run import Run

_ID = "describe/openapi-behaviour"


def _judged(method, template, answers, *, known, responses=(), moving=False, allow_motion=True):
    """What is said of an operation by what the robot answers to each method: status and Allow; None: nothing."""

    def send(asked, path, **_):
        status, allow = answers[asked]
        fields = () if allow is None else (("Allow", allow),)
        return Exchange(Request(asked, f"http://r2{path}"), Response(status, fields, b"", 1.0))

    run = Run(contract=Contract.load(only=(_ID,)), allow_motion=allow_motion)
    parameters = (Parameter("id", "path", required=True, schema={"type": "integer"}),) if "{" in template else ()
    bodies = {"application/json": Body("application/json", {})} if template == "/a/" else {}
    operation = Operation(
        "x", method, template, parameters, bodies, responses={key: {} for key in responses}, motion=moving
    )
    judge_there(
        RestInterface(run, SimpleNamespace(send=send)), _ID, Call(operation, Inputs(path={"id": "a"})), known=known
    )
    evidence = run.judge.evidence[_ID]
    return not evidence.findings if evidence.cases else None


@pytest.mark.parametrize(
    ("method", "template", "answers", "known", "said"),
    [
        ("GET", "/a/", {"GET": (200, None)}, True, True),
        ("GET", "/a/", {"GET": (422, None)}, True, True),
        ("GET", "/a/", {"GET": (404, None)}, True, False),
        ("GET", "/a/", {"GET": (405, "PUT")}, False, False),
        ("GET", "/a/{id}", {"GET": (404, None)}, False, None),
        ("GET", "/a/{id}", {"GET": (404, None)}, True, False),
        ("PUT", "/a/", {"OPTIONS": (204, "GET, PUT")}, True, True),
        ("PUT", "/a/", {"OPTIONS": (204, "GET")}, True, False),
        ("PUT", "/a/", {"OPTIONS": (405, None), "PUT": (405, None)}, True, False),
        ("PUT", "/a/", {"OPTIONS": (405, None), "PUT": (422, None)}, True, True),
        ("PUT", "/a/", {"OPTIONS": (501, None), "PUT": (404, None)}, True, False),
        ("PUT", "/a/", {"OPTIONS": (404, None), "PUT": (204, None)}, True, True),
        ("PUT", "/a/{id}", {"OPTIONS": (405, None), "PUT": (422, None)}, True, True),
        ("PUT", "/a/{id}", {"OPTIONS": (405, None), "PUT": (405, None)}, True, False),
        ("PUT", "/a/{id}", {"OPTIONS": (405, None), "PUT": (404, None)}, True, None),
        ("DELETE", "/b/", {"OPTIONS": (405, None)}, True, None),
        ("PUT", "/a/", {"OPTIONS": (405, "PUT")}, True, True),
        ("PUT", "/a/", {"OPTIONS": (405, "GET")}, True, False),
        ("POST", "/a/", {"OPTIONS": (405, "POST")}, False, True),
        ("POST", "/a/", {"OPTIONS": (405, "GET")}, False, False),
        ("POST", "/a/", {"OPTIONS": (405, None)}, False, None),
        ("POST", "/a/", {"OPTIONS": (501, None)}, False, None),
        ("POST", "/a/", {"OPTIONS": (404, None)}, False, False),
        ("POST", "/a/{id}", {"OPTIONS": (404, None)}, False, None),
    ],
)
def test_an_operation_is_there_by_what_the_robot_says(method, template, answers, known, said):
    assert _judged(method, template, answers, known=known) is said


def test_what_may_not_be_sent_is_left_open_where_options_proves_nothing():
    answers = {"OPTIONS": (405, None)}
    assert _judged("PUT", "/a/", answers, known=True, moving=True, allow_motion=False) is None
    assert _judged("PUT", "/a/", {"OPTIONS": (404, None)}, known=True, moving=True, allow_motion=False) is False


def test_a_resource_with_nothing_in_it_is_there_by_its_methods():
    empty = {"GET": (404, None), "OPTIONS": (204, "GET, PUT")}
    assert _judged("GET", "/a/", empty, known=True, responses=("200", "404")) is True
    assert _judged("GET", "/a/", {**empty, "OPTIONS": (404, None)}, known=True, responses=("200", "404")) is False
