"""The statement's tables for every client of the paper's robot: its ROS side, and its contract."""

from pathlib import Path
from typing import Annotated, Self

import msgspec

from conformance.contract.locating import folder_of
from conformance.contract.pack import Contract
from conformance.contract.toml_file import Text
from conformance.statement.statement import Statement, load_statement

#: The folder with the files of the contract, in a checkout and in a wheel alike.
CONTRACT_DIR = folder_of("table1")


class Ros(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The robot's ROS side, for the probe.

    Attributes:
        domain_id: its ROS domain; without it, no probe observes the robot.
        delivery_topic: topic on which it publishes deliveries.
        cmd_vel_topic: topic on which it publishes velocities.
    """

    domain_id: Annotated[int, msgspec.Meta(ge=0, le=232)] | None = None  # DDS's range
    delivery_topic: Text = "/DeliveryRequestMsg/from_json"
    cmd_vel_topic: Text = "/cmd_vel"


class RobotStatement(Statement, frozen=True):
    """A statement on the paper's robot, without the parts on how the robot is judged."""

    ros: Ros = Ros()

    @property
    def domain_id(self) -> int | None:
        """The ROS domain that a probe may join, or None."""
        return self.ros.domain_id

    def on_domain(self, domain_id: int) -> Self:
        """Return the statement with a ROS domain."""
        return msgspec.structs.replace(self, ros=msgspec.structs.replace(self.ros, domain_id=domain_id))


def load_robot_statement(path: Path) -> RobotStatement:
    """Read a statement on the paper's robot.

    Raises:
        StatementError: it cannot be read, or has an unknown key or a value of the wrong kind.
    """
    found = load_statement(path, Contract.load())
    if not isinstance(found, RobotStatement):
        raise TypeError(f"{path} was read as a statement on another kind of device")
    return found
