"""The robot's end of a gateway: a ROS node in a process of its own, which follows commands (ros_probe/player.py)."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Final

from conformance.scenarios.ros.definition import Definition
from ros_probe.process import ProbeError, RosProcess

_NS: Final = 1_000_000_000


@dataclass(frozen=True)
class Heard:
    """A message, request or goal that the robot received.

    Attributes:
        at: when, s of the monotonic clock.
        what: message, request, goal, cancel or the like.
        value: JSON of it, with NaN and infinities bare.
    """

    at: float
    what: str
    value: str

    @property
    def content(self) -> Any:
        """The value itself."""
        return json.loads(self.value)


@dataclass(frozen=True)
class Published:
    """The outcome of publishing.

    Attributes:
        at: when the first message was handed to ROS, s of the monotonic clock.
        reliably: whether all subscribers have each message sent again that is lost on the way.
    """

    at: float
    reliably: bool


class Robot(RosProcess):
    """A started node.

    Args:
        domain_id: the domain id of the graph.
        name: the name of the node; each process has another one.

    Raises:
        ProbeError: the process cannot be started.
    """

    def __init__(self, domain_id: int, name: str = "roaas_robot") -> None:
        super().__init__(f"{name}_{os.getpid()}", domain_id=domain_id)
        self._definitions: dict[str, Definition] = {}

    def definition(self, name: str) -> Definition:
        """Return the definition of a type, or, with "#Request" or the like after its name, of a part of it.

        Raises:
            ProbeError: the type is not installed.
        """
        if name not in self._definitions:
            self._definitions[name] = Definition(name, self.tell("describe", type=name)["types"])
        return self._definitions[name]

    def publish(self, topic: str, type_: str, *values: Any, **how: Any) -> Published:
        """Publish messages.

        Raises:
            ProbeError: see tell().
        """
        said = self.tell("publish", topic=topic, type=type_, values=values, **how)
        sent = said["sent"]
        return Published(sent[0] / _NS if sent else time.monotonic(), not said["best_effort"])

    def take_heard(self, name: str, count: int = 0, within_s: float = 0.0) -> list[Heard]:
        """Return the messages that a topic, service or action received since the last call; wait for ``count`` of them.

        Raises:
            ProbeError: see tell().
        """
        events = self.tell("heard", name=name, count=count, within_s=within_s)["events"]
        return [Heard(at / _NS, what, json.dumps(value)) for at, what, value in events]

    def names(self, what: str) -> set[str]:
        """Return the names on the graph of "topics", "services", "actions" or "nodes"."""
        return set(self.tell("graph")[what])

    def count(self, topic: str, ends: str) -> int:
        """Return how many "publishers" or "subscribers" a topic has on the graph."""
        return int(self.tell("graph")["topics"].get(topic, {}).get(ends, 0))

    def count_clients(self, service: str) -> int:
        """Return how many clients a service has on the graph."""
        return int(self.tell("graph")["clients"].get(service, 0))

    @contextmanager
    def publishing(self, topic: str) -> Iterator[None]:
        """Leave a topic in the end."""
        try:
            yield
        finally:
            self.tell("forget", name=topic)


__all__ = ["Heard", "ProbeError", "Robot"]
