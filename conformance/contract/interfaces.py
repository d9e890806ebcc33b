"""The interfaces that a device may have."""

from enum import StrEnum


class Interface(StrEnum):
    """One interface: REST, the SOAP service that acts, the SOAP service that only reads."""

    REST = "rest"
    PUBLISHERS = "publishers"
    SUBSCRIBERS = "subscribers"


EVERY = tuple(Interface)
