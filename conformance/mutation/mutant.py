"""What a mutant is: one change between a client and a good robot, and what must notice it."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from conformance.mutation.messages import Change, IncompleteRequest


@dataclass(frozen=True)
class Mutant:
    """A mutant.

    Attributes:
        name: its name, unique.
        says: one sentence on what is wrong with it.
        catches: ids of the requirements each of which must say fail (MUST) or warn (SHOULD).
        interface: "rest", "soap" or "both".
        make: makes the change for one run.
        incomplete_request: makes what is done with requests that are never completed, or None.
        probe: whether only a ROS probe can see it.
        observer: whether only a ROS probe, or a device that shows what reached it, can see it.
        token: bearer token that the robot wants, or empty.
        serial: whether the robot takes the next request only when the one before is complete.
        backwards: whether of two requests that were sent at once on one connection the second is answered first.
        forgetful: whether of requests that were sent at once on one connection the first alone is answered.
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


def of_class(class_: str, interface: str, **common: Any) -> Callable[..., Mutant]:
    """A maker of mutants that requirements of one class catch: their names in the class, or the only one's.

    A requirement of another class is named with it; ``common`` are settings of them all.
    """

    def mutant(name: str, says: str, catches: str | tuple[str, ...], make: Callable[[], Change], **more: Any) -> Mutant:
        names = (catches,) if isinstance(catches, str) else catches
        settings: dict[str, Any] = {"interface": interface, **common, **more}
        return Mutant(
            name, says, tuple(one if "/" in one else f"{class_}/{one}" for one in names), make=make, **settings
        )

    return mutant
