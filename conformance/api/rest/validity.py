"""Whether a request is valid by the contract, read back from what goes over the wire."""

import math
import re
from dataclasses import dataclass
from urllib.parse import parse_qsl, unquote

from conformance.contract.pack import Contract
from conformance.documents.json_schema import Schema, kinds_of, shape_of
from conformance.documents.json_text import read_json
from conformance.documents.openapi import Operation, Parameter, is_json, is_xml
from conformance.documents.representation import UnreadableError, from_element, local_name, parse_xml
from conformance.documents.resources import is_normal, matching
from conformance.verdict.evidence import HarnessError

VALID, INVALID, UNCLEAR = "valid", "invalid", "unclear"
# The contract's grammar of numbers in paths and queries (fine print).
_NUMBER = re.compile(r"[+-]?(?:\d+(?:\.\d+)?|\.\d+)(?:[eE][+-]?\d+)?", re.ASCII)
_INTEGER = re.compile(r"[+-]?\d+", re.ASCII)
# Texts that no reader takes for a number: nothing, or a letter where a number has none.
_NO_NUMBER = re.compile(r"|.*[A-DF-Za-df-z].*|[eE].*", re.DOTALL)
# Digits of an integer.
_BEYOND_EVERY_BOUND = 40
_RULES = {
    "required": "json-missing",
    "additionalProperties": "json-unknown",
    "unevaluatedProperties": "json-unknown",
    "type": "json-type",
}


@dataclass(frozen=True)
class Validity:
    """The verdict on a request.

    Attributes:
        verdict: valid, invalid, or unclear (then a robot may accept or refuse it).
        operation: the one that it is for, or None.
        requirement: name in class strict-input of what asks for its refusal.
        why: what is wrong with it.
    """

    verdict: str
    operation: Operation | None = None
    requirement: str = ""
    why: str = ""


def validity(contract: Contract, method: str, target: str, media_type: str, body: bytes) -> Validity:
    """Return the verdict on a request.

    Args:
        contract: the contract to judge by.
        method: as sent.
        target: path and query below the base URL, as sent.
        media_type: without parameters; empty where there is none.
        body: octets.
    """
    path, _, query = target.partition("?")
    operation = matching(contract, method, path)
    if operation is None or method != operation.method or not is_normal(path):
        return Validity(UNCLEAR)
    said = validity_by(operation, path, query, media_type, body)
    if said.requirement == "json-unknown" and _is_shown(contract, path, operation.bodies[media_type].schema, body):
        return Validity(UNCLEAR, operation)
    return said


def validity_by(operation: Operation, path: str, query: str, media_type: str, body: bytes) -> Validity:
    """Return the verdict on a request by the description of its operation alone; the arguments are as in validity()."""
    found = [*_of_path(operation, path), *_of_query(operation, query), _of_body(operation, media_type, body)]
    for wanted in (UNCLEAR, INVALID):
        for verdict, requirement, why in found:
            if verdict == wanted:
                return Validity(verdict, operation, requirement, why)
    return Validity(VALID, operation)


def require_valid(contract: Contract, method: str, target: str, media_type: str = "", body: bytes = b"") -> None:
    """Check that a request which the suite sends as a valid one is not invalid by the contract.

    Raises:
        HarnessError: the request is invalid; the message says why.
    """
    said = validity(contract, method, target, media_type, body)
    if said.verdict == INVALID:
        raise HarnessError(f"{method} {target[:200]} was made as a valid request, and is invalid: {said.why}")


_Said = tuple[str, str, str]


def _of_path(operation: Operation, path: str) -> list[_Said]:
    names = re.findall(r"\{([^{}]*)\}", operation.template)
    pattern = re.compile(re.sub(r"\\\{[^{}]*\\\}", "([^/]*)", re.escape(operation.template)))
    match = pattern.fullmatch(path)
    if match is None:
        return [(UNCLEAR, "", "")]
    texts = dict(zip(names, match.groups(), strict=True))
    return [
        _of_text(item, unquote(texts[item.name]), "path-parameter")
        for item in operation.parameter("path")
        if item.name in texts
    ]


def _of_query(operation: Operation, query: str) -> list[_Said]:
    given = parse_qsl(query, keep_blank_values=True)
    known = {item.name: item for item in operation.parameter("query")}
    texts = dict(given)
    said: list[_Said] = []
    if len(texts) < len(given) or set(texts) - set(known):
        said.append((UNCLEAR, "", ""))
    for name, item in known.items():
        if name in texts:
            said.append(_of_text(item, texts[name], "query-parameter"))
        elif item.required and "object" not in kinds_of(item.schema):
            # An object may be written as its members.
            said.append((INVALID, "query-missing", f"no parameter {name}"))
    return said


def _of_text(parameter: Parameter, text: str, requirement: str) -> _Said:
    """Judge a parameter's text, read as each of its types; near misses of a number are unclear (fine print)."""
    kinds = kinds_of(parameter.schema) or {"string"}
    if not kinds <= {"number", "integer", "string"} or ("string" in kinds and not text):
        return UNCLEAR, "", ""
    readings: list[str | float] = [text] if "string" in kinds else []
    is_clear = True
    if kinds != {"string"} and not _NO_NUMBER.fullmatch(text):
        is_clear = bool((_NUMBER if "number" in kinds else _INTEGER).fullmatch(text))
        if is_clear and math.isfinite(float(text)):
            is_whole = "number" not in kinds and len(text) < _BEYOND_EVERY_BOUND
            readings.append(int(text) if is_whole else float(text))
    shape = shape_of(parameter.schema)
    if not all(shape.problem(value) for value in readings):
        return VALID, "", ""
    return (INVALID, requirement, f"{text[:40]!r} at {parameter.name}") if is_clear else (UNCLEAR, "", "")


def _of_body(operation: Operation, media_type: str, body: bytes) -> _Said:
    if not operation.bodies:
        return (UNCLEAR, "", "") if body else (VALID, "", "")
    if media_type not in operation.bodies:
        return UNCLEAR, "", ""
    schema = operation.bodies[media_type].schema
    if is_json(media_type):
        return json_fault(body, schema)
    if is_xml(media_type):
        return _xml_fault(body, schema)
    return UNCLEAR, "", ""


def json_fault(body: bytes, schema: Schema) -> _Said:
    """Return what is wrong with a JSON body, and the requirement that asks for its refusal."""
    text = read_json(body)
    for there, requirement in (
        (not body.strip(), "json-empty"),
        (text.encoding, "json-encoding"),
        (text.non_finite, "json-non-finite"),
        (text.malformed, "json-malformed"),
        (text.twice, "json-duplicate"),
    ):
        if there:
            return INVALID, requirement, text.problem or "no body"
    problem = shape_of(schema).problem(text.value)
    if not problem:
        return VALID, "", ""
    rule, whole = shape_of(schema).broken_rule(text.value)
    requirement = "json-root" if whole and rule == "type" else _RULES.get(rule, "json-bounds")
    return INVALID, requirement, problem


def _is_shown(contract: Contract, path: str, schema: Schema, body: bytes) -> bool:
    """Return whether a JSON body is valid but for members that the resource's own GET shows: it may be put back."""
    reading, value = matching(contract, "GET", path), read_json(body).value
    shown = (reading.shape or {}).get("properties", {}) if reading else {}
    if not isinstance(value, dict):
        return False
    kept = {name: part for name, part in value.items() if name in schema.get("properties", {}) or name not in shown}
    return shape_of(schema).holds(kept)


def _xml_fault(body: bytes, schema: Schema) -> _Said:
    """Return what is wrong with an XML body; one that looks right may have more in it, and is unclear."""
    try:
        root = parse_xml(body)
    except UnreadableError as error:
        return INVALID, "xml-body", str(error)
    wanted = schema.get("xml", {}).get("name")
    if wanted and local_name(root) != wanted:
        return INVALID, "xml-body", f"the root element {local_name(root)!r}"
    problem = shape_of(schema).problem(from_element(root, schema))
    return (INVALID, "xml-body", problem) if problem else (UNCLEAR, "", "")
