"""Reads that are put off for a moment are sent again, and responses that went to another request are told apart."""

from types import SimpleNamespace

import pytest
from toy_server import Handler, server_of

from conformance.api.rest import calls
from conformance.api.rest.calls import Call
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.questions import Question, mismatch_of, questions
from conformance.api.rest.statuses import usual_status
from conformance.contract.pack import Contract
from conformance.documents.openapi import operations_of
from conformance.transport.client import Connection, HttpClient
from conformance.transport.exchange import Exchange, Request, Response
from conformance.verdict.run import Run

_CONTRACT = Contract.load()
_POSE = Call(next(item for item in operations_of(_CONTRACT) if item.id == "getPose"))


@pytest.fixture(name="slept")
def _slept(monkeypatch):
    slept = []
    monkeypatch.setattr(calls, "time", SimpleNamespace(sleep=slept.append))
    return slept


def _robot(*answers):
    """A robot that gives these answers, the last one again and again."""
    left = list(answers)

    def send(method, path, **_):
        status, after = left.pop(0) if len(left) > 1 else left[0]
        fields = () if after is None else (("Retry-After", after),)
        return Exchange(Request(method, path), Response(status, fields, b"", 1.0))

    return RestInterface(Run(contract=_CONTRACT), SimpleNamespace(send=send))


def test_a_robot_without_odometry_for_a_moment_is_asked_again(slept):
    assert _POSE.send(_robot((503, "1"), (200, None))).response.status == 200
    assert slept == [1]


@pytest.mark.parametrize(
    "answer", [(503, None), (503, "3600"), (503, "Fri, 20 Nov 2226 23:00:00 GMT"), (429, "9"), (500, "1")]
)
def test_what_is_not_put_off_for_a_moment_is_taken_as_it_is(slept, answer):
    assert _POSE.send(_robot(answer, (200, None))).response.status == answer[0]
    assert not slept


def test_what_writes_is_never_sent_again(slept):
    assert _POSE.send(_robot((503, "1"), (200, None)), method="PUT").response.status == 503
    assert not slept


def test_a_robot_that_is_always_about_to_have_odometry_is_waited_for_a_few_times(slept):
    robot = _robot((503, "1"))
    assert {_POSE.send(robot).response.status for _ in range(20)} == {503}
    assert len(slept) == 5


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
    assert mismatch_of(api, goal, _answer(200)) == ""
    assert bool(mismatch_of(api, goal, _answer(404))) is misplaced_too
    assert mismatch_of(api, goal, _answer(500)) == ""
    assert mismatch_of(api, goal, _answer(429)) == ""  # a rate limit refuses any request


@pytest.mark.parametrize(
    ("media_type", "body", "other"),
    [
        ("application/json", b'[{"name": "b", "type": "a/srv/B"}, {"name": "a", "type": "a/srv/A"}]', False),
        ("application/json", b'[{"name": "a", "type": "a/srv/A"}]', True),
        ("text/plain", b"- name: a\n  type: a/srv/A\n- name: bc\n  type: a/srv/B\n", True),
        ("text/plain", b"- name: a\n  type: a/srv/A\n- name: b\n  type: a/srv/B\n", False),
    ],
)
def test_a_list_keeps_its_entries_beside_other_clients(media_type, body, other):
    good = {
        "application/json": b'[{"name": "a", "type": "a/srv/A"}, {"name": "b", "type": "a/srv/B"}]',
        "text/plain": b"- name: a\n  type: a/srv/A\n- name: b\n  type: a/srv/B\n",
    }

    class Listing(Handler):
        def answer(self):
            kind = self.headers["Accept"].replace("*/*", "application/json")
            found = self.path == "/robot/navigation/services/" and kind in good
            self.send(200 if found else 404, good.get(kind, b""), kind)

    with server_of(Listing) as server:
        api = RestInterface(Run(contract=_CONTRACT), HttpClient(server.url, Connection()))
        asked = {(one.path, one.accept): one for one in questions(api)}
        api.client.close()
    question = asked["/robot/navigation/services/", media_type]
    answer = Response(200, (("Content-Type", media_type),), body, 1.0)
    assert bool(question.mismatch(answer)) is other


@pytest.mark.parametrize(("status", "asked"), [(200, True), (404, True), (500, False), (502, False)])
def test_what_is_answered_by_a_crash_is_no_question(status, asked):
    class Answering(Handler):
        def answer(self):
            self.send(status if self.path == "/goal/" else 404, b"")

    goal = Question("/goal/", "application/json", lambda _: "")
    with server_of(Answering) as server:
        api = RestInterface(Run(contract=_CONTRACT), HttpClient(server.url, Connection()))
        found = {one.path for one in questions(api, [goal])}
        api.client.close()
    assert (goal.path in found) is asked


@pytest.mark.parametrize(
    ("statuses", "usual"), [((200,), 200), ((404,), 404), ((500, 200), 200), ((503, 500, 404), 404), ((503,) * 3, 503)]
)
def test_a_server_error_now_and_then_is_not_the_usual_status(statuses, usual):
    left = list(statuses)
    request = Request("GET", "http://h/a", (), b"")
    assert usual_status(lambda: Exchange(request, Response(left.pop(0), (), b"", 1.0))) == usual
    assert left == []
