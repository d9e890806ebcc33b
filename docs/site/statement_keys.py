"""The reference of statements: each key with type, default and meaning, from the classes that read it."""

import re
import sys
from collections.abc import Iterator
from inspect import getdoc
from typing import Any

import msgspec
from msgspec import inspect

from conformance.packs.table1.statement import StatementFile
from conformance.statement.load import ServiceLevel
from conformance.statement.motion_map import MotionMap
from conformance.statement.statement import Api, Auth, Calls

_INTRODUCTION = """# Every key of a statement

A *statement* (implementation conformance statement) is the TOML file in which a vendor says what the device is and can
do. `roaas certify --init` writes a first one. File names in it are relative to its folder. An unknown key, or a value
of the wrong type, ends the command with exit code 2 and a message that names it.

"""
_MOTION = """## The motion map

In the statement of a device that is judged by its own description (`[api]`), the tables `[motion.…]` say how it moves.
[Motion](motion.md) explains them with examples.
"""
_ATTRIBUTE = re.compile(r"^ {4}(\w[\w, ]*): (.*(?:\n {8}.*)*)", re.MULTILINE)
_WORDS = {
    inspect.FloatType: "number",
    inspect.IntType: "integer",
    inspect.StrType: "string",
    inspect.BoolType: "true or false",
    inspect.AnyType: "any value",
}


def page() -> str:
    """Return the page as Markdown."""
    lines = [_INTRODUCTION]
    for field in msgspec.structs.fields(StatementFile):
        if field.name in _OWN:
            continue
        lines += _table(field.name, field.type)
    for name, shape in _OWN.items():
        lines += _table(name, shape)
    lines += [_MOTION]
    for field in msgspec.structs.fields(MotionMap):
        lines += _table(f"motion.{field.name}", field.type, _meanings(MotionMap).get(field.name, ""))
    return "\n".join(lines)


#: Tables that are read before the rest, or by themselves.
_OWN = {"api": Api, "auth": Auth, "calls": Calls, "slo": dict[str, ServiceLevel]}


def _table(name: str, shape: Any, about: str = "") -> Iterator[str]:
    """Yield the section of a table, then those of the tables in it."""
    struct, several = _struct_in(shape)
    if struct is None:
        yield f"## `[{name}]`\n\n{about or _ABOUT.get(name, '')}\n"
        return
    heading = f"`[[{name}]]`" if several == "list" else f"`[{name}{'.NAME' if several == 'named' else ''}]`"
    yield f"## {heading}\n\n{about or _summary(struct)}\n"
    meanings, inner = _meanings(struct), []
    yield "| key | type | default | meaning |\n|---|---|---|---|"
    for field in msgspec.structs.fields(struct):
        nested, _ = _struct_in(field.type)
        if nested is not None:
            inner.append(field)
            continue
        kind = _words(inspect.type_info(field.type))
        yield f"| `{field.encode_name}` | {kind} | {_default(field)} | {_cell(meanings.get(field.name, ''))} |"
    yield ""
    for field in inner:
        path = f"{name}.NAME" if several == "named" else name
        yield from _table(f"{path}.{field.encode_name}", field.type, _cell(meanings.get(field.name, "")))


_ABOUT = {"values": 'Values for requests, by the name of a parameter or of a member of a body: `name = ["value", …]`.'}


def _struct_in(shape: Any) -> tuple[type[msgspec.Struct] | None, str]:
    """Return the class of a table, and whether it is one table, a list of them or several with names."""
    kind, several = inspect.type_info(shape), ""
    while not isinstance(kind, inspect.StructType):
        match kind:
            case inspect.UnionType():
                kind = next((one for one in kind.types if not isinstance(one, inspect.NoneType)), None)
            case inspect.VarTupleType() | inspect.ListType():
                kind, several = kind.item_type, "list"
            case inspect.DictType():
                kind, several = kind.value_type, "named"
            case _:
                return None, ""
    return kind.cls, several


def _summary(struct: type) -> str:
    return _cell((getdoc(struct) or "").partition("\n")[0])


def _meanings(struct: type) -> dict[str, str]:
    """Return what the docstrings of a class and its bases say of each attribute."""
    found: dict[str, str] = {}
    for base in reversed(struct.__mro__):
        for names, text in _ATTRIBUTE.findall(getdoc(base) or ""):
            found |= dict.fromkeys(names.split(", "), re.sub(r"\s+", " ", text))
    return found


def _default(field: Any) -> str:
    if field.required:
        return "required"
    value = field.default_factory() if field.default is msgspec.NODEFAULT else field.default
    if value in (None, "", ()):
        return ""
    shown = str(value).lower() if isinstance(value, bool) else list(value) if isinstance(value, tuple) else value
    return f"`{shown}`"


def _words(kind: Any) -> str:  # noqa: PLR0911 - one for each kind
    """Return a type in words: "number, at least 0"."""
    match kind:
        case inspect.UnionType():
            return " or ".join(_words(one) for one in kind.types if not isinstance(one, inspect.NoneType))
        case inspect.LiteralType():
            return ", ".join(f"`{value}`" for value in kind.values)
        case inspect.EnumType():
            return ", ".join(f"`{item.value}`" for item in kind.cls)
        case inspect.VarTupleType() | inspect.ListType():
            return f"list of: {_words(kind.item_type)}"
        case inspect.TupleType():
            return f"[{', '.join(map(_words, kind.item_types))}]"
        case inspect.DictType():
            return f"table: {_words(kind.value_type)}"
        case inspect.FloatType() | inspect.IntType():
            return _WORDS[type(kind)] + _bounds(kind)
        case _:
            return _WORDS[type(kind)]


def _bounds(kind: Any) -> str:
    least = f", at least {kind.ge:g}" if kind.ge is not None and kind.ge > -sys.float_info.max else ""
    above = f", above {kind.gt:g}" if kind.gt is not None else ""
    most = f", at most {kind.le:g}" if kind.le is not None and kind.le < sys.float_info.max else ""
    return least + above + most


def _cell(text: str) -> str:
    return text.replace("``", "`").replace("|", "\\|")
