"""Judge JSON values by schemas.

``jsonschema_rs`` accepts valid values fast (1 ms for a plan of a thousand poses, where ``jsonschema`` takes 300 ms).
``jsonschema`` validates the others, because it names each violation with its place.
Formats are those of JSON Schema, and those of numbers and bytes in OpenAPI.
"""

from __future__ import annotations

import json
import math
import re
import threading
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import suppress
from fractions import Fraction
from functools import cache, cached_property, partial
from hashlib import sha256
from typing import TYPE_CHECKING, Any, Final, Generic, TypeVar, cast

import jsonschema_rs
import msgspec

from conformance.documents import patterns
from conformance.documents.json_schema import (
    CHANGES,
    LAZY_SCHEME,
    VALUE_KEYWORDS,
    Schema,
    as_double,
    bundled,
    bundled_into,
    bundled_part,
    changed_alike,
    is_number,
    target_of,
    target_of_lazy,
)
from conformance.documents.json_text import clip

if TYPE_CHECKING:
    from jsonschema.exceptions import ValidationError

T = TypeVar("T")
_KEYWORD: Final = "roaas-referred"  # stands for a lazy reference in a schema that is compiled alone
_UNEVALUATED: Final = frozenset(
    {"unevaluatedProperties", "unevaluatedItems"}
)  # keywords whose meaning depends on all others
# A schema with at most this many references is compiled together with the schemas it refers to.
_MOST_TOGETHER: Final = 30
# Nodes of all compiled schemas that are kept; each takes nearly 1 kB.
_MOST_KEPT: Final = 100_000
# Verdicts on parts of values that are remembered; each takes about 250 bytes.
_MOST_JUDGED: Final = 100_000
# A part with at least this many octets of JSON is remembered by its digest.
_DIGESTED: Final = 100
# References to follow in order to describe a violation: alternatives that refer to each other multiply.
_MOST_FOLLOWED: Final = 1_000
# The form of a lazy reference after `bundled` has put its schema into `$defs`.
_BUNDLED: Final = re.compile(r"#/\$defs/(\d+(?:,\w+)*)")
_encode: Final = msgspec.json.Encoder().encode
# An integer that is no double has 309 digits or more; to find them, every digit is replaced by 0.
_AS_ZERO: Final = bytes.maketrans(b"123456789", b"0" * 9)
_TOO_LONG: Final = b"0" * 309


@cache
def _naming() -> Any:
    """Return the validator class that names violations."""
    # Imported late: it costs a tenth of a second, and is needed when something is wrong.
    from jsonschema import Draft202012Validator  # noqa: PLC0415
    from jsonschema.validators import extend  # noqa: PLC0415

    types = Draft202012Validator.TYPE_CHECKER.redefine("number", lambda _, value: is_number(value))
    keywords = {
        "$ref": _follow,
        "multipleOf": _multiple,
        "pattern": _pattern,
        "patternProperties": _members,
        "additionalProperties": _further,
        "unevaluatedProperties": _judge_unevaluated,
    }
    # jsonschema gives extend() no types.
    return cast("Any", extend)(Draft202012Validator, validators=keywords, type_checker=types)


class _Following(threading.local):
    """Number of references that may still be followed to describe a violation."""

    left = 0


_FOLLOWING: Final = _Following()


def _follow(validator: Any, reference: str, instance: Any, schema: Schema) -> Iterator[ValidationError]:
    """Find the violations behind a reference; beyond the budget, one that names only the place."""
    from jsonschema import Draft202012Validator  # noqa: PLC0415 - as above
    from jsonschema.exceptions import ValidationError  # noqa: PLC0415 - as above

    if found := _BUNDLED.fullmatch(reference):
        is_finite = _all_finite(instance)
        if is_finite and _holds_by(f"{LAZY_SCHEME}/{found[1]}", instance):
            return
        _FOLLOWING.left -= 1
        # Only following the references can tell whether a value with an infinity is valid.
        if _FOLLOWING.left < (0 if is_finite else -_MOST_FOLLOWED):
            yield ValidationError("it fits none of the alternatives", validator="anyOf")
            return
    yield from Draft202012Validator.VALIDATORS["$ref"](validator, reference, instance, schema)


def _multiple(_: Any, step: float, instance: Any, __: Schema) -> Iterator[ValidationError]:
    """Judge multipleOf by decimal digits, as jsonschema-rs does: 0.07 is a multiple of 0.01."""
    from jsonschema.exceptions import ValidationError  # noqa: PLC0415 - as above

    if is_number(instance) and Fraction(str(instance)) % Fraction(str(step)):
        yield ValidationError(f"{instance} is not a multiple of {step}")


def _pattern(_: Any, pattern: str, instance: Any, __: Schema) -> Iterator[ValidationError]:
    from jsonschema.exceptions import ValidationError  # noqa: PLC0415 - as above

    if isinstance(instance, str) and not patterns.matches(pattern, instance):
        yield ValidationError(f"{instance!r} does not match {pattern!r}")


def _members(validator: Any, named: Schema, instance: Any, _: Schema) -> Iterator[ValidationError]:
    for pattern, schema in named.items() if isinstance(instance, dict) else ():
        for name, value in instance.items():
            if patterns.matches(pattern, name):
                yield from validator.descend(value, schema, path=name, schema_path=pattern)


def _further(validator: Any, schema: Any, instance: Any, beside: Schema) -> Iterator[ValidationError]:
    from jsonschema.exceptions import ValidationError  # noqa: PLC0415 - as above

    named = beside.get("patternProperties", {})
    for name in instance if isinstance(instance, dict) else ():
        if name in beside.get("properties", {}) or any(patterns.matches(pattern, name) for pattern in named):
            continue
        if schema is False:
            yield ValidationError(f"Additional properties are not allowed ({name!r} was unexpected)")
        else:
            yield from validator.descend(instance[name], schema, path=name)


def _judge_unevaluated(validator: Any, schema: Any, instance: Any, beside: Schema) -> Iterator[ValidationError]:
    """Judge as jsonschema does, if Python reads the patterns of names too; else members pass."""
    from jsonschema import Draft202012Validator  # noqa: PLC0415 - as above

    with suppress(re.error):
        yield from Draft202012Validator.VALIDATORS["unevaluatedProperties"](validator, schema, instance, beside)


class _Pattern:
    """The keyword ``pattern`` for jsonschema-rs, by ECMA-262."""

    def __init__(self, _: Schema, pattern: str, __: list[Any]) -> None:
        self._pattern = pattern

    def validate(self, instance: Any) -> None:
        if isinstance(instance, str) and not patterns.matches(self._pattern, instance):
            raise ValueError(f"{instance!r} does not match {self._pattern!r}")


def _patterns_in(schema: Any, *, names: bool) -> Iterator[str]:
    """Yield the patterns of texts in a schema, or those of the names of members."""
    if isinstance(schema, list):
        for item in schema:
            yield from _patterns_in(item, names=names)
    for key, item in schema.items() if isinstance(schema, dict) else ():
        if key == "pattern" and isinstance(item, str) and not names:
            yield item
        elif key not in VALUE_KEYWORDS:
            yield from item if names and key == "patternProperties" and isinstance(item, dict) else ()
            yield from _patterns_in(item, names=names)


def _without_names(schema: Any) -> Any:
    """Return a schema that allows any member where patternProperties decide which members exist."""
    if isinstance(schema, list):
        return [_without_names(item) for item in schema]
    if not isinstance(schema, dict):
        return schema
    left_out = {"patternProperties", "additionalProperties", "unevaluatedProperties"}
    left_out = left_out if isinstance(schema.get("patternProperties"), dict) else set()
    return {
        key: item if key in VALUE_KEYWORDS else _without_names(item)
        for key, item in schema.items()
        if key not in left_out
    }


def _are_plain(found: Iterator[str]) -> bool:
    """Return whether jsonschema-rs reads patterns as ECMA-262 does.

    Raises:
        PatternError: one of them is no regular expression.
    """
    others = [text for text in found if not patterns.is_plain(text)]
    for other in others:
        patterns.check(other)
    return not others


class _Referred:
    """The keyword in jsonschema-rs for a lazy reference: its schema is compiled when a value reaches it."""

    def __init__(self, holds: Callable[[str, Any], bool], _: Schema, uri: str, __: list[Any]) -> None:
        self._holds, self._uri = holds, uri

    def validate(self, instance: Any) -> None:
        if not self._holds(self._uri, instance):
            raise ValueError("a value that the schema refuses")


def _by_keyword(schema: Any) -> Any:
    """Return a copy of a schema with the keyword in the place of each lazy reference."""
    if isinstance(schema, list):
        return [_by_keyword(item) for item in schema]
    if not isinstance(schema, dict):
        return schema
    is_lazy = isinstance(schema.get("$ref"), str) and schema["$ref"].startswith(LAZY_SCHEME)
    return {_KEYWORD if is_lazy and key == "$ref" else key: _by_keyword(item) for key, item in schema.items()}


def validator_of(schema: Schema, holds: Callable[[str, Any], bool] | None = None, **options: Any) -> Any:
    """Return jsonschema-rs's validator for a schema; it follows lazy references, and fetches nothing.

    If patterns that it does not read as ECMA-262 does name members, members pass that the schema refuses.

    Args:
        schema: to be compiled.
        holds: returns whether a value is valid by the schema of a lazy reference. Without it, all that the schema
            refers to is compiled with it, as often as others do so.
        options: options of jsonschema-rs.

    Raises:
        ValueError: it is no JSON Schema.
    """
    keywords: dict[str, Any] = {}
    if holds is None or _is_together(schema):
        whole = bundled(schema)
    else:
        whole = _by_keyword(schema)
        keywords[_KEYWORD] = partial(_Referred, holds)
    if not _are_plain(_patterns_in(whole, names=True)):
        whole = _without_names(whole)
    if not _are_plain(_patterns_in(whole, names=False)):
        keywords["pattern"] = _Pattern
    if keywords:
        options["keywords"] = keywords
    return jsonschema_rs.validator_for(whole, offline=True, **options)


def _has_words(schema: Any, words: frozenset[str]) -> bool:
    if isinstance(schema, dict):
        return not words.isdisjoint(schema) or any(_has_words(item, words) for item in schema.values())
    return isinstance(schema, list) and any(_has_words(item, words) for item in schema)


def _is_together(schema: Schema) -> bool:
    """Return whether a schema is compiled with all that it refers to: that is quicker to judge by, if it is little."""
    # These keywords cannot know what a lazy reference has evaluated.
    if _has_words(schema, _UNEVALUATED):
        return True
    waiting: list[str] = []
    bundled_into(schema, waiting)
    seen: set[str] = set()
    while waiting and len(seen) <= _MOST_TOGETHER:
        if (uri := waiting.pop()) not in seen:
            seen.add(uri)
            waiting += bundled_part(uri)[1]
    return len(seen) <= _MOST_TOGETHER


def _compiled_of(schema: Schema) -> Schema:
    return bundled(schema) if _is_together(schema) else schema


class Kept(Generic[T]):
    """Compiled schemas by schema object, dropped when they have too many nodes together."""

    def __init__(self, compiled: Callable[[Schema], T]) -> None:
        self._compiled = compiled
        self._kept: dict[int, tuple[Schema, T]] = {}
        self._nodes = 0

    def of(self, schema: Schema) -> T:
        """Return the compiled form of a schema."""
        found = self._kept.get(id(schema))
        if found is None or found[0] is not schema:
            nodes = _nodes_in(_compiled_of(schema))
            if self._nodes + nodes > _MOST_KEPT:
                self._kept.clear()
                self._nodes = 0
            self._nodes += nodes
            found = self._kept[id(schema)] = schema, self._compiled(schema)
        return found[1]


def _nodes_in(value: Any) -> int:
    inner = value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()
    return 1 + sum(map(_nodes_in, inner))


class Shape:
    """A schema without references, for validating values. Numbers must be finite doubles."""

    def __init__(self, schema: Schema) -> None:
        self.schema = schema
        self._quick = validator_of(schema, _holds_by)
        # With such patterns for names, jsonschema-rs allows too much.
        self._is_exact = _are_plain(_patterns_in(_compiled_of(schema), names=True))

    def problem(self, value: Any, where: str = "") -> str:
        """Return the first violation in ``value``, with its place below ``where``; empty if the value is valid."""
        try:
            if self._passes(value):
                return ""
            error = self._first_error(value)
        except RecursionError:
            return "the value is nested too deeply"
        return _fault_text(error, where) if error is not None else ""

    def holds(self, value: Any) -> bool:
        """Return whether ``value`` has no problem: quicker, because the problem is not looked for."""
        try:
            return self._passes(value) or self._is_valid(value)
        except RecursionError:
            return False

    def holds_within(self, value: Any) -> bool:
        """Return the same for a part of a value whose numbers are finite."""
        return bool(self._quick.is_valid(value)) if self._is_exact else self._is_valid(value)

    def broken_rule(self, value: Any) -> tuple[str, bool]:
        """Return the violated schema keyword, and True if ``value`` itself violates it, and not only a member.

        For a valid value, return an empty keyword and False.
        """
        error = self._first_error(value)
        return ("", False) if error is None else (str(error.validator), not error.absolute_path)

    @cached_property
    def _validator(self) -> Any:
        from jsonschema_specifications import REGISTRY  # noqa: PLC0415 - as above

        # With a registry of its own, jsonschema fetches nothing from the network.
        return _naming()(bundled(self.schema), registry=REGISTRY)

    def _is_valid(self, value: Any) -> bool:
        # A validation may start another one while it searches for a violation to describe.
        before, _FOLLOWING.left = _FOLLOWING.left, 0
        try:
            return bool(self._validator.is_valid(value))
        finally:
            _FOLLOWING.left = before

    def _first_error(self, value: Any) -> ValidationError | None:
        """Return the worst violation; among alternatives, that of the best fitting one."""
        from jsonschema.exceptions import relevance  # noqa: PLC0415 - as above

        _FOLLOWING.left = _MOST_FOLLOWED
        error: ValidationError | None = max(self._validator.iter_errors(value), key=relevance, default=None)
        while error is not None and error.context:
            alternatives = defaultdict(list)
            for one in error.context:
                alternatives[one.relative_schema_path[0]].append(one)
            best, *others = sorted(alternatives.values(), key=_misfit)
            if others and _misfit(best) == _misfit(others[0]):
                break
            error = max(best, key=relevance)
        return error

    def _passes(self, value: Any) -> bool:
        try:
            return self._is_exact and bool(self._quick.is_valid(value)) and _all_finite(value)
        except (ValueError, TypeError, OverflowError):
            return False  # jsonschema-rs refuses the number (an Infinity): the other validator judges it


def _misfit(errors: list[ValidationError]) -> tuple[bool, bool, int]:
    """Return how far a value is from an alternative: another type, another kind by a fixed value, and its errors."""
    is_another_type = any(error.validator == "type" and not error.relative_path for error in errors)
    return is_another_type, any(error.validator in {"const", "enum"} for error in errors), len(errors)


def _fault_text(error: ValidationError, where: str) -> str:
    place = where
    for part in error.absolute_path:
        place += f"[{part}]" if isinstance(part, int) else f".{part}" if place else str(part)
    value: Any = error.instance
    rule: Any = error.validator_value
    if error.validator == "required":
        missing = next(name for name in rule if name not in value)
        return f"{place}.{missing} is missing" if place else f"{missing} is missing"
    place = place or "the value"
    if error.validator == "type":
        return f"{place} is {clip(value)}, not of type {rule}"
    if error.validator in {"minItems", "maxItems"}:
        return f"{place} has {len(value)} items"
    return f"{place}: {error.message[:300]}"


_SHAPES: Final = Kept(Shape)


def shape_of(schema: Schema) -> Shape:
    """Return the Shape of a schema, cached by the schema object."""
    return _SHAPES.of(schema)


_JUDGED: Final[dict[tuple[str, bytes], bool]] = {}


def _holds_by(uri: str, value: Any) -> bool:
    """Judge a part of a value by a lazy reference, once: alternatives that refer to each other ask again and again."""
    schema = target_of_lazy(uri)
    if not isinstance(schema, dict):
        return schema is not False
    try:
        text = _encode(value)
    except (TypeError, ValueError, OverflowError):
        text = json.dumps(value).encode()  # a lone surrogate
    text = text if len(text) < _DIGESTED else sha256(text).digest()
    found = _JUDGED.get((uri, text))
    if found is None:
        found = shape_of(schema).holds_within(value)
        if len(_JUDGED) >= _MOST_JUDGED:
            _JUDGED.clear()
        _JUDGED[uri, text] = found
    return found


def _all_finite(value: Any) -> bool:
    """Return whether all numbers in a JSON value are finite doubles; called for every response."""
    try:
        text = _encode(value)
    except (TypeError, ValueError, OverflowError, RecursionError):
        return _each_finite(value)
    # An infinity or NaN is encoded as null: a text without null has none. It is several times as fast as a walk.
    return (b"null" not in text and _TOO_LONG not in text.translate(_AS_ZERO)) or _each_finite(value)


def _each_finite(value: Any) -> bool:
    if isinstance(value, float):
        return math.isfinite(value)
    if isinstance(value, list):
        return all(map(_each_finite, value))
    if isinstance(value, dict):
        return all(map(_each_finite, value.values()))
    return not isinstance(value, int) or math.isfinite(as_double(value))


_SINGLE: Final = 3.4028234663852886e38
# Lowest and highest value, by format of the OpenAPI Initiative's Format Registry. Any JSON number may be a double.
_RANGES: Final[dict[str, tuple[float, float]]] = {
    **{f"int{bits}": (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1) for bits in (8, 16, 32, 64)},
    **{f"uint{bits}": (0, 2**bits - 1) for bits in (8, 16, 32, 64)},
    "float": (-_SINGLE, _SINGLE),
}
_DATA: Final = frozenset({"example", "examples", "default", "enum", "const"})
# Base64 by RFC 4648, sections 4 and 5; a description does not say which alphabet, and whether padding is left out.
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
            rule = target_of(root, rule["$ref"]) if step == "$ref" else rule[step]
        place = "/".join("*" if isinstance(part, int) else part for part in error.instance_path)
        wanted = " or ".join(sorted(set(_NAME.findall(str(rule))))) or "value of the declared format"
        found.setdefault(place, (error.instance, place, wanted))
    return list(found.values())


def _validator(schema: Schema, *, whole: bool = False) -> Any:
    """Return the validator of a schema with its formats, with all that it refers to if `whole`; None if invalid."""
    if "'format'" not in str(schema) and "roaas-lazy:" not in str(schema):
        return None
    checks = {"byte": is_base64, "base64url": is_base64}
    return validator_of(in_range(schema), None if whole else _holds_in_range_by, validate_formats=True, formats=checks)


def _holds_in_range_by(uri: str, value: Any) -> bool:
    schema = target_of_lazy(uri)
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
        # The schema's own bounds stay, because they may be narrower.
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
