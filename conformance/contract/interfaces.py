"""The kinds of interfaces of a device."""

from enum import StrEnum


class Interface(StrEnum):
    """A kind of interface: REST, the SOAP service that acts, or the SOAP service that only reads."""

    REST = "rest"
    PUBLISHERS = "publishers"
    SUBSCRIBERS = "subscribers"


EVERY = tuple(Interface)
