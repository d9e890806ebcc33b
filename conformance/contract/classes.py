"""What a requirement can be: conformance classes with the interfaces that they need, profiles, levels, origins."""

from enum import StrEnum
from typing import Final


class Level(StrEnum):
    """How binding a requirement is (RFC 2119): MUST fails, SHOULD warns, MAY informs."""

    MUST = "MUST"
    SHOULD = "SHOULD"
    MAY = "MAY"


class Origin(StrEnum):
    """Where a requirement comes from, and so whom it binds."""

    NORM = "norm"  # a clause of an RFC, SOAP 1.1, WSDL 1.1, WS-I or XML Schema: every HTTP or SOAP service there is
    DESCRIPTION = "description"  # the OpenAPI or WSDL file at hand: whoever is described by it
    CONTRACT = "contract"  # contract.md: robots that claim it


class Prerequisite(StrEnum):
    """What a run must have to judge a requirement, beside the interface."""

    MOTION = "motion"  # permission to move the robot
    OBSERVER = "observer"  # a ROS probe, or the robot's list of deliveries
    LIMITS = "limits"  # that the statement declares them
    HOLD = "hold"  # that the statement declares the hold time
    SEEN = "seen"  # what happens by itself, or does not; what was not seen is not judged, and holds no class back
    PROBE = "probe"  # a ROS probe; without one the requirement is skipped and does not hold its class back


class ConformanceClass(StrEnum):
    """What a vendor can claim."""

    REST_RESOURCES = "rest-resources"
    REST_DELIVERY = "rest-delivery"
    REST_FORMATS = "rest-formats"
    HTTP = "http"
    SOAP_DELIVERY = "soap-delivery"
    SOAP_SUBSCRIBERS = "soap-subscribers"
    SOAP_BASIC_PROFILE = "soap-basic-profile"
    STRICT_INPUT = "strict-input"
    XML_SECURITY = "xml-security"
    EQUIVALENCE = "equivalence"
    SAFETY = "safety"
    DESCRIBE = "describe"


class Profile(StrEnum):
    """A set of classes that is claimed by one word."""

    PAPER = "paper"
    FULL = "full"


CLASSES: Final = tuple(ConformanceClass)
PROFILES: Final[dict[str, tuple[ConformanceClass, ...]]] = {
    Profile.PAPER: (ConformanceClass.REST_RESOURCES, ConformanceClass.REST_DELIVERY, ConformanceClass.SOAP_DELIVERY),
    Profile.FULL: CLASSES,
}
#: What each conformance class holds.
CLASS_TITLES: Final[dict[str, str]] = {
    ConformanceClass.REST_RESOURCES: "Table 1 of the paper over REST, as JSON",
    ConformanceClass.REST_DELIVERY: "The delivery PUT",
    ConformanceClass.REST_FORMATS: "The same resources as XML and plain text, chosen by Accept",
    ConformanceClass.HTTP: "Method, negotiation and error rules of RFC 9110, 9457 and 8259",
    ConformanceClass.SOAP_DELIVERY: "The publishers service with its two operations",
    ConformanceClass.SOAP_SUBSCRIBERS: "The subscribers service: the read side of Table 1 over SOAP",
    ConformanceClass.SOAP_BASIC_PROFILE: "Rules of message and fault of WS-I Basic Profile 1.1 and SOAP 1.1",
    ConformanceClass.STRICT_INPUT: "Contract-invalid input is refused over both interfaces and never reaches ROS",
    ConformanceClass.XML_SECURITY: (
        "DTD, entity, expansion, depth and size attacks are refused, and the robot stays responsive"
    ),
    ConformanceClass.EQUIVALENCE: "SOAP, REST and ROS tell the same story",
    ConformanceClass.SAFETY: "Velocity stops by itself, limits hold, cancel takes effect at once",
    ConformanceClass.DESCRIBE: "WSDL, OpenAPI and WADL are served and agree with behaviour",
}
