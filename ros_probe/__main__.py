"""The probe's process: `python -m ros_probe --domain-id N --name NAME`.

It writes a line of JSON that says that it is ready, or what its problem is. Then it does what each line of its input
says, and answers each with a line (player.py). Times are of CLOCK_MONOTONIC, which all processes of a machine share, in
ns. Floats are written with all their digits, which loses no bit. The process ends when its input ends.
"""

import argparse
import json
import sys
from typing import Any


def _say(answer: dict[str, Any]) -> None:
    sys.stdout.write(json.dumps(answer) + "\n")
    sys.stdout.flush()


def main() -> int:
    """Run the probe; return 0 when its input ended, 3 without ROS."""
    parser = argparse.ArgumentParser(prog="python -m ros_probe", description=__doc__)
    parser.add_argument("--domain-id", type=int, required=True)
    parser.add_argument("--name", required=True)
    options = parser.parse_args()
    try:
        # Imported here: a machine without ROS gets a message, not a traceback.
        from ros_probe.player import Player  # noqa: PLC0415

        player = Player(options.domain_id, options.name)
    except Exception as error:  # noqa: BLE001 - whatever keeps ROS from running, the parent process has to be told
        _say({"problem": f"{type(error).__name__}: {error}"})
        return 3
    _say({"ready": True})
    try:
        for line in sys.stdin:
            _say(player.answer(json.loads(line)))
    finally:
        player.close()
    return 0


if __name__ == "__main__":
    sys.exit(main())
