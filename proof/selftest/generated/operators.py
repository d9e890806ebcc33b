"""The operators that alter a field. Each makes an edit for one run, which may remember earlier messages."""

import math
import struct
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from proof.selftest.generated.places import Place
from proof.selftest.generated.slots import Edit, Slot, same

_SCALE, _CLAMP = 1.5, 0.05
NUMERIC = frozenset({"number", "integer"})
_SCALAR = NUMERIC | {"string", "boolean"}
_ALL = _SCALAR | {"object", "array"}


@dataclass(frozen=True)
class Operator:
    """One way to alter a field.

    Attributes:
        name: first part of the names of its mutants.
        says: the effect, as a clause about "the field".
        kinds: kinds of fields that it applies to.
        parts: messages that it applies to: "answer" (response), "request" or both.
        media: notations that it applies to (json, xml, soap, path, query).
        make: makes the edit for one run.
        sibling: whether it needs another field of the same kind beside the field.
    """

    name: str
    says: str
    kinds: frozenset[str]
    parts: frozenset[str]
    media: frozenset[str]
    make: Callable[[Place], Edit]
    sibling: bool = False

    def fits(self, place: Place) -> bool:
        """Return whether the operator applies to a field."""
        return (
            place.kind in self.kinds
            and place.part in self.parts
            and place.medium in self.media
            and (bool(place.siblings) or not self.sibling)
        )


def _each(change: Callable[[Any], Any]) -> Callable[[Place], Edit]:
    """Return an edit that replaces the field's value; ``change`` raises TypeError or ValueError for values it skips."""

    def edit(slots: list[Slot]) -> bool:
        altered = False
        for slot in slots:
            before = slot.value()
            try:
                after = change(before)
            except (TypeError, ValueError, OverflowError, struct.error):
                continue
            if not same(before, after):
                slot.put(after)
                altered = True
        return altered

    return lambda _place: edit


def _always(do: Callable[[Slot], object]) -> Callable[[Place], Edit]:
    def edit(slots: list[Slot]) -> bool:
        for slot in slots:
            do(slot)
        return True

    return lambda _place: edit


def _number(change: Callable[[float], float]) -> Callable[[Place], Edit]:
    """Return an edit that replaces a number by another finite number; integers stay integers."""

    def apply(value: Any) -> Any:
        if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
            raise TypeError
        made = change(value)
        if not math.isfinite(made):
            raise OverflowError
        return int(made) if isinstance(value, int) else made

    return _each(apply)


def _swap(place: Place) -> Edit:
    def edit(slots: list[Slot]) -> bool:
        altered = False
        for slot in slots:
            other = slot.beside(place.siblings[0])
            if other is not None and not same(slot.value(), other.value()):
                mine, its = slot.value(), other.value()
                slot.put(its)
                other.put(mine)
                altered = True
        return altered

    return edit


def _forward(place: Place) -> Edit:
    def edit(slots: list[Slot]) -> bool:
        altered = False
        for slot in slots:
            other = slot.beside(place.siblings[-1])
            if other is not None and not same(slot.value(), other.value()):
                other.put(slot.value())
                altered = True
        return altered

    return edit


def _remembering(*, for_ever: bool) -> Callable[[Place], Edit]:
    """Return an edit that repeats the first message's value for ever, or always the previous message's value."""

    def make(_place: Place) -> Edit:
        kept: list[Any] = []

        def edit(slots: list[Slot]) -> bool:
            nonlocal kept
            now = [slot.value() for slot in slots]
            then, kept = kept, kept if kept and for_ever else now
            altered = False
            for slot, old, new in zip(slots, then, now, strict=False):
                if not same(old, new):
                    slot.put(old)
                    altered = True
            return altered

        return edit

    return make


def single(value: float) -> float:
    """Return a number rounded to a 32-bit float."""
    return float(struct.unpack("f", struct.pack("f", value))[0])


def _other_type(value: Any) -> Any:
    if isinstance(value, int | float):
        return f"about {value!r}"
    return 0 if isinstance(value, str) else "none"


def _comma(value: Any) -> Any:
    if isinstance(value, bool) or not isinstance(value, float):
        raise TypeError
    return repr(value).replace(".", ",")


def _default(value: Any) -> Any:
    return "" if isinstance(value, str) else type(value)(0)


def _clamp(value: float) -> float:
    return math.copysign(min(abs(value), _CLAMP), value)


def _coerce(value: Any) -> Any:
    """Return zero for any value that is not a finite number, and numbers unchanged."""
    if isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value):
        raise TypeError
    return 0


def _half(value: Any) -> Any:
    if not isinstance(value, str | list):
        raise TypeError
    return value[: len(value) // 2] if isinstance(value, str) else value[:-1]


def _operator(
    name: str, says: str, kinds: frozenset[str], parts: str, media: str, make: Callable[[Place], Edit], **more: Any
) -> Operator:
    return Operator(name, says, kinds, frozenset(parts.split()), frozenset(media.split()), make, **more)


_BODIES, _EVERYWHERE = "json xml soap", "json xml soap path query"

OPERATORS = (
    _operator("drop", "is left out", _ALL, "answer", _BODIES, _always(lambda slot: slot.drop())),
    _operator("null", "is null, in XML empty", _ALL, "answer", _BODIES, _each(lambda _: None)),
    _operator("retype", "is of another type", _ALL, "answer", "json", _each(_other_type)),
    _operator("retype", "is a text that is no number", NUMERIC, "answer", "xml soap", _each(_other_type)),
    _operator("rename", "has another name", _ALL, "answer", _BODIES, _always(lambda slot: slot.rename("renamed"))),
    _operator(
        "swap", "has its sibling's value, and that its", _ALL, "answer request", _EVERYWHERE, _swap, sibling=True
    ),
    _operator("freeze", "is for ever the first one", _ALL, "answer", _BODIES, _remembering(for_ever=True)),
    _operator("delay", "is the one of the answer before", _ALL, "answer", _BODIES, _remembering(for_ever=False)),
    _operator("scale", "is half as great again", NUMERIC, "answer request", _EVERYWHERE, _number(lambda n: n * _SCALE)),
    _operator("negate", "has the other sign", NUMERIC, "answer request", _EVERYWHERE, _number(lambda n: -n)),
    _operator(
        "single", "goes through a 32-bit float", frozenset({"number"}), "answer request", _EVERYWHERE, _number(single)
    ),
    _operator(
        "ulp",
        "is the next greater number",
        NUMERIC,
        "answer request",
        _EVERYWHERE,
        _number(lambda n: n + 1 if isinstance(n, int) else math.nextafter(n, math.inf)),
    ),
    _operator("comma", "has a decimal comma", frozenset({"number"}), "answer", _BODIES, _each(_comma)),
    _operator("duplicate", "is written twice", _ALL, "answer", _BODIES, _always(lambda slot: slot.double())),
    _operator(
        "reorder", "is in reverse order", frozenset({"array"}), "answer", _BODIES, _each(lambda items: items[::-1])
    ),
    _operator("truncate", "is cut", frozenset({"string", "array"}), "answer request", _EVERYWHERE, _each(_half)),
    _operator("default", "is taken for zero or empty", _SCALAR, "request", _EVERYWHERE, _each(_default)),
    _operator("coerce", "is taken for zero where it is no number", NUMERIC, "request", _EVERYWHERE, _each(_coerce)),
    _operator("ignore", "is for ever what it was first", _SCALAR, "request", _EVERYWHERE, _remembering(for_ever=True)),
    _operator(
        "lag", "is what it was in the request before", _SCALAR, "request", _EVERYWHERE, _remembering(for_ever=False)
    ),
    _operator("clamp", f"is clamped to {_CLAMP}", NUMERIC, "request", _EVERYWHERE, _number(_clamp)),
    _operator("forward", "is written over its sibling", _SCALAR, "request", _EVERYWHERE, _forward, sibling=True),
    _operator(
        "round",
        "is rounded to two digits",
        frozenset({"number"}),
        "answer request",
        _EVERYWHERE,
        _number(lambda n: round(n, 2)),
    ),
)
