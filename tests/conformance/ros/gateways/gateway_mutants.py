"""The mutants of the gateways: each operator makes one fault, in each gateway where it shows.

`rows()` makes rows by rule: an operator is tried on two gateways that follow each other, so that all gateways get as
many.
"""

from dataclasses import dataclass

_STYLES = ("fastapi", "aiohttp", "flask", "node")
_IN_PYTHON = _STYLES[:3]
_STREAMING = ("aiohttp", "fastapi", "rosbridge")
_GATEWAYS_OF_AN_OPERATOR = 2


@dataclass(frozen=True)
class Mutant:
    """One gateway with one fault."""

    style: str
    fault: str

    @property
    def name(self) -> str:
        """What a test calls it."""
        return f"{self.style}: {self.fault}"


#: The faults, and where they show: all gateways, or those in which the code with the fault is.
OPERATORS: dict[str, tuple[str, ...]] = {
    # values, both ways
    "field dropped": _STYLES,
    "fields swapped": _STYLES,
    "truncated": _STYLES,
    "reversed": _STYLES,
    "float32": _STYLES,
    "6 digits": _STYLES,
    "NaN as 0": _STYLES,
    "2^53": _STYLES,
    "signed": _STYLES,
    "wraps": _STYLES,
    "ascii": _STYLES,
    "bytes through text": _STYLES,
    "empty as null": _STYLES,
    # requests
    "message dropped": _STYLES,
    "message doubled": _STYLES,
    "reordered": _STYLES,
    "invalid accepted": _STYLES,
    "invalid published": _STYLES,
    "message doubled in a crowd": _STYLES,
    "reordered in a crowd": _STYLES,
    # time
    "stale": _STYLES,
    "empty when stale": _STYLES,
    "empty at first": _STYLES,
    "absent crashes": _STYLES,
    "first message for ever": _STYLES,
    "restamped": _IN_PYTHON,
    "messages mixed": _IN_PYTHON,
    "reliable only": _STYLES,
    "volatile only": _STYLES,
    "deaf after the first publisher": _IN_PYTHON,
    # services
    "call dropped": _STYLES,
    "call doubled": _STYLES,
    "last response": _STYLES,
    "response as success": _STYLES,
    "late as success": _STYLES,
    "no deadline": _STYLES,
    "absent service as success": _STYLES,
    "absence remembered": _STYLES,
    "deadlock": _STYLES,
    "call doubled in a crowd": _STYLES,
    "last response in a crowd": _STYLES,
    # actions
    "goal doubled": _STYLES,
    "goals mixed": _STYLES,
    "refused goal as accepted": _STYLES,
    "refused goal as aborted": _STYLES,
    "aborted as succeeded": _STYLES,
    "succeeded as aborted": _STYLES,
    "canceled as aborted": _STYLES,
    "canceled as succeeded": _STYLES,
    "never ends": _STYLES,
    "result lost": _STYLES,
    "cancel lost": _STYLES,
    "cancel of another": _STYLES,
    "cancel as refused": _IN_PYTHON,
    "first feedback for ever": _STYLES,
    "feedback reordered": _STYLES,
    # streams
    "stream drops": _STREAMING,
    "stream doubles": _STREAMING,
    "stream reorders": _STREAMING,
    "stream of the first": _STREAMING,
    "stream for one client": _STREAMING,
    "stream once only": _STREAMING,
    "stream throttle ignored": ("aiohttp", "rosbridge"),
    "unsubscribe ignored": ("rosbridge",),
    "wrong id": ("rosbridge",),
    "service error as success": ("rosbridge",),
    # the graph
    "list of the start": _STYLES,
    "list keeps what is gone": _STYLES,
    "list with wrong types": _STYLES,
    "list without namespaces": _STYLES,
    "subscriptions leak": _IN_PYTHON,
}


def rows() -> tuple[Mutant, ...]:
    """Return the mutants."""
    return tuple(
        Mutant(styles[(number + step) % len(styles)], fault)
        for number, (fault, styles) in enumerate(OPERATORS.items())
        for step in range(min(_GATEWAYS_OF_AN_OPERATOR, len(styles)))
    )
