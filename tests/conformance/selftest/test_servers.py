"""Robots behind and on mainstream web servers are not blamed; a server that is not there is named."""

import pytest

from conformance.selftest.controls import Case, run_controls
from conformance.selftest.servers import programs
from conformance.selftest.servers.fronts import FRONTS

_FRONTS = {front.name: front for front in FRONTS}


def judged(case, domain_id):
    (result,) = run_controls([case], effort="quick", parallel=1, domain_id=domain_id, tell=lambda _: None)
    return result


@pytest.mark.parametrize("name", ["nginx"])
def test_a_robot_behind_a_server_is_not_blamed(name, domain_id):
    front = _FRONTS[name]
    result = judged(Case(front.robot, front, 0), domain_id)
    assert (result.not_tried, result.blamed, result.unjudged) == ("", {}, {})
    assert result.conformant


@pytest.mark.parametrize("name", sorted(_FRONTS))
def test_a_server_that_is_not_there_is_named_with_what_installs_it(name, monkeypatch, domain_id):
    monkeypatch.setattr(programs.shutil, "which", lambda *_, **__: None)
    result = judged(Case("plain", _FRONTS[name], 0), domain_id)
    assert result.outcome is None
    assert result.not_tried.startswith("not installed: apt install ")
