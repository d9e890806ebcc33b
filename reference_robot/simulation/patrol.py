"""A robot's own business: it drives to and fro between two places until somebody cancels that."""

import itertools
from typing import Any, Final

from action_msgs.msg import GoalStatus
from nav2_msgs.action import NavigateToPose
from rclpy.action import ActionClient
from rclpy.node import Node
from std_msgs.msg import Header

from reference_robot.names import RosNames
from reference_robot.simulation.messages import stamped_pose

_PLACES: Final = ((68.0, 39.0, 0.0), (72.0, 39.0, 3.0))  # of the corridor
_RETRY_PERIOD_S: Final = 0.2


class Patrol:
    """An action client that sends the robot to one place after the other; another client's goal ends it as well."""

    def __init__(self, node: Node, names: RosNames) -> None:
        self._frame = names.frames.map
        self._places = itertools.cycle(_PLACES)
        self._navigate = ActionClient(node, NavigateToPose, names.actions.navigate_to_pose)
        self._begin = node.create_timer(_RETRY_PERIOD_S, self._go)

    def _go(self) -> None:
        if not self._navigate.server_is_ready():
            return
        self._begin.cancel()
        pose = stamped_pose(next(self._places), Header(frame_id=self._frame))
        self._navigate.send_goal_async(NavigateToPose.Goal(pose=pose)).add_done_callback(self._accepted)

    def _accepted(self, sent: Any) -> None:
        handle = sent.result()
        if handle is not None and handle.accepted:
            handle.get_result_async().add_done_callback(self._ended)

    def _ended(self, result: Any) -> None:
        if result.result().status == GoalStatus.STATUS_SUCCEEDED:
            self._begin.reset()
