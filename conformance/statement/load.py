"""The statement's tables on load tests: limits of a test, operations to measure, and service levels."""

from typing import Annotated

import msgspec
from msgspec import Meta

from conformance.contract.toml_file import Positive, Text

_MOST_WEIGHT = 1000


class Pair(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One operation that the device offers over both REST and SOAP.

    Attributes:
        rest: the operation in the OpenAPI description, as in `"GET /robot/pose/"`.
        soap: the operation in the WSDL, as in `"GetPose"`, or `"POST /PORT/GetPose"` if several ports have it.
    """

    rest: Text
    soap: Text


class Load(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Limits of a load test on the device.

    Attributes:
        max_rate: maximum requests per second.
        max_duration_s: maximum duration of a measurement, s.
        operations: what to measure of a device with a description: weight by operation, as in `"GET /state" = 3`.
        pairs: operations to compare over REST and SOAP, by the name that the result has for them.
    """

    max_rate: Positive | None = None
    max_duration_s: Positive | None = None
    operations: dict[str, int] = {}
    pairs: dict[str, Pair] = {}

    def __post_init__(self) -> None:
        """Check the weights.

        Raises:
            ValueError: one is out of range.
        """
        for name, weight in self.operations.items():
            if not 1 <= weight <= _MOST_WEIGHT:
                raise ValueError(f"operations: {name!r} = {weight} must be a whole number from 1 to {_MOST_WEIGHT}")


class ServiceLevel(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The limits that an operation must keep.

    Attributes:
        p50_ms, p90_ms, p95_ms, p99_ms, p999_ms: limits on quantiles of the response time, ms.
        error_rate: highest share of requests that may fail, 0 to 1.
        at_rate: requests per second of this operation at which the level holds; None means at any rate.
    """

    p50_ms: Positive | None = None
    p90_ms: Positive | None = None
    p95_ms: Positive | None = None
    p99_ms: Positive | None = None
    p999_ms: Positive | None = None
    error_rate: Annotated[float, Meta(ge=0, lt=1)] | None = None
    at_rate: Positive | None = None

    def __post_init__(self) -> None:
        """Check that there is a limit.

        Raises:
            ValueError: there is none.
        """
        if not self.limits:
            raise ValueError("a service level needs a limit, such as p99_ms = 50 or error_rate = 0.001")

    @property
    def limits(self) -> dict[str, float]:
        """The limits that are set, by name."""
        given = msgspec.structs.asdict(self)
        return {name: value for name, value in given.items() if name != "at_rate" and value is not None}
