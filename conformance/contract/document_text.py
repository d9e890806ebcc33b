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

# An alias may repeat a large part; a few lines of them could name more nodes than a machine can hold.
_MOST_NODES: Final = 5_000_000
_DEEPEST: Final = 1_000
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
# A list in a list in a list ... on one line, which the parser would follow to the end of its stack.
_NESTED_LISTS: Final = re.compile(rf"(?:[-?:] +){{{_DEEPEST}}}")


class _Loader(getattr(yaml, "CBaseLoader", yaml.BaseLoader)):  # type: ignore[misc] # libyaml's, where there is one
    """Composes nodes; it marks plain scalars, whose type their text decides."""


_Loader.add_implicit_resolver(_PLAIN, re.compile(""), None)


def parsed(octets: bytes, source: str = "") -> Any:
    """Return the content of a JSON or YAML document as JSON values.

    Args:
        octets: UTF-8, or UTF-16 or UTF-32 with a byte order mark.
        source: its URL or path; one that ends with .json holds no YAML.

    Raises:
        ValueError: it is neither, or is nested too deeply, or its aliases repeat too much.
    """
    text = octets.decode(next((name for mark, name in _MARKS if octets.startswith(mark)), "utf-8"))
    try:
        if not text.lstrip().startswith("{"):
            return _yaml(text)
        try:
            return json.loads(text, parse_constant=_refused, parse_float=_real)
        except ValueError:
            if source.lower().endswith(".json"):
                raise
            return _yaml(text)
    except RecursionError as error:
        raise ValueError("it is nested too deeply") from error


def _refused(name: str) -> float:
    raise ValueError(f"{name} is no number of JSON")


def _real(text: str) -> float:
    """Return a number as a double; what is beyond every double becomes the last one, as bounds compare alike."""
    return max(-sys.float_info.max, min(sys.float_info.max, float(text)))


def _yaml(text: str) -> Any:
    depth = 0
    for found in re.finditer(r"[\[{]|[\]}]", text):
        depth = depth + 1 if found[0] in "[{" else max(0, depth - 1)
        if depth > _DEEPEST:
            raise ValueError("it is nested too deeply")
    if _NESTED_LISTS.search(text):
        raise ValueError("it is nested too deeply")
    try:
        node = yaml.compose(text, _Loader)
    except yaml.YAMLError as error:
        raise ValueError(" ".join(str(error).replace('in "<unicode string>", ', "at ").split())) from error
    if node is None:
        return None
    if _size(node, {}) > _MOST_NODES:
        raise ValueError(f"its aliases repeat more than {_MOST_NODES:,} nodes")
    return _value(node)


def _size(node: yaml.Node, known: dict[int, int]) -> int:
    """Return the number of nodes below a node, where each alias counts as often as it stands."""
    if isinstance(node, yaml.ScalarNode):
        return 1
    if id(node) not in known:
        known[id(node)] = _MOST_NODES + 1  # of a node inside itself
        parts = [part for pair in node.value for part in pair] if isinstance(node, yaml.MappingNode) else node.value
        known[id(node)] = 1 + sum(_size(part, known) for part in parts)
    return known[id(node)]


def _value(node: yaml.Node) -> Any:
    if isinstance(node, yaml.SequenceNode):
        return [_value(item) for item in node.value]
    if not isinstance(node, yaml.MappingNode):
        return _scalar(node.tag, node.value)
    own: dict[str, Any] = {}
    merged: dict[str, Any] = {}
    for key, item in node.value:
        if not isinstance(key, yaml.ScalarNode):
            raise ValueError(f"a key that is no text at line {key.start_mark.line + 1}")  # noqa: TRY004 - of the text
        value = _value(item)
        # YAML 1.2 has no merge key, but the tools that write and read descriptions do.
        parts = value if isinstance(value, list) else [value]
        if key.tag == _PLAIN and key.value == "<<" and all(isinstance(part, dict) for part in parts):
            for part in parts:
                merged = {**part, **merged}
        else:
            own[key.value] = value
    return {**merged, **own}


def _scalar(tag: str, text: str) -> Any:
    """Return a scalar's value by its tag, or by its text where it is plain."""
    if tag not in {_PLAIN, *(_TAG + name for name in ("null", "bool", "int", "float"))}:
        return text
    if _NULL.fullmatch(text) or _BOOLEAN.fullmatch(text):
        return {"true": True, "false": False}.get(text.lower())
    if _WHOLE.fullmatch(text):
        return int(text)
    if _BASED.fullmatch(text):
        return int(text, 0)
    if _REAL.fullmatch(text):
        return _real(text)
    return _real(text.replace(".", "")) if _INFINITE.fullmatch(text) else text
