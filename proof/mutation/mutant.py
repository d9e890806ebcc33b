"""A mutant: a good device with one change between it and its clients, and the requirements that must kill it."""

from collections.abc import Callable
from dataclasses import dataclass

from proof.mutation.messages import Change, IncompleteRequest


@dataclass(frozen=True)
class Mutant:
    """One mutant.

    Attributes:
        name: its unique name.
        says: a sentence that says what is wrong with the device.
        catches: ids of the requirements of which each must fail (MUST) or warn (SHOULD).
        interface: "rest", "soap" or "both".
        make: returns a new instance of the change, for one run.
        incomplete_request: returns what handles requests that clients never complete, or None.
        probe: whether only a ROS probe can observe the fault.
        observer: whether only a ROS probe, or a device that shows what reached it, can observe the fault.
        token: the bearer token that the device requires, or an empty text.
        serial: whether the device reads the next request only after the previous one is complete.
        backwards: whether the device answers the second of two pipelined requests first.
        forgetful: whether the device answers only the first of pipelined requests.
    """

    name: str
    says: str
    catches: tuple[str, ...]
    interface: str
    make: Callable[[], Change]
    incomplete_request: Callable[[], IncompleteRequest] | None = None
    probe: bool = False
    observer: bool = False
    token: str = ""
    serial: bool = False
    backwards: bool = False
    forgetful: bool = False
