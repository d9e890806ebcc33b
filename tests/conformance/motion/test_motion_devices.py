"""Over HTTP: a right arm and a right rover are not blamed, faults are found, and the certificate draws one."""

import sys

import mutants
import rover
from arm import LIMITS, Arm
from body import Body
from judged_devices import MOVES, blamed_for, judged_by_map, of_arm, passed_but
from processes import ended
from rover import Rover, serving_rover


def test_a_right_arm_is_not_blamed(tmp_path):
    undeclared = {"unauthorised-still", "velocity", "velocity-stop", "watchdog", "hold", "switches"}
    passed_but(undeclared, lambda: of_arm(Arm(Body(LIMITS, noise=0.003)), tmp_path))
    # Its moves are stored, and can be judged again without it.
    again = ["judge", str(tmp_path / "out"), "motion/stop-lasts", "--statement", str(tmp_path / "device.toml")]
    told = ended(sys.executable, "-m", "roaas", *again)
    assert (told.returncode, "pass: motion/stop-lasts" in told.stdout) == (0, True), told.stdout + told.stderr


def test_a_right_rover_that_clamps_and_takes_one_move_at_a_time_is_not_blamed(tmp_path):
    undeclared = {"unauthorised-still", "action-runs", "action-succeeds", "action-canceled"}
    done = passed_but(
        undeclared, lambda: judged_by_map(serving_rover(Rover(Body(rover.LIMITS, noise=0.004))), rover.MAP, tmp_path)
    )
    calls = (
        "Calls 4, because the map in the statement names it: "
        "PUT /goal/{x}/{y}, DELETE /goal, PUT /velocity, PUT /gripper/{state}"
    )
    assert calls in done.stderr


def test_an_incomplete_request_that_moves_the_arm_is_found(tmp_path):
    only = ["incomplete-still"]
    blamed_for(only, lambda: of_arm(Arm(fault="incomplete-moves"), tmp_path, MOVES, only))


def test_clients_that_are_mixed_up_are_found_and_the_certificate_draws_the_stop_that_is_ignored_first(tmp_path):
    def judge():
        body = Body(LIMITS)
        mutants.of_arm()["stop-ignored"](body)
        return of_arm(Arm(body, fault="mixes"), tmp_path)

    blamed_for(["stop", "one-client"], judge)
    page = (tmp_path / "out" / "certificate.html").read_text(encoding="utf-8")
    first = page.index('<figure class="move')
    assert "A stop of pan under way" in page[first : page.index("</figcaption>", first)]
    assert page.count('<polyline class="way"') > 10
