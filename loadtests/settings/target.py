"""What a run calls: the paper's robot, or a device with a description."""

from dataclasses import dataclass, field

from conformance.statement.load import ServiceLevel
from loadtests.clients.robot import Robot
from loadtests.settings.settings import Scenario, Selection, Streams


@dataclass(frozen=True)
class Target:
    """What a run calls.

    Attributes:
        robot: with the addresses of the selected interfaces only.
        selection: operations, interfaces and clients, complete.
        moves: whether an operation moves the robot or changes something.
        steps_move: the same of the operation whose rate the load steps raise.
        other: the robot to compare with, of a device with a description.
        description: where the description is from; None for the paper's robot.
        slo: the service levels of the operations, by their names.
        notes: what the result should say of the choice.
        streams: what to listen to.
        scenario: what the users do, if a scenario says that.
    """

    robot: Robot
    selection: Selection
    moves: bool
    steps_move: bool
    other: Robot | None = None
    description: str | None = None
    slo: dict[str, ServiceLevel] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    streams: Streams = field(default_factory=Streams)
    scenario: Scenario | None = None

    @property
    def rate_of_levels(self) -> float | None:
        """Return the lowest rate of all requests at which each operation has the rate that its service level is for.

        None where no level names a rate.
        """
        names = self.selection.operations
        shares = dict(zip(names, self.selection.weights or (1,) * len(names), strict=True))
        rates = [
            level.at_rate * sum(shares.values()) / shares[name]
            for name, level in self.slo.items()
            if level.at_rate is not None
        ]
        return max(rates, default=None)
