"""Generated changes that break no clause of a norm or of the pack's contract, each with the reason.

They are not mutants and are not judged. Patterns are narrow; coverage.md shows how many changes each covers.
"""

from conformance.contract.pack import Contract
from conformance.mutation.self_test import OpenPlace, self_test_of
from conformance.selftest.generated.mutant import GeneratedMutant

_UNSAFE = ("PUT", "POST", "PATCH", "DELETE")
#: What norms leave open, whatever the contract.
BY_NORM = (
    OpenPlace(
        r"body-bom:[^:]+:body:xml",
        "A document of XML may begin with a byte order mark (XML 1.0 4.3.3), and every receiver has to take it "
        "(BP R4001); what forbids one is RFC 8259 8.1, of JSON.",
    ),
    OpenPlace(
        r"body-bom:[^:]+:body:text",
        "A stream of YAML may begin with a byte order mark, which is no part of its content (YAML 1.2.2 5.2); what "
        "forbids one is RFC 8259 8.1, of JSON.",
    ),
    OpenPlace(
        r"header-(drop|change):[^:]+:Vary",
        "Vary tells caches which clients a response is fit for: a response that may be cached needs it "
        "(RFC 9110 12.5.5), and the response to an unsafe method may not (9.2.3).",
        side="rest",
        methods=_UNSAFE,
    ),
    OpenPlace(
        r"header-more:[^:]+:Allow",
        "A method that Allow names in every response is the vendor's own (RFC 9110 10.2.1). The suite does not send "
        "it, as it may do anything.",
    ),
)


def open_places(contract: Contract) -> tuple[OpenPlace, ...]:
    """Return the patterns of changes that break no clause of the norms or of the pack's contract."""
    return (*self_test_of(contract).open_places, *BY_NORM)


def open_place(contract: Contract, change: GeneratedMutant) -> OpenPlace | None:
    """Return the pattern that says why a change breaks no clause; None for a change that breaks one."""
    exchange = change.exchange
    covering = (one for one in open_places(contract) if one.covers(change.name, exchange.side, exchange.method))
    return next(covering, None)
