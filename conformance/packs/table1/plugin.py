"""The pack's answers to the generic suite: the statement's own tables, and the robot as a device."""

from collections.abc import Iterable, Iterator
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from conformance.api import device
from conformance.documents.wsdl import SoapOperation
from conformance.documents.xml import Node
from conformance.packs.table1.robot.clock import Clock
from conformance.packs.table1.robot.examples import Examples
from conformance.packs.table1.statement import Statement, StatementFile, said_of
from conformance.transport.exchange import Listener
from conformance.verdict.evidence import Checker

if TYPE_CHECKING:
    from conformance.packs.table1.checkers.deliveries import Deliveries
    from conformance.packs.table1.checkers.interfaces import AcrossInterfaces
    from conformance.packs.table1.robot.refused_requests import RefusedRequests

_TEMPLATE = """
[limits]
# What is not declared is judged with the reference robot's limits halved, 2 s to settle, and no check of the hold time.
# linear_m_s = 0.7           # greatest speed, or a pair: [0.0, 0.7] has no reverse gear
# angular_rad_s = 2.5        # greatest turning rate, or a pair
# lateral_m_s = 0.5          # greatest speed aside, if it differs
# navigation_linear_m_s = 1.0     # greatest speed of its own navigation, if it differs
# navigation_angular_rad_s = 2.5
# settle_s = 0.6             # a commanded velocity is reached within
# hold_s = 1.0               # a velocity holds for, unless renewed
# tolerance = 0.05           # of a reached velocity, relative
# tolerance_linear_m_s = 0.02     # and absolute
# tolerance_angular_rad_s = 0.02
# goal_m = 0.25              # a goal ends within this of its position
# goal_rad = 0.25            # and of its heading
# goal_s = 30.0              # a hindered robot may make no progress for
# plan_step_m = 1.0          # longest step of a plan
# clock_offset_s = 0.0       # the odometry's stamps are ahead of Date by

[motion]
# Where the robot may be driven. Without an arena, goals stay within radius_m of where it is.
# arena = [0.0, 0.0, 10.0, 5.0]       # x_min, y_min, x_max, y_max, m
# radius_m = 1.0
# frame = "map"
# goals = [[1.0, 2.0, 0.0]]           # x, y, yaw: poses that can be reached
# odom_to_map = [0.0, 0.0, 0.0]       # x, y, yaw of the odometry frame in the map
# actuated = ["linear.x", "angular.z"]
# turns_on_the_spot = false           # and the radius of the narrowest circle:
# min_radius_m = 0.5
# wheel_separation_m = 0.3            # if a robot that turns drives slower; 0: if it does not

[ros]
# With a domain, a probe watches what reaches ROS (needs rclpy where the suite runs).
# domain_id = 0
# delivery_topic = "/DeliveryRequestMsg/from_json"
# cmd_vel_topic = "/cmd_vel"
"""

__all__ = ["Device", "Statement", "StatementFile"]


class Device(device.Device):
    """The paper's robot in one run. Its modules are imported when they are needed: statements are read without them."""

    is_known = True
    statement_template = _TEMPLATE
    doubts = MappingProxyType({"safety": "to claim it, declare limits and hold time below"})
    fixtures = ("conformance.packs.table1.fixtures",)
    comes_and_goes = frozenset({"GetGoal"})
    #: Checkers for which one more reading may decide whether something is wrong.
    doubting: "tuple[AcrossInterfaces, ...]" = ()

    @property
    def settle_s(self) -> float:
        """Time within which a commanded velocity is reached, s."""
        return said_of(self.run).limits.settle_s

    @property
    def hold_s(self) -> float | None:
        """Time for which a velocity holds unless renewed, s; None if not declared."""
        return said_of(self.run).limits.hold_s

    @cached_property
    def delivery_checkers(self) -> "list[Deliveries]":
        """Return the checkers of the run's deliveries; empty without a REST interface."""
        return []

    @cached_property
    def refusal_stores(self) -> "list[RefusedRequests]":
        """Return the store of refused requests; empty without a REST interface."""
        return []

    @cached_property
    def _examples(self) -> Examples:
        from conformance.packs.table1.robot.examples import Examples  # noqa: PLC0415 - see the class

        return Examples(said_of(self.run))

    @cached_property
    def clock(self) -> Clock:
        """The robot's clock, as the stamps of all responses in the run show it."""
        from conformance.packs.table1.robot.clock import Clock  # noqa: PLC0415 - see the class

        return Clock()

    def fit(self, api: device.Rest, operation_id: str, value: Any) -> Any:
        """Return a valid value of an operation within the robot's limits, near where it is, in its frames."""
        return self._examples.fit(api, operation_id, value)

    def mark(self, operation_id: str, value: Any) -> Any:
        """Return a goal with an id of the suite's own; any other value unchanged."""
        return {**value, "goal_id": {"id": "written as XML"}} if operation_id == "putGoal" else value

    def answers_alike(self, template: str) -> bool:
        """Return whether a resource's responses to equal requests are equal."""
        from conformance.packs.table1.robot.robot import LINEAR, SENSORS, SERVICES, VELOCITY  # noqa: PLC0415

        return template in {VELOCITY, LINEAR, SENSORS, SERVICES}

    def is_near(self, place: str, shown: Any, wanted: Any) -> bool:
        """Return whether a read value equals the sent one within the declared tolerance."""
        if not (isinstance(shown, float) and isinstance(wanted, float)):
            return bool(shown == wanted)
        limits = said_of(self.run).limits
        room = limits.tolerance_angular_rad_s if "angular" in place else limits.tolerance_linear_m_s
        return abs(shown - wanted) <= room + limits.tolerance * abs(wanted)

    def messages(self, service: device.Soap, operation: SoapOperation) -> Iterator[Node]:
        """Yield SOAP messages that the robot accepts, likeliest first; empty if the default message suffices."""
        from conformance.packs.table1.robot.soap_services import known_messages  # noqa: PLC0415 - see the class

        return known_messages(service, operation)

    def questions(self, api: device.Rest) -> Iterable[device.Question]:
        """Return requests for plans to several poses, whose responses can be told apart."""
        from conformance.packs.table1.robot.plan import plan_questions  # noqa: PLC0415 - see the class

        return plan_questions(api)

    def listeners(self, api: device.Rest) -> Iterable[Listener]:
        """Return the listener that keeps refused requests."""
        from conformance.packs.table1.robot.refused_requests import RefusedRequests  # noqa: PLC0415 - see the class

        self.refusal_stores.append(RefusedRequests(api))
        return self.refusal_stores

    def checkers(self, api: device.Rest | None, services: Iterable[device.Soap]) -> Iterable[Checker]:
        """Return the checkers of every exchange with the robot's resources and services."""
        # Imported here: see the class.
        from conformance.packs.table1.checkers.deliveries import Deliveries  # noqa: PLC0415
        from conformance.packs.table1.checkers.goals import Goals  # noqa: PLC0415
        from conformance.packs.table1.checkers.interfaces import AcrossInterfaces, Lists  # noqa: PLC0415
        from conformance.packs.table1.checkers.plans import Plans  # noqa: PLC0415
        from conformance.packs.table1.checkers.soap_responses import SoapPoses, SoapResponses  # noqa: PLC0415
        from conformance.packs.table1.checkers.state import State  # noqa: PLC0415

        validity = SoapResponses(services)
        if api is None:
            return [validity]
        url, said = api.client.url, said_of(self.run)
        self.delivery_checkers.append(Deliveries(url, has_probe=said.ros.domain_id is not None))
        self.doubting = (AcrossInterfaces(url, said.limits),)
        state = State(url, said.limits, self.clock, api.client.connection.credentials)
        judges: list[Checker] = [validity, state, Goals(url), Plans(url, said), Lists(url), SoapPoses(url)]
        judges += [*self.doubting, *self.delivery_checkers]
        return judges

    def halt(self, api: device.Rest) -> None:
        """Cancel the robot's goal and stop it, without waiting until it stands still."""
        from conformance.packs.table1.robot.stopping import halt  # noqa: PLC0415 - see the class

        halt(api)

    def bring_to_rest(self, api: device.Rest) -> str:
        """Cancel the robot's goal and wait until it stands still; return why it does not, or an empty text."""
        from conformance.packs.table1.robot.stopping import bring_to_rest  # noqa: PLC0415 - see the class

        return bring_to_rest(api)

    def leave_at_rest(self, api: device.Rest) -> str:
        """Stop the robot at the end of a run; never raises, and returns within seconds."""
        from conformance.packs.table1.robot.stopping import leave_at_rest  # noqa: PLC0415 - see the class

        return leave_at_rest(api)
