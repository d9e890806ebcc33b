"""Answers that went to another request, told from those of a robot whose state has changed meanwhile."""

from types import SimpleNamespace

import pytest

from conformance.api.rest.interface import RestInterface
from conformance.api.rest.questions import Question, misplaced
from conformance.contract.pack import Contract
from conformance.transport.exchange import Exchange, Request, Response
from conformance.verdict.run import Run


def _answer(status):
    return Response(status, (), b"", 1.0)


@pytest.mark.parametrize(
    ("alone", "misplaced_too"),
    [
        (200, True),  # it is still there: the 404 was for somebody else
        (404, False),  # it has ceased to be there
        (503, True),
    ],
)
def test_an_answer_is_another_one_s_unless_the_robot_gives_it_alone_as_well(alone, misplaced_too):
    def send(method, path, **_):
        return Exchange(Request(method, f"http://r2{path}"), _answer(alone))

    api = RestInterface(Run(contract=Contract.load()), SimpleNamespace(send=send))
    goal = Question("/goal/", "application/json", lambda answer: "" if answer.status == 200 else f"{answer.status}")
    assert misplaced(api, goal, _answer(200)) == ""
    assert bool(misplaced(api, goal, _answer(404))) is misplaced_too
