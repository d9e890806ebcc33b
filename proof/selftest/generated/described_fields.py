"""The operators for members of responses: each makes a value that a schema of the usual kinds forbids."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from conformance.documents.json_schema import Schema
from conformance.documents.representation import flat
from proof.selftest.generated.operators import OPERATORS
from proof.selftest.generated.places import Place
from proof.selftest.generated.slots import Edit, Slot, same


@dataclass(frozen=True)
class FieldOperator:
    """One way to alter a member.

    Attributes:
        name: first part of the names of its mutants.
        says: the effect, as a clause about the member.
        make: makes the edit of a place with a schema.
    """

    name: str
    says: str
    make: Callable[[Place, Schema], Edit]


def _put(value_of: Callable[[Schema, Any], Any]) -> Callable[[Place, Schema], Edit]:
    """Return an edit that puts in a value made from the schema and the present value, or None to alter nothing."""

    def make(_place: Place, schema: Schema) -> Edit:
        flatter = flat(schema)

        def edit(slots: list[Slot]) -> bool:
            altered = False
            for slot in slots:
                before = slot.value()
                after = value_of(flatter, before)
                if after is not None and not same(before, after):
                    slot.put(after)
                    altered = True
            return altered

        return edit

    return make


def _above(schema: Schema, _value: Any) -> Any:
    bound = schema.get("maximum", schema.get("exclusiveMaximum"))
    return bound + 1 if isinstance(bound, int | float) and not isinstance(bound, bool) else None


def _below(schema: Schema, _value: Any) -> Any:
    bound = schema.get("minimum", schema.get("exclusiveMinimum"))
    return bound - 1 if isinstance(bound, int | float) and not isinstance(bound, bool) else None


def _long(schema: Schema, value: Any) -> Any:
    if isinstance(schema.get("maxLength"), int) and schema["maxLength"] <= 1 << 16:
        return "a" * (schema["maxLength"] + 1)
    if isinstance(schema.get("maxItems"), int) and isinstance(value, list) and value:
        return [value[0]] * (schema["maxItems"] + 1)
    return None


def _empty(schema: Schema, value: Any) -> Any:
    if isinstance(value, str) and (schema.get("minLength") or "pattern" in schema or "format" in schema):
        return ""
    return [] if isinstance(value, list) and schema.get("minItems") else None


def _item(_schema: Schema, value: Any) -> Any:
    return [*value[:-1], {"roaas": "x"}] if isinstance(value, list) and value else None


def _usual(name: str) -> FieldOperator:
    found = next(one for one in OPERATORS if one.name == name and "json" in one.media)
    return FieldOperator(name, found.says, lambda place, _schema: found.make(place))


FIELD_OPERATORS = (
    *(_usual(name) for name in ("drop", "null", "retype", "rename", "comma")),
    FieldOperator(
        "enum", "is none of the declared values", _put(lambda schema, _: "roaas" if "enum" in schema else None)
    ),
    FieldOperator(
        "format",
        "has not the declared format",
        _put(lambda schema, _: "roaas 17" if {"format", "pattern"} & schema.keys() else None),
    ),
    FieldOperator("above", "is above its maximum", _put(_above)),
    FieldOperator("below", "is below its minimum", _put(_below)),
    FieldOperator("long", "is longer than its maximum", _put(_long)),
    FieldOperator("empty", "is empty", _put(_empty)),
    FieldOperator("fraction", "is no whole number", _put(lambda _, value: value + 0.5 if type(value) is int else None)),
    FieldOperator("wrap", "is in a list", _put(lambda _, value: [value])),
    FieldOperator("item", "has an item of another type", _put(_item)),
)
