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
        if permitted():
            self._set_up(stack)

    def _set_up(self, stack):
        for place in ("middle", *_SIDES):
            name = f"roaas-{os.getpid()}-{place}"
            ip(f"netns add {name}")
            stack.callback(ip, f"netns delete {name}")
            self._names[place] = name
            ip(f"-n {name} link set dev lo up")
        ip(f"-n {self._names['middle']} address add {ROBOT}/32 dev lo")
        for place, net in _SIDES.items():
            far = f"to-{place} netns {self._names['middle']}"
            ip(f"-n {self._names[place]} link add name eth0 type veth peer name {far}")
            for name, device, host in ((self._names["middle"], f"to-{place}", 1), (self._names[place], "eth0", 2)):
                ip(f"-n {name} address add {net}.{host}/24 dev {device}")
                ip(f"-n {name} link set dev {device} up")
            ip(f"-n {self._names[place]} route add {ROBOT}/32 via {net}.1")
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


def permitted():
    """Whether this process may make namespaces of networks and of clocks, and has the programs for it."""
    try:
        words = ["unshare", "--net", "--time", "--monotonic", "1", "ip", "link"]
        tried = subprocess.run(words, check=False, capture_output=True)
    except OSError:
        return False
    return tried.returncode == 0 and os.geteuid() == 0


def ip(words):
    """Run iproute2's `ip`."""
    subprocess.run(["ip", *words.split()], check=True, capture_output=True)
