"""Mutants by rule: the enumeration is whole and stable, edits do what they say, and such mutants are caught."""

import json
import math

import pytest
from taking_robot import sent_by

from conformance.contract.pack import Contract
from conformance.documents import wsdl
from conformance.documents.openapi import operations_of
from proof.mutation.messages import Request, Response
from proof.selftest.certifying import Outcome
from proof.selftest.comparison import Comparison, ToolResult
from proof.selftest.generated import judging
from proof.selftest.generated.adversary import Rate, compose, kinds_in_requests, rate_of, rates_by, sample
from proof.selftest.generated.catalogue import every_change, generated_mutants, open_places
from proof.selftest.generated.judging import GIVEN_UP, KILLED, NOT_REACHED, GeneratedResult, judge
from proof.selftest.generated.mutant import Tally
from proof.selftest.generated.operators import OPERATORS
from proof.selftest.generated.report import document, summary
from proof.selftest.mutant_run import RobotPool
from proof.selftest.report import Report
from proof.table1.selftest import PLAIN

CONTRACT = Contract.load()
JSON = [("Content-Type", "application/json")]


def named(name):
    return next(mutant for mutant in generated_mutants(CONTRACT) if mutant.name == name)


def answered(name, request, *bodies, media_type="application/json"):
    """What a mutant makes of the robot's answers, and how often it altered one."""
    tally = Tally()
    change = named(name).make(tally)
    seen = [
        change(request, lambda _, body=body: Response(200, [("Content-Type", media_type)], body)).body
        for body in bodies
    ]
    return seen, tally.altered


def forwarded(name, request):
    """What a mutant sends to the robot, which takes everything; and how often it altered that."""
    tally = Tally()
    return sent_by(named(name).make(tally), request), tally.altered


def test_the_enumeration_is_whole_and_stable():
    mutants = generated_mutants(CONTRACT)
    names = [mutant.name for mutant in mutants]
    assert len(names) == len(set(names)) >= 1500
    assert {mutant.operator for mutant in mutants} >= {operator.name for operator in OPERATORS}
    operations = {operation.id for operation in operations_of(CONTRACT)}
    for path in (CONTRACT.publishers_path, CONTRACT.subscribers_path):
        operations |= {operation.name for operation in wsdl.read_file(path).operations}
    assert {mutant.exchange.name for mutant in mutants} == operations
    every_change.cache_clear()
    generated_mutants.cache_clear()
    assert [mutant.name for mutant in generated_mutants(CONTRACT)] == names


def test_every_open_place_covers_something_and_not_much():
    every = every_change(CONTRACT)
    # Of composed faults, one condition has places of its own.
    every += tuple(one for one in compose(every, kinds_in_requests(CONTRACT)) if one.operator.endswith("@first"))
    changes = [(change.name, change.exchange.side, change.exchange.method) for change in every]
    for place in open_places(CONTRACT):
        covered = sum(place.covers(*change) for change in changes)
        assert 0 < covered < len(changes) / 20, place


def test_a_sample_is_the_same_for_a_seed_and_has_every_stratum():
    mutants = generated_mutants(CONTRACT)
    strata = {(mutant.operator, mutant.exchange.class_) for mutant in mutants}
    chosen = sample(mutants, len(strata), 3)
    assert {(mutant.operator, mutant.exchange.class_) for mutant in chosen} == strata
    assert chosen == sample(mutants, len(strata), 3) != sample(mutants, len(strata), 4)
    assert len(sample(mutants, 10**6, 0)) == len(mutants)


def test_the_bound_is_wilsons():
    assert Rate(97, 3, 5).bound == pytest.approx(0.9155, abs=1e-4)
    assert (Rate(0, 0, 4).share, Rate(0, 0, 4).bound) == (1.0, 0.0)


def test_answers_are_altered_in_json_and_xml():
    request = Request("rest", "GET", "/robot/velocity/linear/")
    assert answered("ulp:getLinearVelocity:answer.x:json", request, b'{"x":1.0,"y":0}') == (
        [json.dumps({"x": math.nextafter(1, 2), "y": 0}).encode()],
        1,
    )
    seen, altered = answered("delay:getLinearVelocity:answer.x:json", request, b'{"x":1}', b'{"x":1.0}', b'{"x":2}')
    assert (seen, altered) == ([b'{"x":1}', b'{"x":1.0}', b'{"x": 1.0}'], 1)
    seen, altered = answered("duplicate:getLinearVelocity:answer.x:json", request, b'{"x":1}')
    assert (seen, altered) == ([b'{"x": 1, "x": 1}'], 1)
    vector = b"<Vector3><x>1.0</x><y>2.0</y></Vector3>"
    seen, _ = answered("swap:getLinearVelocity:answer.x:xml", request, vector, media_type="application/xml")
    assert b"<x>2.0</x><y>1.0</y>" in seen[0]
    assert answered("negate:getLinearVelocity:answer.x:json", request, b'{"x":0.0}') == ([b'{"x":0.0}'], 0)


def test_requests_are_altered_in_json_path_and_query():
    given = Request("rest", "PUT", "/robot/velocity/linear/", "HTTP/1.1", list(JSON), b'{"x":0.5,"y":0,"z":0}')
    assert forwarded("clamp:putLinearVelocity:request.x:json", given)[0].body == b'{"x": 0.05, "y": 0, "z": 0}'
    twice = given.copy(body=b'{"x":0.5,"x":0.5,"y":0,"z":0}')
    assert forwarded("clamp:putLinearVelocity:request.x:json", twice) == (twice, 0)
    filled = forwarded("fill:putLinearVelocity:request.y:json", given.copy(body=b'{"x":1}'))
    assert (json.loads(filled[0].body), filled[1]) == ({"x": 1, "y": 0.0}, 1)
    path = "/robot/app/delivery/4/depot_x/1/depot_y/2/dest_x/3/dest_y/4/source_x/5/source_y/6"
    sent, _ = forwarded("swap:putDelivery:request.depot_x:path", Request("rest", "PUT", path))
    assert sent.path.startswith("/robot/app/delivery/4/depot_x/2.0/depot_y/1.0/dest_x/3/")
    sent, _ = forwarded(
        "negate:getPlan:request.x:query", Request("rest", "GET", "/robot/navigation/service/plan?x=1&y=2")
    )
    assert sent.query == "x=-1.0&y=2"


def test_a_mode_says_when():
    request, body = Request("rest", "GET", "/robot/velocity/linear/"), b'{"x":1}'
    seen, altered = answered("null@rarely:getLinearVelocity:answer.x:json", request, *[body] * 40)
    assert (seen.count(b'{"x": null}'), altered) == (2, 2)
    assert answered("null@together:getLinearVelocity:answer.x:json", request, body, body)[1] == 0
    assert answered("null@after-error:getLinearVelocity:answer.x:json", request, body, body)[1] == 0


def test_a_run_that_comes_to_no_end_shows_nothing(monkeypatch):
    monkeypatch.setattr(judging, "run_job", lambda job: Outcome(-1, {}, {}, 0, job.timeout_s))
    with RobotPool(CONTRACT, PLAIN, 1) as pool:
        results = judge(pool, [named("status:getSensors:200-500")], efforts=("quick",), tell=lambda _: None)
    assert [result.outcome for result in results] == [GIVEN_UP]
    report = Report(CONTRACT, "plain", generated_results=results)
    assert not report.holds
    assert "GIVEN UP status:getSensors:200-500" in report.summary()


def test_three_mutants_are_killed_and_one_that_alters_nothing_is_told_apart():
    names = (
        "retype:getSensors:answer[].name:json",
        "default:GetPlan:request.x:soap",
        "status:getSensors:200-500",
        "scale:getVelocity:answer.angular.x:json",
    )
    with RobotPool(CONTRACT, PLAIN, 2) as pool:
        results = judge(pool, map(named, names[:3]), efforts=("quick",), tell=lambda _: None)
    assert {result.mutant.name: result.outcome for result in results} == dict.fromkeys(names[:3], KILLED)
    assert all(result.by and result.altered for result in results)
    results.append(GeneratedResult(named(names[3]), NOT_REACHED, effort="quick"))
    assert rate_of(results) == Rate(3, 0, 1)
    assert rates_by(results, "class")["rest-resources"] == Rate(2, 0, 1)
    assert document(7, results, 0)["all"]["rate"] == 1.0
    assert "3 of 3 (100.0%, at least 43.9%), 1 not reached" in summary(7, results)
    report = Report(CONTRACT, "plain", generated_results=results, seed=7)
    seen = [ToolResult(names[0], killed=True, findings=()), ToolResult(names[2], False, ())]
    report.compared = [Comparison("plain Schemathesis", results=seen)]
    page = report.matrix()
    assert "--generated 4 --seed 7 --target plain" in page
    for said in ("| `rest-resources` | 2 | 2 | 100.0% |", "this suite: 2 of 2", "plain Schemathesis: 1 of 2"):
        assert said in page


def test_what_the_good_device_does_not_pass_kills_nothing(monkeypatch):
    mutant, jobs = named("status:getSensors:200-500"), []

    def refuted(job):
        """Fail every device for one requirement, and end a run for which that is enough."""
        jobs.append(job)
        return Outcome(1, {"rest-resources/sensors-type": "fail"}, {}, 9, 0.1)

    monkeypatch.setattr(judging, "run_job", refuted)
    with RobotPool(CONTRACT, PLAIN, 1) as pool:
        (result,) = judge(pool, [mutant], efforts=("quick",), tell=lambda _: None)
    assert (result.outcome, result.by) == (NOT_REACHED, ())
    enough = [job.enough for job in jobs if job.enough]
    assert "rest-resources/sensors-type" in enough[0]
    assert not any("rest-resources/sensors-type" in later for later in enough[1:])
    # The run that was ended by it is run again, to its end.
    assert (jobs[0].requirements, jobs[0].classes) == (jobs[2].requirements, jobs[2].classes)
