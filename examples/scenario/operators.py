"""Operators of a robot: some watch its state, one looks at its things in order.

roaas load http://robot:8000/openapi.json --scenario operators.py --users 8 --duration 60
"""

from locust import SequentialTaskSet, between, constant_pacing, task

from loadtests.scenario import RobotUser


class Display(RobotUser):
    """A display that shows the robot's state twice a second."""

    weight = 3
    wait_time = constant_pacing(0.5)

    @task
    def refresh(self) -> None:
        """Read the state; a state without a stamp is a failure, whatever its status."""
        with self.client.get("/state", catch_response=True) as response:
            if response.ok and "stamp" not in response.json():
                response.failure("the state has no stamp")


class Inspector(RobotUser):
    """A person who lists the robot's things, and then looks at each of them."""

    wait_time = between(0.2, 1.0)

    @task
    class Round(SequentialTaskSet):
        """One look at everything."""

        names = ()

        @task
        def list_all(self) -> None:
            """Read the list. Where it fails, this round has no names."""
            response = self.client.get("/items", params={"limit": 10})
            self.names = [item["id"] for item in response.json()] if response.ok else []

        @task
        def look_at_each(self) -> None:
            """Read each thing, by the operation's name."""
            for name in self.names:
                self.client.call("GET /items/{item_id}", {"item_id": name})
