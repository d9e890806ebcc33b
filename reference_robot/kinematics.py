"""The bodies that a reference robot can have: what each can drive, and how its web services and navigation follow."""

from dataclasses import dataclass, field
from typing import Final

#: The usual body: two wheels, which turn it on the spot.
DIFFERENTIAL: Final = "differential"


@dataclass(frozen=True)
class Accelerations:
    """The largest accelerations of a drive: linear in m/s², angular in rad/s²."""

    linear: float = 4.0
    angular: float = 12.0


@dataclass(frozen=True)
class Kinematics:
    """What a body can drive.

    Attributes:
        reverses: Whether it drives back.
        min_radius: The narrowest circle, m; 0 for a body that turns on the spot.
        max_lateral: The greatest speed aside, m/s; 0 for a body on usual wheels.
        accelerations: Its accelerations.
        cruise: The greatest speed on the way to a goal, m/s; turn: the greatest turning rate there, rad/s.
        web: The keys of ``[web]`` that follow from it, in place of those of the configuration file.
        patrols: Whether it has goals of its own until somebody cancels one.
    """

    reverses: bool = True
    min_radius: float = 0.0
    max_lateral: float = 0.0
    accelerations: Accelerations = Accelerations()
    cruise: float = 0.6
    turn: float = 1.8
    web: dict[str, float] = field(default_factory=dict)
    patrols: bool = False


#: The bodies by name, as the option ``--kinematics`` takes them.
KINEMATICS: Final = {
    DIFFERENTIAL: Kinematics(),
    "ackermann": Kinematics(min_radius=0.3, turn=1.2, web={"min_radius": 0.3}),
    "no-reverse": Kinematics(reverses=False, web={"max_reverse": 0.0}),
    "holonomic": Kinematics(max_lateral=0.5, web={"max_lateral": 0.5}),
    # Its own navigation is faster than its clients may be; it answers late, and patrols.
    "slow-and-busy": Kinematics(
        accelerations=Accelerations(linear=0.6, angular=2.0),
        cruise=0.4,
        turn=0.8,
        web={"max_linear": 0.2, "max_angular": 0.5, "lag": 0.02},
        patrols=True,
    ),
}
