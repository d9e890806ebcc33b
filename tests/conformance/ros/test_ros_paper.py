"""The paper's robot behind its own gateway: it passes by the ROS map of examples/paper_robot."""

import json
import re
import sys
from pathlib import Path
from subprocess import PIPE, Popen

from processes import ended

EXAMPLE = Path(__file__).parents[3] / "examples" / "paper_robot" / "paper-robot.toml"
SELECTED = [f"ros-gateway/{name}" for name in ("read-exact", "read-newest", "write-exact", "once", "refused-nothing")]


def test_the_reference_robot_passes_by_the_map_of_the_example(tmp_path, domain_id):
    command = [sys.executable, "-m", "roaas", "robot", "--rest-port", "0", "--soap-port", "0", "--domain-id"]
    with Popen([*command, str(domain_id)], stdout=PIPE, text=True) as robot:
        try:
            url = next(found[1] for line in robot.stdout if (found := re.search(r"rest=(\S+)", line)))
            statement = tmp_path / "robot.toml"
            text = EXAMPLE.read_text(encoding="utf-8").replace("http://127.0.0.1:7003", url)
            statement.write_text(text, encoding="utf-8")
            options = ["--ros", "--ros-domain-id", domain_id, "--allow-motion", "--effort", "quick", "--out", tmp_path]
            options += [word for id_ in SELECTED for word in ("--select", id_)]
            done = ended(sys.executable, "-m", "roaas", "certify", statement, *options)
        finally:
            robot.terminate()
    result = json.loads((tmp_path / "result.json").read_text(encoding="utf-8"))
    verdicts = {one["id"]: one["verdict"] for one in result["requirements"]}
    assert {id_: verdicts[id_] for id_ in SELECTED} == dict.fromkeys(SELECTED, "pass"), done.stdout
    assert all(one["compared"] for one in result["ros"]), result["ros"]
