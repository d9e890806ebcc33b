"""A probe's process: `python -m loadtests.probe listen|publish --domain-id N --topic NAME`.

It writes a line of JSON that says that it is ready, or what its problem is. A listener then writes a line for each
delivery, `{"at_ns": …, "values": […]}`. A publisher reads lines of values, publishes each and writes `{"sent_ns": …}`.
Times are of CLOCK_MONOTONIC, which all processes of a machine share; values are in the order of the ROS message, in
hexadecimal, which loses no bit. The process ends when its input ends.
"""

import argparse
import json
import sys
from typing import Any


def say(answer: dict[str, Any]) -> None:
    """Write a line of JSON to the parent process."""
    sys.stdout.write(json.dumps(answer) + "\n")
    sys.stdout.flush()


def main() -> int:
    """Run the probe; returns 0 when its input ends, 3 without ROS or without a peer on the topic."""
    parser = argparse.ArgumentParser(prog="python -m loadtests.probe", description=__doc__)
    parser.add_argument("role", choices=["listen", "publish"])
    parser.add_argument("--domain-id", type=int, required=True)
    parser.add_argument("--topic", required=True)
    options = parser.parse_args()
    try:
        # Imported here: a machine without ROS gets a message, not a traceback.
        from loadtests.probe.node import DeliveryNode  # noqa: PLC0415

        node = DeliveryNode(options.domain_id, options.topic, say)
    except Exception as error:  # noqa: BLE001 -- whatever keeps ROS from running, the load test has to be told
        say({"problem": f"{type(error).__name__}: {error}"})
        return 3
    try:
        problem = node.listen() if options.role == "listen" else node.publish_to()
        say({"problem": problem} if problem else {"ready": True})
        if problem:
            return 3
        for line in sys.stdin:
            say({"sent_ns": node.publish(json.loads(line))})
    finally:
        node.close()
    return 0


if __name__ == "__main__":
    sys.exit(main())
