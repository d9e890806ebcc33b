"""An error of the suite concerns one operation: it is named and counted, and what else there is is judged."""

import json

from click.testing import CliRunner
from small_device import constant, described, reading, small_device

import roaas
from conformance.api.rest.variations import Kind
from conformance.contract.pack import Contract
from conformance.scenarios.rule import Rule
from conformance.scenarios.survey import Probe, Survey
from conformance.transport.exchange import Exchange, Request, Response
from conformance.verdict.evidence import Case, CheckerListener, Judge


def _exchange(path: str) -> Exchange:
    return Exchange(Request("GET", f"http://robot{path}"), Response(200, (), b"", 1.0))


def _probes(*paths: str) -> tuple[Probe, ...]:
    return tuple(Probe(f"GET {path}", Kind.USUAL, exchange=_exchange(path)) for path in paths)


def test_a_rule_that_cannot_judge_one_operation_judges_the_others():
    def judge(trace):
        for probe in trace.probes:
            if probe.operation == "GET /bad":
                raise RecursionError("too deep")
            yield Case(holds=True, exchange=probe.exchange, expected="")

    told = []
    rule = Rule("http/date", (), judge)
    trace = Survey(_probes("/a", "/bad", "/b", "/bad"))
    found = rule.outcomes_apart(trace, lambda _: None, lambda *what: told.append(what))
    assert len(found) == 2
    assert [(operation, str(error)) for operation, error in told] == [("GET /bad", "too deep")]


def test_a_checker_that_fails_ends_no_request_and_no_other_checker():
    seen = []

    def fails(exchange):
        raise ValueError(f"pattern\nof {exchange.request.url}")

    def sees(exchange):
        seen.append(exchange)
        yield from ()

    judge = Judge(Contract.load().ledger)
    for _ in range(3):
        CheckerListener(judge, [fails, sees]).on_response(_exchange("/x?a=1"))
    assert len(seen) == 3
    assert list(judge.faults) == ["GET /x: not judged: ValueError: pattern"]
    for number in range(39):
        judge.fault(f"GET /{number}", ValueError("pattern"))
    assert list(judge.faults) == ["GET /x, GET /0, GET /1 and 37 more: not judged: ValueError: pattern"]


def test_an_error_of_the_suite_is_told_on_terminal_and_pages_and_is_no_verdict(tmp_path, monkeypatch):
    def broken(*_: object) -> list[str]:
        raise ValueError("no such pattern")

    monkeypatch.setattr("conformance.rules.description.test_answers.read_json", broken)
    paths = {path: reading({"type": "object"}) for path in ("/a", "/b")}
    with small_device(described(paths), dict.fromkeys(paths, constant({}))) as url:
        command = ["certify", f"{url}/openapi.json", "--effort=quick", f"--out={tmp_path}", "--class=description"]
        done = CliRunner().invoke(roaas.main, command)
    assert done.exit_code == 4
    result = json.loads((tmp_path / "result.json").read_text(encoding="utf-8"))
    assert result["verdict"] == "inconclusive"
    (error,) = result["suite_errors"]
    assert error["text"] == "GET /a, GET /b: not judged: ValueError: no such pattern"
    for text in (
        done.output,
        *((tmp_path / f"certificate.{end}").read_text(encoding="utf-8") for end in ("md", "html")),
    ):
        assert "could not be judged because of an error in the suite:" in text
        assert "GET /b: not judged: ValueError: no such pattern" in text.replace("\\", "")
