"""A right arm, over HTTP: it is not blamed."""

import sys

from arm import LIMITS, Arm
from body import Body
from judged_devices import of_arm, passed_but
from processes import ended


def test_a_right_arm_is_not_blamed(tmp_path):
    undeclared = {"unauthorised-still", "velocity", "velocity-stop", "watchdog", "hold", "switches"}
    passed_but(undeclared, lambda: of_arm(Arm(Body(LIMITS, noise=0.003)), tmp_path))
    # Its moves are stored, and can be judged again without it.
    again = ["judge", str(tmp_path / "out"), "motion/stop-lasts", "--statement", str(tmp_path / "device.toml")]
    told = ended(sys.executable, "-m", "roaas", *again)
    assert (told.returncode, "pass: motion/stop-lasts" in told.stdout) == (0, True), told.stdout + told.stderr
