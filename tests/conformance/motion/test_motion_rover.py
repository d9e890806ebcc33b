"""A right rover, over HTTP: it is not blamed."""

import rover
from body import Body
from judged_devices import judged_by_map, passed_but
from rover import Rover, serving_rover


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
