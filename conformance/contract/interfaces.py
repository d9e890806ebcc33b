"""The interfaces that a robot may have, and which of them each conformance class needs."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

from conformance.contract.classes import ConformanceClass

if TYPE_CHECKING:
    from collections.abc import Collection


class Interface(StrEnum):
    """One interface: REST, the SOAP service that acts, the SOAP service that only reads."""

    REST = "rest"
    PUBLISHERS = "publishers"
    SUBSCRIBERS = "subscribers"


SOAP = (Interface.PUBLISHERS, Interface.SUBSCRIBERS)
EVERY = tuple(Interface)


@dataclass(frozen=True)
class Need:
    """What a class needs of a robot.

    Attributes:
        interfaces: those that it judges.
        each: whether each that is there has to answer; else one is enough.
    """

    interfaces: tuple[Interface, ...]
    each: bool = True

    def missing(self, there: Collection[Interface], described: Collection[Interface] = EVERY) -> tuple[Interface, ...]:
        """What the class would judge, of what the contract describes, and the robot has no address of."""
        return tuple(name for name in self.interfaces if name in described and name not in there)


_REST = Need((Interface.REST,))
NEEDS: dict[str, Need] = {
    ConformanceClass.REST_RESOURCES: _REST,
    ConformanceClass.REST_DELIVERY: _REST,
    ConformanceClass.REST_FORMATS: _REST,
    ConformanceClass.HTTP: _REST,
    ConformanceClass.SAFETY: _REST,
    ConformanceClass.SOAP_DELIVERY: Need((Interface.PUBLISHERS,)),
    ConformanceClass.SOAP_SUBSCRIBERS: Need((Interface.SUBSCRIBERS,)),
    ConformanceClass.SOAP_BASIC_PROFILE: Need(SOAP, each=False),
    ConformanceClass.STRICT_INPUT: Need(EVERY),
    ConformanceClass.XML_SECURITY: Need(EVERY, each=False),
    ConformanceClass.EQUIVALENCE: Need(EVERY),
    ConformanceClass.DESCRIBE: Need(EVERY),
}
