"""The probe's process: `python -m ros_probe observe|play --domain-id N --delivery-topic NAME`.

It writes a line of JSON that says that it is ready, or what its problem is. An observer then answers each line of its
input ("deliveries", "velocities", "graph") with a line. Times are of CLOCK_MONOTONIC, which all processes of a machine
share, in ns; messages are `[time, value, …]` with values in the order of the ROS message, in hexadecimal, which loses
no bit. A player does what each line says (player.py). The process ends when its input ends.
"""

import argparse
import json
import sys
from typing import Any


def _say(answer: dict[str, Any]) -> None:
    sys.stdout.write(json.dumps(answer) + "\n")
    sys.stdout.flush()


def main() -> int:
    """Run the probe; return 0 when its input ended, 3 without ROS or without a robot."""
    parser = argparse.ArgumentParser(prog="python -m ros_probe", description=__doc__)
    parser.add_argument("role", choices=["observe", "play"])
    parser.add_argument("--domain-id", type=int, required=True)
    parser.add_argument("--delivery-topic", default="")
    parser.add_argument("--name", default="roaas_player")
    parser.add_argument("--cmd-vel-topic")
    options = parser.parse_args()
    return _play(options.domain_id, options.name) if options.role == "play" else _probe(options)


def _play(domain_id: int, name: str) -> int:
    try:
        from ros_probe.player import Player  # noqa: PLC0415 - as below

        player = Player(domain_id, name)
    except Exception as error:  # noqa: BLE001 - as below
        _say({"problem": f"{type(error).__name__}: {error}"})
        return 3
    _say({"ready": True})
    try:
        for line in sys.stdin:
            _say(player.answer(json.loads(line)))
    finally:
        player.close()
    return 0


def _probe(options: argparse.Namespace) -> int:
    try:
        # Imported here: a machine without ROS gets a message, not a traceback.
        from ros_probe.node import ProbeNode  # noqa: PLC0415

        node = ProbeNode(options.domain_id, options.delivery_topic, options.cmd_vel_topic)
    except Exception as error:  # noqa: BLE001 - whatever keeps ROS from running, the parent process has to be told
        _say({"problem": f"{type(error).__name__}: {error}"})
        return 3
    try:
        problem = node.observe()
        _say({"problem": problem} if problem else {"ready": True})
        if problem:
            return 3
        for line in sys.stdin:
            _say(node.answer(line))
    finally:
        node.close()
    return 0


if __name__ == "__main__":
    sys.exit(main())
