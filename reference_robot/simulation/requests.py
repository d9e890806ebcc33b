"""The delivery requests that come on the topic, taken many at a time.

To wake a thread of Python for each message costs this process 40 µs, and whoever sent it a processor meanwhile: on the
machine of a small robot that is the processor of the client that waits for its answer. So the first that comes wakes
one, and what comes in the next 5 ms waits for their end. Fast DDS keeps it, and acknowledges it, until then.
"""

from collections.abc import Callable, Iterator
from itertools import islice
from typing import Final

from mybot_delivery_app.msg import DeliveryRequestMsg
from rclpy.node import Node
from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy

from reference_robot.deliveries import DeliveryRequest
from reference_robot.names import RosNames
from reference_robot.ros import RosRuntime, taken

# No request is lost: what has not been taken yet is kept, and a publisher that keeps all as well is held back.
_QOS: Final = QoSProfile(history=HistoryPolicy.KEEP_ALL, reliability=ReliabilityPolicy.RELIABLE)
# Many messages at once keep a processor: those of 50 ms for 3 ms, those of 5 for 0.3.
_PAUSE_S: Final = 0.005
_MOST: Final = 5000  # that Fast DDS keeps; more come only while these are taken


class DeliveryRequests:
    """What has come, to be taken."""

    def __init__(self, ros: RosRuntime, names: RosNames) -> None:
        self._ros = ros
        node = ros.create_node("delivery_requests", spun=False)
        self._subscription = node.create_subscription(
            DeliveryRequestMsg, names.topics.delivery, lambda _: None, _QOS, raw=True
        )

    def tell(self, node: Node, callback: Callable[[], None]) -> None:
        """Have it called in a node's thread when some wait."""
        self._ros.watch(self._subscription, node, callback, _PAUSE_S)

    def taken(self) -> Iterator[DeliveryRequest]:
        """Take what waits, oldest first."""
        return map(DeliveryRequest.of, islice(taken(self._subscription), _MOST))
