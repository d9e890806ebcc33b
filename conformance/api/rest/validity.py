"""Decide whether a request is valid by the contract, read back from its bytes on the wire."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

from conformance.contract.pack import Contract
from conformance.documents.json_schema import Schema, kinds_of
from conformance.documents.json_shape import shape_of
from conformance.documents.json_text import read_json
from conformance.documents.openapi import Body, Operation, is_json, is_normal, is_xml, matching
from conformance.documents.parameter_reading import (
    INVALID,
    UNCLEAR,
    VALID,
    decoded_path,
    judge_texts,
    judged_json,
    multipart_verdict,
    query_verdicts,
    text_verdict,
    urlencoded_verdict,
)
from conformance.documents.parameters import Parameter
from conformance.documents.patterns import PatternError, SlowPatternError
from conformance.documents.representation import UnreadableError, from_element, local_name, parse_xml
from conformance.transport.exchange import media_type_of
from conformance.verdict.evidence import HarnessError

__all__ = ["INVALID", "UNCLEAR", "VALID"]

# Characters that a cookie's value may not contain (RFC 6265 4.1.1), and the percent sign, which some servers do not
# decode.
_NO_COOKIE = re.compile(r"[^!#-$&-+\--:<-\[\]-~]")
# Half a surrogate pair in JSON: "unpredictable" (RFC 8259 8.2).
_HALF = re.compile(
    rb"\\u[dD][89abAB][0-9a-fA-F]{2}(?!\\u[dD][c-fC-F])|(?<!\\u[dD][89abAB][0-9a-fA-F]{2})\\u[dD][c-fC-F]"
)
Headers = Sequence[tuple[str, str]]
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
        slow: the pattern that takes too long to judge it; empty for others.
    """

    verdict: str
    operation: Operation | None = None
    requirement: str = ""
    why: str = ""
    slow: str = ""


def validity(
    contract: Contract, method: str, target: str, content_type: str, body: bytes, headers: Headers | None = None
) -> Validity:
    """Return the verdict on a request.

    Args:
        contract: the contract to judge by.
        method: as sent.
        target: path and query below the base URL, as sent.
        content_type: empty where there is none.
        body: octets.
        headers: all header fields, to judge header and cookie parameters too; None if they are not judged.
    """
    path, _, query = target.partition("?")
    operation = matching(contract, method, path)
    if operation is None or method != operation.method or not is_normal(path):
        return Validity(UNCLEAR)
    said = validity_by(operation, path, query, content_type, body, headers)
    if said.requirement == "json-unknown":
        schema = operation.bodies[media_type_of(content_type)].schema
        if _is_shown(contract, path, schema, body):
            return Validity(UNCLEAR, operation)
    return said


def validity_by(
    operation: Operation, path: str, query: str, content_type: str, body: bytes, headers: Headers | None = None
) -> Validity:
    """Return the verdict on a request by the description of its operation alone; the arguments are as in validity()."""
    try:
        found = [*_of_path(operation, path), *_of_query(operation, query), _of_body(operation, content_type, body)]
        found += _of_headers(operation, headers) if headers is not None else []
    except SlowPatternError as error:
        return Validity(UNCLEAR, operation, slow=str(error))
    except PatternError:
        return Validity(UNCLEAR, operation)  # the requirement description/file-valid judges the pattern itself
    if any(verdict == UNCLEAR for verdict, _, _ in found):
        return Validity(UNCLEAR, operation)
    wrong = next(((requirement, why) for verdict, requirement, why in found if verdict == INVALID), None)
    return Validity(INVALID, operation, *wrong) if wrong else Validity(VALID, operation)


def require_valid(contract: Contract, method: str, target: str, media_type: str = "", body: bytes = b"") -> None:
    """Check that the contract does not forbid a request which the suite sends as valid.

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
        (
            judge_texts(item, [texts[item.name]], decoded_path),
            "path-parameter",
            f"{texts[item.name][:40]!r} at path {item.name}",
        )
        for item in operation.parameter("path")
        if item.name in texts
    ]


def _of_query(operation: Operation, query: str) -> list[_Said]:
    return [
        (verdict, "query-missing" if missing else "query-parameter", why)
        for verdict, why, missing in query_verdicts(operation.parameter("query"), query)
    ]


def _of_headers(operation: Operation, headers: Headers) -> list[_Said]:
    """Judge header and cookie parameters; a list in a header may be written in several fields."""
    said = []
    cookies = [pair.strip().partition("=") for _, text in _fields_of(headers, "cookie") for pair in text.split(";")]
    for item in (*operation.parameter("header"), *operation.parameter("cookie")):
        in_cookie = item.where == "cookie"
        texts = [part[2] for part in cookies if part[0] == item.name] if in_cookie else []
        texts = texts if in_cookie else [text.strip(" \t") for _, text in _fields_of(headers, item.name)]
        if not texts:
            said.append((INVALID if item.required else VALID, "header", f"no {item.where} {item.name}"))
        else:
            verdict = UNCLEAR if in_cookie and _NO_COOKIE.search("".join(texts)) else _of_header(item, texts)
            said.append((verdict, "header", f"{texts[0][:40]!r} at {item.where} {item.name}"))
    return said


def _of_header(item: Parameter, texts: Sequence[str]) -> str:
    kinds = kinds_of(item.schema)
    if len(texts) > 1 and not kinds <= {"array", "object"}:
        return UNCLEAR
    whole = ",".join(texts)
    # White space around the items of a list is optional (RFC 9110 5.6.1).
    return judge_texts(item, [re.sub(r"[ \t]*,[ \t]*", ",", whole) if kinds <= {"array", "object"} else whole])


def _fields_of(headers: Headers, name: str) -> list[tuple[str, str]]:
    return [(key, text) for key, text in headers if key.lower() == name.lower()]


def _of_body(operation: Operation, content_type: str, body: bytes) -> _Said:
    if not operation.bodies:
        return (UNCLEAR, "", "") if body else (VALID, "", "")
    if not body and not content_type and not operation.body_required:
        return VALID, "", ""
    media_type = media_type_of(content_type)
    if media_type not in operation.bodies:
        return UNCLEAR, "", ""
    given = operation.bodies[media_type]
    if is_json(media_type):
        return json_fault(body, given.schema)
    if is_xml(media_type):
        return _xml_fault(body, given.schema)
    return _of_form(media_type, content_type, body, given)


def _of_form(media_type: str, content_type: str, body: bytes, given: Body) -> _Said:
    """Judge a form or a text body; other media types are unclear."""
    if media_type == "application/x-www-form-urlencoded":
        verdict, why = urlencoded_verdict(body, given)
    elif media_type == "multipart/form-data":
        verdict, why = multipart_verdict(body, content_type, given)
    elif media_type == "text/plain" and kinds_of(given.schema) == {"string"}:
        verdict, why = text_verdict(body, given.schema), "the text in the body"
    else:
        verdict, why = UNCLEAR, ""
    return verdict, "form", why


def json_fault(body: bytes, schema: Schema) -> _Said:
    """Return the fault of a JSON body, and the requirement that demands its refusal."""
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
    if _HALF.search(body):
        return UNCLEAR, "", ""
    problem = shape_of(schema).problem(text.value)
    if not problem:
        return judged_json(schema, text.value), "", ""
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
    """Return the fault of an XML body; a body without a visible fault is unclear, as it may contain more."""
    try:
        root = parse_xml(body)
    except UnreadableError as error:
        return INVALID, "xml-body", str(error)
    wanted = schema.get("xml", {}).get("name")
    if wanted and local_name(root) != wanted:
        return INVALID, "xml-body", f"the root element {local_name(root)!r}"
    problem = shape_of(schema).problem(from_element(root, schema))
    return (INVALID, "xml-body", problem) if problem else (UNCLEAR, "", "")
