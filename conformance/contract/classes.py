"""The attributes of requirements (level, origin, prerequisites), and conformance classes."""

from collections.abc import Collection
from dataclasses import dataclass
from enum import StrEnum
from typing import Final


class Interface(StrEnum):
    """A kind of interface: REST, the SOAP service that acts, or the SOAP service that only reads."""

    REST = "rest"
    PUBLISHERS = "publishers"
    SUBSCRIBERS = "subscribers"


EVERY = tuple(Interface)


#: The profile that every pack has: all of its classes.
FULL = "full"


class Level(StrEnum):
    """How binding a requirement is (RFC 2119): a violated MUST fails, SHOULD warns, MAY informs."""

    MUST = "MUST"
    SHOULD = "SHOULD"
    MAY = "MAY"


class Origin(StrEnum):
    """The kind of source of a requirement, which decides which devices it binds."""

    NORM = "norm"  # a clause of an RFC, SOAP 1.1, WSDL 1.1, WS-I or XML Schema: every HTTP or SOAP service
    DESCRIPTION = "description"  # the OpenAPI or WSDL file at hand: the service that it describes
    WEAKNESS = "weakness"  # a catalogue of known weaknesses (CWE, WS-Attacks): every service that parses XML
    CONTRACT = "contract"  # a pack's contract.md: devices that claim it


class Topic(StrEnum):
    """Topic of a requirement for readers: pages, terminal and docs list the topics in this order."""

    HURT = "hurt"  # whether somebody can be hurt, or something moves that should not
    SERVICE = "service"  # whether the device does what the contract says of its resources and operations
    CLIENTS = "clients"  # whether stock clients, libraries and tools work with it
    HOSTILE = "hostile"  # what attacks and invalid input do to it
    HYGIENE = "hygiene"  # good practice that devices seldom follow; pages fold it


#: The topics as questions that a reader has.
QUESTIONS = {
    Topic.HURT: "Can it hurt?",
    Topic.SERVICE: "Does it do what it says?",
    Topic.CLIENTS: "Do stock clients work?",
    Topic.HOSTILE: "Does it withstand hostile input?",
    Topic.HYGIENE: "Hygiene",
}


class CauseKind(StrEnum):
    """The kinds of causes for failures, in the order in which a vendor should look at them."""

    NO_RESPONSE = "no-response"  # no connection, or one that was closed without a response
    HANG = "hang"  # no whole response within the deadline
    SERVER_ERROR = "server-error"  # a status of 5xx
    UNREADABLE = "unreadable"  # no HTTP, or JSON or XML that no parser reads
    RULE = "rule"  # a response that breaks a rule


class Prerequisite(StrEnum):
    """Things that a run needs, besides the interface, to judge a requirement."""

    MOTION = "motion"  # permission to move the device
    OBSERVER = "observer"  # a ROS probe, or another way to observe the effects of a request
    LIMITS = "limits"  # the statement declares them
    HOLD = "hold"  # the statement declares the hold time
    RESOLVED = "resolved"  # the declared tolerances are small beside the limits, so that rest and motion differ
    # the device must show the behaviour by itself; otherwise the requirement is not judged and does not hold its class
    # back
    SEEN = "seen"
    PROBE = "probe"  # a ROS probe; without one the requirement is skipped and does not hold its class back


@dataclass(frozen=True)
class ConformanceClass:
    """A group of requirements that a vendor can claim.

    Attributes:
        name: as in claims and requirement ids.
        title: a description.
        interfaces: the interfaces that it judges.
        one_is_enough: whether one of these interfaces suffices; otherwise all that the contract describes must respond.
        topic: the topic of its requirements that name none.
        within: the class that has its requirements in a contract that does not have this class; empty if there is none.
        beside: whether a device that is judged by its own description has it beside its verdict: the class is judged
            and shown, and decides nothing, unless a claim names it.
    """

    name: str
    title: str
    interfaces: tuple[Interface, ...]
    one_is_enough: bool = False
    topic: Topic = Topic.SERVICE
    within: str = ""
    beside: bool = False

    def missing(self, there: Collection[Interface], described: Collection[Interface] = EVERY) -> tuple[Interface, ...]:
        """Return the interfaces that the class needs and the contract describes, but that have no address."""
        return tuple(name for name in self.interfaces if name in described and name not in there)


#: Bytes of a request body that every service must accept, over REST and over SOAP.
TAKEN_OCTETS: Final = 64 * 1024
#: Bytes of a request body from which on a service may stop reading and close the connection.
LIMIT_OCTETS: Final = 10 * 1024 * 1024
