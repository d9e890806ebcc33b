"""Robots behind and on mainstream web servers are not blamed; a server that is not there is named."""

from dataclasses import replace

import pytest

from conformance.selftest.controls import Case, run_controls
from conformance.selftest.robots import ON_SERVERS
from conformance.selftest.servers import programs
from conformance.selftest.servers.fronts import FRONTS

_FRONTS = {front.name: front for front in FRONTS}


def judged(case, domain_id):
    (result,) = run_controls([case], effort="quick", parallel=1, domain_id=domain_id, tell=lambda _: None)
    return result


@pytest.mark.parametrize("name", ["nginx", "node", "flask"])
def test_a_robot_behind_or_on_a_server_is_not_blamed(name, domain_id):
    result = judged(_case(name), domain_id)
    assert (result.not_tried, result.blamed, result.conformant) == ("", {}, True)


@pytest.mark.parametrize("name", [*sorted(_FRONTS), *ON_SERVERS])
def test_a_server_that_is_not_there_is_named_with_what_installs_it(name, monkeypatch, domain_id):
    monkeypatch.setattr(programs.shutil, "which", lambda *_, **__: None)
    monkeypatch.setattr(programs, "find_spec", lambda _: None)
    result = judged(replace(_case(name), robot=name if name in ON_SERVERS else "plain"), domain_id)
    assert result.outcome is None
    assert result.not_tried.startswith(("not installed: apt install ", "not installed: pip install "))


def _case(name):
    front = _FRONTS.get(name)
    return Case(front.robot if front else name, front, 0)
