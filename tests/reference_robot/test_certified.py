"""The suite certifies the reference robot, with ROS beside it: what the contract says of HTTP, SOAP and motion holds.

Tests of the rooms below show what the contract does not say: the robot's words, its limits, and other robots behind it.
"""

from conformance.contract.pack import Contract
from conformance.verdict.verdicts import Value
from proof.selftest.controls import Case, run_controls
from proof.table1.selftest import REFERENCE


def test_the_reference_robot_is_conformant_without_a_warning(domain_id):
    (result,) = run_controls(Contract.load(), [Case(REFERENCE)], domain_id=domain_id, tell=lambda _: None)
    assert (result.not_tried, result.false_positives, result.conformant) == ("", {}, True)
    assert result.outcome is not None
    verdicts = result.outcome.verdicts
    assert {id_ for id_, verdict in verdicts.items() if verdict in {Value.FAIL, Value.WARN, Value.ERROR}} == set()
    assert sum(verdict is Value.PASS for verdict in verdicts.values()) > 150
