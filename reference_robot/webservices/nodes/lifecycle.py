"""The lifecycle states of the navigation's managed nodes; inactive nodes refuse every request."""

from typing import Final

from lifecycle_msgs.msg import State
from lifecycle_msgs.srv import GetState
from rclpy.node import Node

from reference_robot.webservices.nodes.calls import RosCalls
from reference_robot.webservices.representation.problems import Problem, not_yet

_UNMANAGED: Final = "unmanaged"
_SILENT: Final = "silent"


class ManagedNode:
    """A named ROS node that may have a lifecycle (ROS 2 design, "Managed nodes"); without one it counts as active."""

    def __init__(self, node: Node, calls: RosCalls, name: str) -> None:
        self._calls = calls
        self._name = name
        self._states = node.create_client(GetState, f"{name}/get_state")

    async def state(self) -> str:
        """Return the node's state, such as "active".

        "unmanaged" means that the node has no lifecycle, "silent" that it does not respond.
        """
        if not self._states.service_is_ready():
            return _UNMANAGED
        try:
            reply = await self._calls.result(lambda: self._states.call_async(GetState.Request()), self._name)
        except Problem:
            return _SILENT
        label: str = reply.current_state.label
        return "active" if reply.current_state.id == State.PRIMARY_STATE_ACTIVE else label or "unknown"

    async def require_active(self) -> None:
        """Raise the Problem 503 if the node has a lifecycle and is not active."""
        state = await self.state()
        if state not in {"active", _UNMANAGED}:
            raise not_yet(f"the robot's {self._name} is {state}, not active")
