"""A statement is read as it stands, and refused with the offending value."""

from __future__ import annotations

import pytest

from conformance.contract.ledger import CLASSES
from conformance.contract.statement import Endpoints, Statement, StatementError, load_statement


def _load(tmp_path, text):
    path = tmp_path / "robot.toml"
    path.write_text(text, encoding="utf-8")
    return load_statement(path)


def test_a_full_statement(tmp_path):
    statement = _load(
        tmp_path,
        """
        [robot]
        name = "R2"
        [endpoints]
        rest = "http://r2:7003/api"
        publishers_wsdl = "r2.wsdl"
        ca_file = "ca.pem"
        request_rate = 20
        [claims]
        profile = "paper"
        classes = ["safety"]
        [limits]
        linear_m_s = 1
        hold_s = 0.5
        [motion]
        arena = [0, 0, 10, 5]
        goals = [[1, 2, 0]]
        [ros]
        domain_id = 7
        [load]
        max_rate = 100
        """,
    )
    assert statement.robot == {"name": "R2"}
    assert statement.endpoints.publishers_wsdl == str(tmp_path / "r2.wsdl")
    assert statement.endpoints.ca_file == str(tmp_path / "ca.pem")
    assert statement.claimed() == ("rest-resources", "rest-delivery", "soap-delivery", "safety")
    assert (statement.limits.linear_m_s, statement.limits.hold_s, statement.limits.settle_s) == (1.0, 0.5, 2.0)
    assert statement.motion.arena == (0.0, 0.0, 10.0, 5.0)
    assert statement.ros.domain_id == 7


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("[robto]\nname = 'x'", "'robto'"),
        ("[endpoints]\nrset = 'x'", "'rset'"),
        ("[endpoints]\nrest = 7003", "7003"),
        ("[endpoints]\ntimeout_s = -1", "-1"),
        ("[claims]\nprofile = 'half'", "'half'"),
        ("[claims]\nclasses = ['rest']", "'rest'"),
        ("[limits]\nlinear_m_s = 'fast'", "'fast'"),
        ("[limits]\nsettle_s = nan", "nan"),
        ("[motion]\narena = [1, 2]", "[1, 2]"),
        ("[motion]\nactuated = ['linear.w']", "'linear.w'"),
        ("[ros]\ndomain_id = 500", "500"),
        ("claims = 'full'", "'full'"),
        ("[[", "robot.toml"),
    ],
)
def test_a_wrong_statement_is_refused_by_name(tmp_path, text, named):
    with pytest.raises(StatementError) as error:
        _load(tmp_path, text)
    assert named in str(error.value)


def test_without_claims_the_classes_follow_from_the_addresses():
    only_rest = Statement(endpoints=Endpoints(rest="http://r2"))
    assert "soap-delivery" not in only_rest.claimed()
    assert "rest-resources" in only_rest.claimed()
    both = Endpoints(rest="http://r2", publishers_wsdl="x", subscribers_wsdl="y")
    assert Statement(endpoints=both).claimed() == CLASSES
