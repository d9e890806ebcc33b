"""The nodes of a robot with Nav2, each in a process of its own, as far as a client on the graph can tell.

Run as ``python nav2_nodes.py DOMAIN base|navigator|client [OPTION] [--ros-args ...]``. Like foreign_robot.py it prints
what it sees, one JSON object a line, and takes commands on its stdin.

base: tells ``velocity``; ``{"odometry": X}`` publishes odometry at x = X, null stops it. OPTION is what it takes: Twist
or TwistStamped. ``{"clock": S}`` publishes /clock with S seconds.
navigator: tells ``goal`` and ``cancel``, plans straight ahead; ``{"state": "inactive"}`` refuses goals and plans, as
a bt_navigator and a planner_server do that are not active; ``{"answers": false}`` lets goals wait for their answer;
``{"finish": true}`` ends its goal with success; ``{"server": false}`` takes its action server off the graph and
nothing else, ``{"server": true}`` makes another one; tells ``server`` when that is done.
client: ``{"goal": X}`` sends a goal to x = X, as RViz does; tells ``accepted`` with its id, ``ended`` with its status.
"""

import sys
import threading
from typing import Any

import rclpy
from action_msgs.msg import GoalStatus
from builtin_interfaces.msg import Time
from foreign_robot import spin, tell
from geometry_msgs.msg import Twist, TwistStamped
from lifecycle_msgs.msg import State
from lifecycle_msgs.srv import GetState
from nav2_msgs.action import ComputePathToPose, NavigateToPose
from nav_msgs.msg import Odometry
from rclpy.action import ActionClient, ActionServer, CancelResponse, GoalResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.context import Context
from rclpy.node import Node
from rosgraph_msgs.msg import Clock

STATES = {"inactive": State.PRIMARY_STATE_INACTIVE, "active": State.PRIMARY_STATE_ACTIVE}


class Base(Node):
    def __init__(self, context: Context, velocity: str) -> None:
        super().__init__("base", context=context)
        self._x: float | None = 0.0
        self._clock_now: int | None = None
        self._clocks = self.create_publisher(Clock, "/clock", 10)
        self._odometry = self.create_publisher(Odometry, "odom", 10)
        self.create_timer(0.02, self._publish)
        kind = {"Twist": Twist, "TwistStamped": TwistStamped}[velocity]
        self.create_subscription(kind, "cmd_vel", self._velocity, 10)

    def _publish(self) -> None:
        if self._clock_now is not None:
            self._clocks.publish(Clock(clock=Time(sec=self._clock_now)))
        if self._x is not None:
            message = Odometry(child_frame_id="base_link")
            message.header.frame_id = "odom"
            message.header.stamp = self.get_clock().now().to_msg()
            message.pose.pose.position.x = self._x
            self._odometry.publish(message)

    def _velocity(self, message: Any) -> None:
        stamped = isinstance(message, TwistStamped)
        twist = message.twist if stamped else message
        header = {"frame": message.header.frame_id, "sec": message.header.stamp.sec} if stamped else {}
        tell(velocity={"x": twist.linear.x} | header)

    def obey(self, command: dict[str, Any]) -> None:
        if "odometry" in command:
            self._x = command["odometry"]
        self._clock_now = command.get("clock", self._clock_now)


class Navigator(Node):
    def __init__(self, context: Context, _option: str) -> None:
        super().__init__("bt_navigator", context=context)
        self._state = "active"
        self._answers = threading.Event()
        self._answers.set()
        self._finished = threading.Event()
        group = ReentrantCallbackGroup()
        for name in ("bt_navigator", "planner_server"):
            self.create_service(GetState, f"{name}/get_state", self._get_state, callback_group=group)
        calls = {"goal_callback": self._taken_when_active, "callback_group": group}
        self._planner = ActionServer(self, ComputePathToPose, "compute_path_to_pose", self._plan, **calls)
        self._group = group
        self._server: ActionServer | None = self._serve()

    def _taken_when_active(self, _goal: Any) -> GoalResponse:
        return GoalResponse.ACCEPT if self._state == "active" else GoalResponse.REJECT

    def _serve(self) -> ActionServer:
        calls = {"goal_callback": self._goal, "cancel_callback": self._cancel, "callback_group": self._group}
        return ActionServer(self, NavigateToPose, "navigate_to_pose", self._drive, **calls)

    def _get_state(self, _request: GetState.Request, response: GetState.Response) -> GetState.Response:
        response.current_state = State(id=STATES[self._state], label=self._state)
        return response

    def _plan(self, handle: Any) -> ComputePathToPose.Result:
        result = ComputePathToPose.Result()
        result.path.header.frame_id = "map"
        result.path.poses = [handle.request.start, handle.request.goal]
        handle.succeed()
        return result

    def _goal(self, goal: NavigateToPose.Goal) -> GoalResponse:
        self._finished.clear()
        tell(goal=goal.pose.pose.position.x)
        self._answers.wait()
        return self._taken_when_active(goal)

    def _cancel(self, handle: Any) -> CancelResponse:
        tell(cancel=handle.request.pose.pose.position.x)
        return CancelResponse.ACCEPT

    def _drive(self, handle: Any) -> NavigateToPose.Result:
        while handle.status != GoalStatus.STATUS_CANCELING and self.context.ok():
            if self._finished.wait(0.01):
                handle.succeed()
                return NavigateToPose.Result()
        if self.context.ok():
            handle.canceled()
        return NavigateToPose.Result()

    def obey(self, command: dict[str, Any]) -> None:
        self._state = command.get("state", self._state)
        if command.get("answers", True):
            self._answers.set()
        else:
            self._answers.clear()
        if "finish" in command:
            self._finished.set()
        if "server" in command and command["server"] != (self._server is not None):
            if self._server is None:
                self._server = self._serve()
            else:
                self._server.destroy()
                self._server = None
            tell(server=self._server is not None)


class Client(Node):
    def __init__(self, context: Context, _option: str) -> None:
        super().__init__("rviz", context=context)
        self._actions = ActionClient(self, NavigateToPose, "navigate_to_pose")

    def obey(self, command: dict[str, Any]) -> None:
        self._actions.wait_for_server()
        goal = NavigateToPose.Goal()
        goal.pose.header.frame_id = "map"
        goal.pose.pose.position.x = command["goal"]
        self.executor.create_task(self._send, goal)

    def _send(self, goal: NavigateToPose.Goal) -> None:
        self._actions.send_goal_async(goal).add_done_callback(self._answered)

    def _answered(self, answer: Any) -> None:
        handle = answer.result()
        tell(accepted=bytes(handle.goal_id.uuid).hex())
        handle.get_result_async().add_done_callback(lambda ended: tell(ended=ended.result().status))


NODES: dict[str, Any] = {"base": Base, "navigator": Navigator, "client": Client}


def main() -> None:
    domain, role, *rest = sys.argv[1:]
    option = rest.pop(0) if rest and not rest[0].startswith("-") else "Twist"
    context = Context()
    rclpy.init(args=rest, context=context, domain_id=int(domain))
    _, spinner = spin(NODES[role](context, option), context)
    context.try_shutdown()
    spinner.join(2)


if __name__ == "__main__":
    main()
