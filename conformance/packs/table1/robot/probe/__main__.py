"""The ROS probe's process.

It prints one JSON line that says ready, or what the problem is. Then it answers each input line ("deliveries",
"velocities", "graph") with one JSON line, and ends when its input ends. Numbers are in hexadecimal, which loses no bit.
"""

import argparse
import json
import sys
from typing import Any, Final

_DISCOVERY_S: Final = 10.0


def main() -> int:
    """Run the probe; return 0 when its input ended, 3 when ROS or the robot is not there."""
    parser = argparse.ArgumentParser(prog="python -m conformance.packs.table1.robot.probe", description=__doc__)
    parser.add_argument("--domain-id", type=int, required=True)
    parser.add_argument("--delivery-topic", required=True)
    parser.add_argument("--cmd-vel-topic", required=True)
    options = parser.parse_args()
    try:
        # Here and nowhere else in the suite: a machine without ROS gets an answer, not a traceback.
        from conformance.packs.table1.robot.probe.node import ProbeNode  # noqa: PLC0415

        node = ProbeNode(options.domain_id, options.delivery_topic, options.cmd_vel_topic)
    except Exception as error:  # noqa: BLE001 - whatever keeps ROS from running, the suite has to be told
        _say({"problem": f"{type(error).__name__}: {error}"})
        return 3
    try:
        nodes = node.find(_DISCOVERY_S)
        if nodes:
            _say({"nodes": nodes})
            _serve(node)
        else:
            _say({"problem": f"no ROS node is found in domain {options.domain_id}"})
    finally:
        node.close()
    return 0


def _serve(node: Any) -> None:
    for line in sys.stdin:
        answer = {"deliveries": node.deliveries, "velocities": node.velocities, "graph": node.graph}.get(line.strip())
        _say(answer() if answer else {"problem": f"not understood: {line.strip()!r}"})


def _say(answer: dict[str, Any]) -> None:
    sys.stdout.write(json.dumps(answer) + "\n")
    sys.stdout.flush()


if __name__ == "__main__":
    sys.exit(main())
