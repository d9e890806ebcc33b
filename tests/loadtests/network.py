"""Machines in a network of their own: namespaces for the master, the workers and what lies between, where permitted.

Master and workers have no route to one another but through `middle`, where a relay and the robot are. A worker may
have a monotonic clock of its own. Where the system permits no namespaces, all are on loopback and share its clock.
"""

import os
import subprocess
from contextlib import ExitStack

ROBOT = "10.99.0.1"
_SIDES = {"master": "10.99.1", "workers": "10.99.2"}


class Network:
    """Addresses, and the words to put before a command that is to run on a machine."""

    def __init__(self, stack: ExitStack):
        self._names = {}
        self.clock_ahead_s = 0
        try:
            self._set_up(stack)
        except (OSError, subprocess.CalledProcessError):
            self._names = {}

    def _set_up(self, stack):
        for place in ("middle", *_SIDES):
            name = f"roaas-{os.getpid()}-{place}"
            ip(f"netns add {name}")
            stack.callback(ip, f"netns delete {name}")
            self._names[place] = name
            ip(f"-n {name} link set lo up")
        ip(f"-n {self._names['middle']} address add {ROBOT}/32 dev lo")
        for place, net in _SIDES.items():
            ip(f"-n {self._names[place]} link add up type veth peer name {place} netns {self._names['middle']}")
            for name, device, host in ((self._names["middle"], place, 1), (self._names[place], "up", 2)):
                ip(f"-n {name} address add {net}.{host}/24 dev {device}")
                ip(f"-n {name} link set {device} up")
            ip(f"-n {self._names[place]} route add {ROBOT}/32 via {net}.1")
        subprocess.run(["unshare", "--time", "--monotonic", "1", "true"], check=True, capture_output=True)
        self.clock_ahead_s = 4321

    def on(self, place, *, own_clock=False):
        """The words before a command."""
        if not self._names:
            return []
        clock = ["unshare", "--time", "--monotonic", str(self.clock_ahead_s), "--fork", "--kill-child"]
        return ["ip", "netns", "exec", self._names[place], *(clock if own_clock else [])]

    def address(self, place, *, seen_from=None):
        """Where a machine is; the middle has an address towards each side, and one for both."""
        if not self._names:
            return "127.0.0.1"
        if place == "middle":
            return f"{_SIDES[seen_from]}.1" if seen_from else ROBOT
        return f"{_SIDES[place]}.2"


def ip(words):
    """Run iproute2's `ip`."""
    subprocess.run(["ip", *words.split()], check=True, capture_output=True)
