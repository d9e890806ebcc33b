"""The two short clients in ``examples/`` deliver the paper's coffee."""

import sys
from pathlib import Path

from processes import ended
from web_robot import eventually, running_robot

EXAMPLES = Path(__file__).parents[3] / "examples"


def run(example: str, url: str) -> str:
    return ended(sys.executable, str(EXAMPLES / example), url, check=True).stdout


def test_the_examples_deliver_coffee(domain_id):
    with running_robot(domain_id, "--time-scale=30") as served:
        assert "fetches the coffee" in run("deliver_soap.py", served.publishers + "?wsdl")
        assert run("deliver_rest.py", served.rest).endswith("The delivery is done.\n")
        listed = eventually(lambda: served.call("GET", "/robot/app/delivery/").json())
        assert [(entry["interface"], entry["state"]) for entry in listed] == [("rest", "done"), ("soap", "done")]
        assert {entry["request"]["message_code"] for entry in listed} == {4}
        assert {entry["request"]["source_x"] for entry in listed} == {76.02}
