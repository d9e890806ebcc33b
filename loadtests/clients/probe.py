"""The load test's end of the probes, which waits for them without blocking other greenlets."""

import json
import time
from contextlib import suppress

from ros_probe.process import RosProcess, SilentError


class Probe(RosProcess):
    """A process on the ROS graph, in the role `listen` or `publish`; call `await_ready` first."""

    def __init__(self, role: str, domain_id: int, topic: str) -> None:
        super().__init__(role, "--delivery-topic", topic, domain_id=domain_id)

    def publish(self, values: tuple[float, ...]) -> int:
        """Publish a delivery; returns when that began (CLOCK_MONOTONIC, ns).

        Raises:
            ProbeError: it has ended.
        """
        return int(self.ask(json.dumps([float(value).hex() for value in values]))["sent_ns"])

    def arrival_ns(self, values: tuple[float, ...], within_s: float) -> int | None:
        """Return the time at which a listener received a delivery with these values; None if it does not come in time.

        Raises:
            ProbeError: the probe's process has ended.
        """
        wanted = [float(value).hex() for value in values]
        until = time.monotonic() + within_s
        with suppress(SilentError):
            while True:
                ((at_ns, *heard),) = self.told(max(0.0, until - time.monotonic()))["deliveries"]
                if heard == wanted:
                    return int(at_ns)
        return None
