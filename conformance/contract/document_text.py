"""Read the text of a description: JSON as JSON (RFC 8259), anything else as YAML 1.2.

YAML's plain scalars are read by the core schema of YAML 1.2.2 (10.3): ``no``, ``on``, ``12:30:45`` and dates are texts.
A number with a leading zero is a text as well, because OpenAPI limits YAML to what JSON has.
"""

import codecs
import json
import re
import sys
from typing import Any, Final

import yaml

# Budget of a description. The largest known ones have 12 MB, 500,000 values, and lie 60 deep.
_MOST_OCTETS: Final = 32 * 1024 * 1024
_MOST_NODES: Final = 1_000_000
_DEEPEST: Final = 100
_LONGEST_NAME: Final = 8_192
# Characters before the values of a JSON text: each value but the first follows one of them. Strings may contain them
# too.
_MARKS_OF_VALUES: Final = ",[{"
# Most digits of a whole number: a longer one exceeds every double.
_MOST_DIGITS: Final = 400
# Most characters of a name, and most names of a path, that a message shows.
_SHOWN: Final = 60
_PLAIN: Final = "roaas:plain"
_TAG: Final = "tag:yaml.org,2002:"
_MARKS: Final = (
    (codecs.BOM_UTF8, "utf-8-sig"), (codecs.BOM_UTF32_LE, "utf-32"), (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"), (codecs.BOM_UTF16_BE, "utf-16"),
)  # fmt: skip
_NULL: Final = re.compile(r"~|null|Null|NULL|")
_BOOLEAN: Final = re.compile(r"true|True|TRUE|false|False|FALSE")
_WHOLE: Final = re.compile(r"[-+]?(?:0|[1-9][0-9]*)")
_BASED: Final = re.compile(r"0(?:o[0-7]+|x[0-9a-fA-F]+)")
_REAL: Final = re.compile(r"[-+]?(?:\.[0-9]+|(?:0|[1-9][0-9]*)(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?")
_INFINITE: Final = re.compile(r"[-+]?\.(?:inf|Inf|INF)")
# libyaml's loader, where PyYAML was built with it.
_Loader: Final[Any] = getattr(yaml, "CBaseLoader", yaml.BaseLoader)


def parsed(octets: bytes, source: str = "") -> Any:
    """Return the content of a JSON or YAML document as JSON values.

    Args:
        octets: UTF-8, or UTF-16 or UTF-32 with a byte order mark.
        source: its URL or path; one that ends with .json holds no YAML.

    Raises:
        ValueError: it is neither, or is longer or nested deeper than any description; the message names the place.
    """
    if len(octets) > _MOST_OCTETS:
        raise ValueError(f"it has {len(octets):,} bytes; the limit is {_MOST_OCTETS:,}")
    text = octets.decode(next((name for mark, name in _MARKS if octets.startswith(mark)), "utf-8"))
    if not text.lstrip().startswith("{"):
        return _yaml(text)
    try:
        return _json(text)
    except json.JSONDecodeError:
        if source.lower().endswith(".json"):
            raise
        return _yaml(text)


def _json(text: str) -> Any:
    if sum(map(text.count, _MARKS_OF_VALUES)) > 4 * _MOST_NODES:
        raise ValueError(f"it holds more than {_MOST_NODES:,} values")
    try:
        value = json.loads(text, parse_constant=_refuse, parse_float=_real, parse_int=_whole)
    except RecursionError as error:
        raise ValueError(f"it is nested too deeply; the limit is {_DEEPEST} levels") from error
    # Each entry: a value, and the values that contain it, innermost first.
    waiting: list[tuple[Any, Any, int]] = [(value, None, 0)]
    nodes = 1
    while waiting:
        part, trail, depth = waiting.pop()
        nodes += len(part)
        if depth > _DEEPEST or nodes > _MOST_NODES:
            over = f"more than {_MOST_NODES:,} values" if nodes > _MOST_NODES else f"more than {_DEEPEST} levels"
            raise ValueError(f"it holds {over}, at {_pointer(trail)}")
        for name, item in part.items() if isinstance(part, dict) else enumerate(part):
            if isinstance(name, str) and len(name) > _LONGEST_NAME:
                raise ValueError(
                    f"a name has {len(name):,} characters; the limit is {_LONGEST_NAME:,}, at {_pointer(trail)}"
                )
            if item and isinstance(item, dict | list):
                waiting.append((item, (name, trail), depth + 1))
    return value


def _pointer(trail: Any) -> str:
    names: list[str] = []
    while trail is not None:
        name, trail = trail
        names.append(str(name)[:_SHOWN].replace("~", "~0").replace("/", "~1"))
    return "#/" + "/".join(names[: -_SHOWN - 1 : -1])


def _refuse(name: str) -> float:
    raise json.JSONDecodeError(f"{name} is no number of JSON", name, 0)


def _real(text: str) -> float:
    """Return a number as a double; a number beyond the range becomes the last double, as bounds compare alike."""
    return max(-sys.float_info.max, min(sys.float_info.max, float(text)))


def _whole(text: str) -> int | float:
    return int(text, 0) if len(text) <= _MOST_DIGITS else _real(f"{text[:1] if text[0] == '-' else ''}9e999")


def _yaml(text: str) -> Any:
    reader = _Reader(text)
    try:
        return reader.document()
    except yaml.YAMLError as error:
        raise ValueError(" ".join(str(error).replace('in "<unicode string>", ', "at ").split())) from error
    finally:
        reader.close()


class _Reader:
    """Builds values from YAML events one by one, counting them as they are read."""

    def __init__(self, text: str) -> None:
        self._loader = _Loader(text)
        self._event: Any = None
        # Its value, and the nodes and bytes that an alias adds, by anchor.
        self._anchors: dict[str, tuple[Any, int, int]] = {}
        self._nodes = self._octets = 0

    def close(self) -> None:
        self._loader.dispose()

    def document(self) -> Any:
        """Return the value of the only document, or None."""
        self._next()
        if isinstance(self._next(), yaml.StreamEndEvent):
            return None
        self._next()
        value = self._value(0)
        self._next()
        if not isinstance(self._next(), yaml.StreamEndEvent):
            raise ValueError(f"a second document at line {self._line}")  # noqa: TRY004 - of the text
        return value

    @property
    def _line(self) -> int:
        return int(self._event.start_mark.line) + 1

    def _next(self) -> Any:
        self._event = self._loader.get_event()
        return self._event

    def _count(self, nodes: int, octets: int, depth: int) -> None:
        self._nodes += nodes
        self._octets += octets
        over = {
            f"{_MOST_NODES:,} values": self._nodes > _MOST_NODES,
            f"{_MOST_OCTETS:,} characters": self._octets > _MOST_OCTETS,
            f"{_DEEPEST} levels": depth > _DEEPEST,
        }
        if any(over.values()):
            limit = next(limit for limit, is_over in over.items() if is_over)
            raise ValueError(f"it holds more than {limit}, with what its aliases repeat, at line {self._line}")

    def _value(self, depth: int) -> Any:
        """Return the value that begins with the event at hand, which its last event follows."""
        event, nodes, octets = self._event, self._nodes, self._octets
        if isinstance(event, yaml.AliasEvent):
            if event.anchor not in self._anchors:
                raise ValueError(f"the alias *{event.anchor} of nothing, or of what holds it, at line {self._line}")
            value, nodes, octets = self._anchors[event.anchor]
            self._count(nodes, octets, depth)
            return _copy(value)
        is_scalar = isinstance(event, yaml.ScalarEvent)
        self._count(1, len(event.value) if is_scalar else 0, depth)
        if event.anchor is not None:
            self._anchors.pop(event.anchor, None)
        if is_scalar:
            value = _scalar(_tag_of(event), event.value)
        elif isinstance(event, yaml.SequenceStartEvent):
            value = []
            while not isinstance(self._next(), yaml.SequenceEndEvent):
                value.append(self._value(depth + 1))
        else:
            value = self._mapping(depth + 1)
        if event.anchor is not None:
            self._anchors[event.anchor] = value, self._nodes - nodes, self._octets - octets
        return value

    def _mapping(self, depth: int) -> dict[str, Any]:
        own: dict[str, Any] = {}
        merged: dict[str, Any] = {}
        while not isinstance(self._next(), yaml.MappingEndEvent):
            tag, key = _PLAIN, self._key()
            if isinstance(self._event, yaml.ScalarEvent):
                tag = _tag_of(self._event)
            self._count(0, len(key), depth)
            if len(key) > _LONGEST_NAME:
                raise ValueError(f"a key of {len(key):,} characters at line {self._line}")
            self._next()
            value = self._value(depth)
            # YAML 1.2 has no merge key, but the tools that write and read descriptions do.
            parts = value if isinstance(value, list) else [value]
            if tag == _PLAIN and key == "<<" and all(isinstance(part, dict) for part in parts):
                for part in parts:
                    merged = {**part, **merged}
            else:
                own[key] = value
        return {**merged, **own}

    def _key(self) -> str:
        event = self._event
        if isinstance(event, yaml.ScalarEvent):
            if event.anchor is not None:
                self._anchors[event.anchor] = event.value, 1, len(event.value)
            return str(event.value)
        value, _, _ = self._anchors.get(event.anchor or "", (None, 0, 0))
        if not isinstance(event, yaml.AliasEvent) or not isinstance(value, str):
            raise ValueError(f"a key that is no text at line {self._line}")  # noqa: TRY004 - of the text
        return value


def check_yaml(text: str) -> None:
    """Check that a parser can build a YAML document: too deep nesting overflows libyaml's stack.

    Raises:
        ValueError: it is nested too deeply, or its aliases repeat too much.
        yaml.YAMLError: it is no YAML.
    """
    loader = _Loader(text)
    sizes: dict[str, int] = {}
    around: list[tuple[str | None, int]] = []
    nodes = 0
    try:
        while not isinstance(event := loader.get_event(), yaml.StreamEndEvent):
            if isinstance(event, yaml.AliasEvent):
                if event.anchor not in sizes:
                    raise ValueError(f"the alias *{event.anchor} of nothing, or of what holds it")
                nodes += sizes[event.anchor]
            elif isinstance(event, yaml.ScalarEvent | yaml.CollectionStartEvent):
                nodes += 1
                if isinstance(event, yaml.CollectionStartEvent):
                    around.append((event.anchor, nodes))
                elif event.anchor is not None:
                    sizes[event.anchor] = 1
            elif isinstance(event, yaml.CollectionEndEvent):
                anchor, begin = around.pop()
                if anchor is not None:
                    sizes[anchor] = nodes - begin + 1
            if nodes > _MOST_NODES or len(around) > _DEEPEST:
                limit = f"{_MOST_NODES:,} values, with what its aliases repeat" if nodes > _MOST_NODES else "100 levels"
                raise ValueError(f"it holds more than {limit}")
    finally:
        loader.dispose()


def _tag_of(event: Any) -> str:
    """Return a scalar's tag; `_PLAIN` if the text of a plain scalar decides its type."""
    if event.tag is not None and event.tag != "!":
        return str(event.tag)
    return _PLAIN if event.implicit[0] else _TAG + "str"


def _copy(value: Any) -> Any:
    if isinstance(value, list):
        return [_copy(item) for item in value]
    return {key: _copy(item) for key, item in value.items()} if isinstance(value, dict) else value


def _scalar(tag: str, text: str) -> Any:
    """Return a scalar's value by its tag, or by its text where it is plain."""
    if tag not in {_PLAIN, *(_TAG + name for name in ("null", "bool", "int", "float"))}:
        return text
    if _NULL.fullmatch(text) or _BOOLEAN.fullmatch(text):
        return {"true": True, "false": False}.get(text.lower())
    if _WHOLE.fullmatch(text):
        return _whole(text.removeprefix("+"))
    if _BASED.fullmatch(text):
        return _whole(text)
    if _REAL.fullmatch(text):
        return _real(text)
    return _real(text.replace(".", "")) if _INFINITE.fullmatch(text) else text
