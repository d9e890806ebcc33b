"""Judge values by the ``format`` of their schemas: JSON Schema's formats, and those of numbers and bytes in OpenAPI."""

from __future__ import annotations

import re
from typing import Any, Final

from conformance.documents.json_schema import CHANGES, Schema, bundled, changed_alike, pointed, referred
from conformance.documents.json_shape import Kept, validator_of

_SINGLE: Final = 3.4028234663852886e38
# The lowest and the highest value by the OpenAPI Initiative's Format Registry. Any number of JSON may be a double.
_RANGES: Final[dict[str, tuple[float, float]]] = {
    **{f"int{bits}": (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1) for bits in (8, 16, 32, 64)},
    **{f"uint{bits}": (0, 2**bits - 1) for bits in (8, 16, 32, 64)},
    "float": (-_SINGLE, _SINGLE),
}
_DATA: Final = frozenset({"example", "examples", "default", "enum", "const"})
# RFC 4648, sections 4 and 5; which alphabet, and whether padding is left out, a description does not say.
_BASE64: Final = re.compile(r"(?:[A-Za-z0-9+/]*|[A-Za-z0-9_-]*)={0,2}")
_GROUP: Final = 4
_NAME: Final = re.compile(r"'format': '([^']+)'")


def has_formats(schema: Schema, value: Any) -> bool:
    """Return whether each string and number in a value has the ``format`` of its schema; unknown formats hold."""
    validator = _VALIDATORS.of(schema)
    try:
        return validator is None or bool(validator.is_valid(value))
    except (ValueError, TypeError, OverflowError, RecursionError):
        return False  # a value that this validator does not take


def wrong_formats(schema: Schema, value: Any) -> list[tuple[Any, str, str]]:
    """Return the first value at each place that does not have its declared format, the place, and the format's name."""
    validator = _validator(schema, whole=True)
    found: dict[str, tuple[Any, str, str]] = {}
    root = bundled(in_range(schema)) if validator is not None else schema
    for error in validator.iter_errors(value) if validator is not None else ():
        rule: Any = root
        for step in error.schema_path[:-1]:
            rule = pointed(root, rule["$ref"]) if step == "$ref" else rule[step]
        place = "/".join("*" if isinstance(part, int) else part for part in error.instance_path)
        wanted = " or ".join(sorted(set(_NAME.findall(str(rule))))) or "value of the declared format"
        found.setdefault(place, (error.instance, place, wanted))
    return list(found.values())


def _validator(schema: Schema, *, whole: bool = False) -> Any:
    """Return the validator of a schema with its formats, with all that it refers to if `whole`; None if it has none."""
    if "'format'" not in str(schema) and "roaas-lazy:" not in str(schema):
        return None
    checks = {"byte": is_base64, "base64url": is_base64}
    return validator_of(in_range(schema), None if whole else _holds_by, validate_formats=True, formats=checks)


def _holds_by(uri: str, value: Any) -> bool:
    schema = referred(uri)
    validator = _VALIDATORS.of(schema) if isinstance(schema, dict) else None
    return validator is None or bool(validator.is_valid(value))


_VALIDATORS: Final = Kept(_validator)


def in_range(schema: Any) -> Any:
    """Return a schema in which each format of numbers has become bounds as well."""
    if isinstance(schema, list):
        return [in_range(item) for item in schema]
    if not isinstance(schema, dict):
        return schema
    result = {key: item if key in _DATA else in_range(item) for key, item in schema.items()}
    name = schema.get("format")
    if isinstance(name, str) and name in _RANGES:
        # All of them hold: the schema's own bounds may be narrower, and stay.
        bounds: Schema = dict(zip(("minimum", "maximum"), _RANGES[name], strict=True))
        bounds |= {"format": name} | ({"multipleOf": 1} if "int" in name else {})
        result["allOf"] = [*result["allOf"], bounds] if isinstance(result.get("allOf"), list) else [bounds]
    return changed_alike(result, "in_range")


def is_base64(text: str) -> bool:
    """Return whether a text is base64 or base64url (RFC 4648), with its padding or without."""
    content = text.rstrip("=")
    padded = len(text) > len(content)
    whole = len(text) % _GROUP == 0 if padded else len(content) % _GROUP != 1
    return whole and _BASE64.fullmatch(text) is not None


CHANGES["in_range"] = in_range
