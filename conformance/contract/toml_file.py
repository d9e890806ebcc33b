"""Read TOML files that people write. Values are typed, and each error message says what to change.

The type of a file is a frozen ``msgspec.Struct`` that forbids unknown fields. msgspec validates; as its messages
speak of JSON paths, this module writes its own: file, table, key, offending value, and what is allowed.
"""

import datetime as dt
import json
import re
import sys
import tomllib
from collections.abc import Callable
from difflib import get_close_matches
from pathlib import Path
from typing import Annotated, Any, Final, TypeVar

import msgspec
from msgspec import Meta, inspect

from conformance.commandline.secrecy import SECRETS
from conformance.commandline.secret_file import IN_URL, names_user

_Shape = TypeVar("_Shape")

#: Value types that several files share. They exclude NaN and infinity, which TOML allows.
Positive = Annotated[float, Meta(gt=0, le=sys.float_info.max)]
NotNegative = Annotated[float, Meta(ge=0, le=sys.float_info.max)]
Finite = Annotated[float, Meta(ge=-sys.float_info.max, le=sys.float_info.max)]
Text = Annotated[str, Meta(min_length=1, pattern=r"\S")]

_DATES = (dt.date, dt.datetime, dt.time)  # TOML has dates of its own, so a quoted text is never converted to one
_PLACE = re.compile(r" - at `\$(?P<path>[^`]*)`$")
_STEP = re.compile(r"\.(?P<key>\w+)|\[(?P<index>\d+)\]")


class TomlFileError(ValueError):
    """Raised for an invalid file; the message names the file, the table, the key and the offending value."""


def read_toml(path: Path, shape: type[_Shape], error: type[TomlFileError] = TomlFileError) -> _Shape:
    """Read a file as an instance of ``shape``.

    Raises:
        TomlFileError: as ``error``: the file cannot be read, is not TOML, or is not valid.
    """
    return fit(read_tables(path, error), shape, str(path), error)


def read_tables(path: Path, error: type[TomlFileError] = TomlFileError) -> dict[str, Any]:
    """Read a file as nested dictionaries.

    Raises:
        TomlFileError: as ``error``: the file cannot be read, or is not TOML.
    """
    try:
        text = path.read_text(encoding="utf-8")
        SECRETS.keep_userinfo(text)
        tables = tomllib.loads(text)
    except OSError as problem:
        raise error(f"{path} cannot be read: {problem.strerror or problem}") from problem
    except (UnicodeDecodeError, tomllib.TOMLDecodeError) as problem:
        raise error(f"{path} is no TOML: {problem}") from problem
    if names_user(tables):
        raise error(f"{path}: {IN_URL}, or by basic_file or digest_file in [endpoints]")
    return tables


def fit(table: dict[str, Any], shape: type[_Shape], where: str, error: type[TomlFileError] = TomlFileError) -> _Shape:
    """Convert a table to an instance of ``shape``; ``where`` is the beginning of messages.

    Raises:
        TomlFileError: as ``error``: a key is unknown or missing, or a value is invalid.
    """
    try:
        return msgspec.convert(table, shape, builtin_types=_DATES)
    except msgspec.ValidationError as problem:
        raise error(f"{where}: {_explain(table, shape, str(problem))}") from problem


def basic_string(text: str) -> str:
    """Return a text as a TOML basic string: JSON's escapes are TOML's (TOML 1.0, String), once DEL is escaped too."""
    return json.dumps(text).replace("\x7f", "\\u007f")


def _explain(table: dict[str, Any], shape: type, said: str) -> str:
    """Return what is invalid, in words for the author of the file."""
    place = _PLACE.search(said)
    if place and "[...]" in place["path"]:  # msgspec does not name the key in a table whose keys the user chooses
        return f"[{place['path'].strip('.').partition('[')[0]}] {_PLACE.sub('', said)}"
    value: Any = table
    kind = inspect.type_info(shape)
    heading, dotted, keys = "", "", ""
    for step in _STEP.finditer(place["path"] if place else ""):
        if isinstance(value, dict):
            value, kind = value[step["key"]], _field(kind, step["key"])
            keys += f".{step['key']}" if keys else step["key"]
        else:
            value, kind = value[int(step["index"])], _item(kind, int(step["index"]))
            keys += f"[{step['index']}]"
        if isinstance(value, dict) and isinstance(kind, inspect.StructType):
            name, _, index = keys.partition("[")
            dotted = f"{dotted}.{name}" if dotted else name
            heading = f"[[{dotted}]] number {int(index.rstrip(']')) + 1}: " if index else f"[{dotted}] "
            keys = ""
    if isinstance(value, dict) and isinstance(kind, inspect.StructType):
        return _wrong_keys(heading, value, kind) or heading + _PLACE.sub("", said)
    whole = f"{dotted}.{keys}" if dotted else keys
    return f"{heading}{keys} = {value!r} must be {_type_text(kind, whole)}"


def _wrong_keys(heading: str, value: dict[str, Any], kind: inspect.StructType) -> str:
    known = {field.encode_name: field for field in kind.fields}
    unknown = sorted(set(value) - set(known))
    if unknown:
        near = get_close_matches(unknown[0], known, 1)
        hint = f"; did you mean {near[0]!r}?" if near else ""
        return f"{heading}unknown key {', '.join(map(repr, unknown))}; known are {', '.join(sorted(known))}{hint}"
    missing = [name for name, field in known.items() if field.required and name not in value]
    return f"{heading}{', '.join(map(repr, missing))} is missing" if missing else ""


def _field(kind: Any, name: str) -> inspect.Type:
    return _bare(next(field.type for field in kind.fields if field.encode_name == name))


def _item(kind: Any, index: int) -> inspect.Type:
    return _bare(kind.item_types[index] if isinstance(kind, inspect.TupleType) else kind.item_type)


def _bare(kind: inspect.Type) -> inspect.Type:
    """Return the type of an optional key without None."""
    if isinstance(kind, inspect.UnionType):
        kinds = tuple(type_ for type_ in kind.types if not isinstance(type_, inspect.NoneType))
        return kinds[0] if len(kinds) == 1 else inspect.UnionType(kinds)
    return kind


def _type_text(kind: inspect.Type, name: str) -> str:
    """Return a description of the values of this type; ``name`` is the key."""
    words = _WORDS.get(type(kind))
    return words(kind, name) if words else f"of type {type(kind).__name__.removesuffix('Type').lower()}"


def _list(kind: inspect.VarTupleType, name: str) -> str:
    if isinstance(kind.item_type, inspect.StructType):
        return f"an array of tables: write [[{name}]], with two brackets, for each"
    return f"a list, each item {_type_text(kind.item_type, name)}"


def _number(kind: inspect.IntType | inspect.FloatType, _: str) -> str:
    noun = "number" if isinstance(kind, inspect.FloatType) else "whole number"
    low, most = kind.ge, kind.le
    if most not in {None, sys.float_info.max}:
        return f"a {noun} from {low:g} to {most:g}"
    if kind.gt == 0:
        return f"a positive {noun}"
    return f"a {noun}, and not negative" if low == 0 else f"a finite {noun}"


# What a text in a statement must be, in words, for each regular expression of the schema.
_TEXTS: Final = {
    r"^[A-Z]+ /\S*$": "a method and a path on the device, such as 'POST /login', and no URL",
    r"^/\S+$": "a full ROS name, which begins with '/'",
    r"^[A-Za-z]\w*/msg/[A-Za-z]\w*$": "a message type such as 'nav_msgs/msg/Odometry'",
    r"^[A-Za-z]\w*/srv/[A-Za-z]\w*$": "a service type such as 'std_srvs/srv/SetBool'",
    r"^[A-Za-z]\w*/action/[A-Za-z]\w*$": "an action type such as 'nav2_msgs/action/NavigateToPose'",
    "^/": "a JSON pointer, such as '/access_token'",
    r"^(bearer|(header|query|cookie) \S+)$": "'bearer', 'header NAME', 'query NAME' or 'cookie NAME'",
}


_WORDS: dict[type[inspect.Type], Callable[[Any, str], str]] = {
    inspect.BoolType: lambda _, __: "true or false",
    inspect.IntType: _number,
    inspect.FloatType: _number,
    inspect.StrType: lambda kind, _: _TEXTS.get(
        kind.pattern or "", "a string" + " that is not empty" * bool(kind.min_length)
    ),
    inspect.DateType: lambda _, __: "a date: YYYY-MM-DD, without quotes",
    inspect.LiteralType: lambda kind, _: f"one of {', '.join(map(str, kind.values))}",
    inspect.EnumType: lambda kind, _: f"one of {', '.join(str(item.value) for item in kind.cls)}",
    inspect.StructType: lambda _, name: f"a table: [{name}]",
    inspect.TupleType: lambda kind, _: f"{len(kind.item_types)} numbers",
    inspect.VarTupleType: _list,
    inspect.UnionType: lambda kind, name: " or ".join(_type_text(item, name) for item in kind.types),
}
