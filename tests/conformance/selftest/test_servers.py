"""Robots behind and on mainstream web servers are no false positives; a server that is not there is named."""

from dataclasses import replace

import pytest

from conformance.contract.pack import Contract
from proof.mutation import self_test
from proof.mutation.self_test import self_test_of
from proof.selftest.controls import Case, run_controls
from proof.selftest.servers.fronts import FRONTS
from proof.table1.selftest import ON_SERVERS, PLAIN

_CONTRACT = Contract.load()
_FRONTS = {front.name: front for front in FRONTS}


def judged(case, domain_id):
    (result,) = run_controls(_CONTRACT, [case], domain_id=domain_id, tell=lambda _: None)
    return result


def test_a_robot_behind_a_server_is_no_false_positive(domain_id):
    result = judged(_case("nginx"), domain_id)
    assert (result.not_tried, result.false_positives, result.conformant) == ("", {}, True)


@pytest.mark.parametrize("name", [*sorted(_FRONTS), *(device.name for device in ON_SERVERS)])
def test_a_server_that_is_not_there_is_named_with_what_installs_it(name, monkeypatch, domain_id):
    monkeypatch.setattr(self_test.shutil, "which", lambda *_, **__: None)
    monkeypatch.setattr(self_test, "find_spec", lambda _: None)
    case = _case(name)
    result = judged(replace(case, device=PLAIN) if case.variant else case, domain_id)
    assert result.outcome is None
    assert result.not_tried.startswith(("not installed: apt install ", "not installed: pip install "))


def _case(name):
    needs, front = self_test_of(_CONTRACT), _FRONTS.get(name)
    return Case(needs.device_in(name) if front else needs.device(name), front)
