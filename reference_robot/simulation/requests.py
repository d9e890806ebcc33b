"""The delivery requests that arrive on the ROS topic, read in batches.

Waking a Python thread for each message costs this process 40 µs and takes a processor from the sender. On a small
robot's machine that is the processor of the client that waits for its response. So the first message wakes a thread,
and messages of the next 5 ms are read together. Until then Fast DDS stores and acknowledges them.
"""

from collections.abc import Callable, Iterator
from itertools import islice
from typing import Final

from mybot_delivery_app.msg import DeliveryRequestMsg
from rclpy.node import Node
from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy

from reference_robot.deliveries import DeliveryRequest
from reference_robot.names import RosNames
from reference_robot.ros import RosRuntime, waiting_messages

# No request is lost: unread messages are kept, and a publisher with KEEP_ALL waits when the queue is full.
_QOS: Final = QoSProfile(history=HistoryPolicy.KEEP_ALL, reliability=ReliabilityPolicy.RELIABLE)
# A batch occupies a processor: the messages of 50 ms for 3 ms, the messages of 5 ms for 0.3 ms.
_PAUSE_S: Final = 0.005
_MOST: Final = 5000  # messages that Fast DDS keeps; others may arrive while a batch is read


class DeliveryRequests:
    """A subscription to the topic of delivery requests that is read in batches."""

    def __init__(self, ros: RosRuntime, names: RosNames) -> None:
        self._ros = ros
        node = ros.create_node("delivery_requests", spun=False)
        self._subscription = node.create_subscription(
            DeliveryRequestMsg, names.topics.delivery, lambda _: None, _QOS, raw=True
        )

    def watch(self, node: Node, callback: Callable[[], None]) -> None:
        """Call ``callback`` in a node's thread whenever requests are waiting to be read."""
        self._ros.watch(self._subscription, node, callback, _PAUSE_S)

    def waiting(self) -> Iterator[DeliveryRequest]:
        """Yield the waiting requests, oldest first, and remove them from the subscription's queue."""
        return map(DeliveryRequest.of, islice(waiting_messages(self._subscription), _MOST))
