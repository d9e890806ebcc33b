"""Goals that a robot cannot take: outside its map, in an unknown frame, or with an invalid quaternion."""

from dataclasses import dataclass, field, replace
from http import HTTPStatus
from typing import Any, Final

from conformance.packs.table1.robot.geometry import Pose
from conformance.packs.table1.robot.goal import NEW, REPEATED, await_none, goal_body, put_goal
from conformance.packs.table1.robot.goal_trace import FarGoal, RefusedGoals, SpecialGoal
from conformance.packs.table1.robot.goals import choose_goals
from conformance.packs.table1.robot.robot import Robot
from conformance.scenarios.scenario import partial_trace, scenario
from conformance.scenarios.stage import Need

# _GIVES_UP_S: time in which a robot may search a way and try its recoveries before it ends the goal
# (contract.md#goals), s.
_GIVES_UP_S: Final = 60.0
_FAR: Final = (Pose(1e6, 1e6, 0.0), Pose(-1e6, 0.0, 1.0), Pose(1e300, -1e300, 0.0))
_NOT_UNIT: Final = (0.0, 0.5, 0.99, 0.9975, 1.0025, 1.005, 1.009, 1.01, 2.0, 1e200)
_UNIT: Final = (0.9991, 1.0009)
_UNKNOWN_FRAMES: Final = ("no_such_frame", "map2")


@scenario(needs={Need.REST, Need.MOTION})
def refused_goals(robot: Robot) -> RefusedGoals:
    """Put goals outside the map, in unknown frames, and with quaternions of many lengths."""
    (near,) = choose_goals(robot, 1.0, 1)
    player = _Player(robot)
    with partial_trace(lambda: player.goals):
        player.play(near)
    return player.goals


@dataclass
class _Player:
    """One play of the scenario."""

    robot: Robot
    goals: RefusedGoals = field(default_factory=RefusedGoals)

    def play(self, near: Pose) -> None:
        """Play the scenario with a pose that the robot can reach."""
        robot, frame = self.robot, self.robot.statement.motion.frame
        for length in _NOT_UNIT:
            put = self._put_invalid(goal_body(near, frame, length=length), f"a quaternion of length {length:g}")
            self.goals = replace(self.goals, not_unit=(*self.goals.not_unit, put))
        for length in _UNIT:
            exchange = put_goal(robot, goal_body(near, frame, length=length))
            put = SpecialGoal(f"a quaternion of length {length:g}", exchange)
            self.goals = replace(self.goals, unit=(*self.goals.unit, put))
        robot.delete_goal()
        await_none(robot)
        for unknown in _UNKNOWN_FRAMES:
            if unknown != frame:
                put = self._put_invalid(goal_body(near, unknown), f"the unknown frame {unknown!r}")
                self.goals = replace(self.goals, unknown_frames=(*self.goals.unknown_frames, put))
        # All at once: if the robot stops responding meanwhile, their requirement has failed.
        self.goals = replace(self.goals, far=self._put_far(frame))

    def _put_invalid(self, body: dict[str, Any], special: str) -> SpecialGoal:
        """PUT an invalid goal, and cancel it if the robot accepts it."""
        exchange = put_goal(self.robot, body)
        if exchange.response.status < HTTPStatus.BAD_REQUEST:
            self.robot.delete_goal()
        return SpecialGoal(special, exchange)

    def _put_far(self, frame: str) -> tuple[FarGoal, ...]:
        """PUT goals outside every map, until one stays active."""
        far: list[FarGoal] = []
        for pose in _FAR:
            exchange, read = put_goal(self.robot, goal_body(pose, frame)), None
            if exchange.response.status in NEW | REPEATED:
                read = await_none(self.robot, _GIVES_UP_S)
            far.append(FarGoal(exchange, read, _GIVES_UP_S))
            if read is not None and read.response.status != HTTPStatus.NOT_FOUND:
                self.robot.delete_goal()
                break
        return tuple(far)
