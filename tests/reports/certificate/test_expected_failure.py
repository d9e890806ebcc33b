"""A failure that the baseline expects, from the robot to junit.xml: one meaning in every file on the way."""

import json
import sys
from collections.abc import Iterator

import pytest
from lxml import etree
from processes import ended, independent_robot

EXPECTED = "soap-delivery/reachable"  # the robot's SOAP services are claimed and not named
BASELINE = '[[expected]]\nrequirement = "{}"\nreason = "ticket 7"\nexpires = {}\n'


@pytest.fixture(scope="module")
def robot() -> Iterator[str]:
    """Yield the REST address of an independent robot."""
    with independent_robot("plain") as (_, rest, _):
        yield rest


def certified(robot, folder, expires):
    """Run a certification with a baseline; return its requirement in result.json and its test case in junit.xml."""
    baseline = folder / "known.toml"
    baseline.write_text(BASELINE.format(EXPECTED, expires), encoding="utf-8")
    command = [sys.executable, "-m", "roaas", "certify", f"--rest={robot}", "--class=soap-delivery", "--effort=quick"]
    done = ended(*command, f"--baseline={baseline}", f"--out={folder}")
    assert "Traceback" not in done.stderr
    result = json.loads((folder / "result.json").read_text(encoding="utf-8"))
    requirement = next(item for item in result["requirements"] if item["id"] == EXPECTED)
    requirement["whole run"] = (done.returncode, result["verdict"], result.get("accepted_until"))
    return requirement, etree.parse(folder / "junit.xml").find(f".//testcase[@name='{EXPECTED}']")


def test_an_expected_failure_is_skipped_with_its_reason(robot, tmp_path):
    requirement, case = certified(robot, tmp_path, "2999-12-31")
    assert requirement["verdict"] == "warn"
    assert requirement["expected_failure"] == {"reason": "ticket 7", "expires": "2999-12-31"}
    # The failure is accepted, and the robot does not conform all the same; that the rest was not judged stays.
    assert requirement["whole run"] == (4, "not-conformant", "2999-12-31")
    assert case.find("skipped").get("message") == "Accepted by the baseline until 2999-12-31: ticket 7"
    assert case.find("failure") is None
    for page in ("certificate.html", "certificate.md"):
        shown = (tmp_path / page).read_text(encoding="utf-8")
        assert "ticket 7 (until 2999-12-31)" in shown
        assert "accepted until 2999-12-31" in shown


def test_a_failure_whose_entry_has_expired_is_a_failure(robot, tmp_path):
    requirement, case = certified(robot, tmp_path, "2020-12-31")
    assert (requirement["verdict"], requirement["whole run"]) == ("fail", (1, "not-conformant", None))
    assert "expected_failure" not in requirement
    assert case.find("failure") is not None
