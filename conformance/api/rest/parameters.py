"""Invalid texts for a parameter (contract, fine print)."""

from dataclasses import dataclass

from conformance.documents.json_schema import kinds_of
from conformance.documents.json_shape import shape_of
from conformance.documents.parameters import Parameter

# Texts that are no number by the contract: letters, nothing, and texts that programming languages read as numbers.
_NO_NUMBERS = ("abc", "roaas-no-number", "", "NaN", "Infinity", "-Infinity", "inf", "1e400", "-1e400", "1.5m", "0x1F")
_NO_INTEGERS = ("3.5", "99999999999999999999")
# Those of these texts that can be recognised when a problem's `detail` quotes them.
_TELLING = {"abc", "roaas-no-number", "1.5m"}


@dataclass(frozen=True)
class Wrong:
    """An invalid text for a parameter.

    Attributes:
        name: the name of the parameter.
        text: what to send.
        what: what is wrong with it.
    """

    name: str
    text: str
    what: str
    shown: str = ""


def wrong_texts(parameter: Parameter) -> list[Wrong]:
    """Return texts that a parameter does not take; none where it takes any text."""
    schema = parameter.schema
    kinds = kinds_of(schema)
    found: list[Wrong] = []
    if kinds and kinds <= {"number", "integer"}:
        texts = [*_NO_NUMBERS, *(_NO_INTEGERS if kinds == {"integer"} else ())]
        found += [
            Wrong(parameter.name, text, f"{text or 'nothing'!r} at {parameter.name}", text if text in _TELLING else "")
            for text in texts
        ]
        outside = [schema[key] + step for key, step in (("minimum", -1), ("maximum", 1)) if key in schema]
        if "enum" in schema:
            whole = [value for value in schema["enum"] if isinstance(value, int)]
            # The last number becomes an allowed one in a program that keeps only its lower 32 bits.
            outside += [max(whole) + 1, min(whole) - 1, 0, -1, min(whole) + 2**32] if whole else []
        found += [
            Wrong(parameter.name, str(value), f"{value}, which is not allowed, at {parameter.name}", str(value))
            for value in dict.fromkeys(outside)
            if not shape_of(schema).holds(value)
        ]
    elif kinds <= {"string"} and ("enum" in schema or "pattern" in schema):
        text = "roaas-not-one-of-these"
        if not shape_of(schema).holds(text):
            found.append(Wrong(parameter.name, text, f"a text that is not allowed at {parameter.name}", text))
    return found
