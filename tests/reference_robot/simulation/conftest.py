"""A simulated robot on a domain of its own, and an observer on the same graph."""

import pytest
from msgspec.structs import replace
from observer import Observer, until

from reference_robot.names import RosNames, Velocity
from reference_robot.ros import RosRuntime
from reference_robot.simulation.runner import Simulation


@pytest.fixture
def robot(domain_id, request):
    """Yield an observer of a robot; parameters by ``@pytest.mark.parametrize("robot", [...], indirect=True)``.

    A parameter is a dict of ``time_scale`` and ``velocity`` (the cmd_vel message's name).
    """
    options = {"time_scale": 5.0, "velocity": "auto", **getattr(request, "param", {})}
    names = replace(RosNames(), velocity=Velocity(options["velocity"]))
    with RosRuntime(domain_id) as simulation_ros, RosRuntime(domain_id) as ros:
        Simulation(simulation_ros, names, options["time_scale"])
        observer = Observer(ros, names)
        simulation_ros.start()
        ros.start()
        until(observer.is_connected)
        yield observer
