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
        named: whether it is about these and no others, so that each has to be there; else about whatever a robot has.
        each: whether each that is there has to answer; else one is enough.
    """

    interfaces: tuple[Interface, ...]
    named: bool = True
    each: bool = True

    def can_be_judged(self, there: Collection[Interface]) -> bool:
        """Whether the class can be judged by the interfaces that are there."""
        found = [name in there for name in self.interfaces]
        return all(found) if self.named else any(found)


_REST = Need((Interface.REST,))
NEEDS: dict[str, Need] = {
    ConformanceClass.REST_RESOURCES: _REST,
    ConformanceClass.REST_DELIVERY: _REST,
    ConformanceClass.REST_FORMATS: _REST,
    ConformanceClass.HTTP: _REST,
    ConformanceClass.SAFETY: _REST,
    ConformanceClass.SOAP_DELIVERY: Need((Interface.PUBLISHERS,)),
    ConformanceClass.SOAP_SUBSCRIBERS: Need((Interface.SUBSCRIBERS,)),
    ConformanceClass.SOAP_BASIC_PROFILE: Need(SOAP, named=False, each=False),
    ConformanceClass.STRICT_INPUT: Need(EVERY, named=False),
    ConformanceClass.XML_SECURITY: Need(EVERY, named=False, each=False),
    ConformanceClass.EQUIVALENCE: Need((Interface.REST, Interface.PUBLISHERS)),
    ConformanceClass.DESCRIBE: Need(EVERY, named=False),
}
