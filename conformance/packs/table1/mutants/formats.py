"""Mutants with faults in content negotiation, XML, plain text or problem details."""

import re
from collections.abc import Callable
from typing import Any

from conformance.mutation.changes import Make, When, altered, header, problem, rest, secretly, success, text
from conformance.mutation.messages import Forward, Request, Response
from conformance.mutation.table import Table
from conformance.mutation.xml_trees import each, named, says, tree
from conformance.packs.table1.mutants.paths import GOAL, LINEAR, POSE, VELOCITY

MUTANTS = Table()
_mutant = MUTANTS.of_class("rest-formats", "rest")

_GET = rest("GET")
_PUT = rest("PUT", VELOCITY, LINEAR, GOAL)
_SMALL = 32 * 1024


def _typed(media_type: str) -> Callable[[Response], bool]:
    return lambda response: success(response) and response.media_type == media_type


_XML, _TEXT, _JSON = _typed("application/xml"), _typed("text/plain"), _typed("application/json")


def _accept(edit: Callable[[str], str]) -> Callable[[Request], None]:
    def apply(request: Request) -> None:
        given = request.field("Accept")
        if given is not None:
            request.put("Accept", edit(given))

    return apply


def _any_is_xml(request: Request) -> None:
    if (request.field("Accept") or "*/*").strip() in {"*/*", ""}:
        request.put("Accept", "application/xml")


def _told(edit: Callable[[Response], object], when: When = success) -> Make:
    """Return a change that applies ``edit`` to responses to GET."""
    return altered(_GET, edit, when)


def _shortened(root: Any) -> None:
    """Remove the last item of a list in an XML response."""
    for name in ("covariance", "sensor", "item", "service"):
        found = named(root, name)
        if len(found) > 1:
            found[-1].getparent().remove(found[-1])
            return
        if found and len(found[0]) > 1:
            found[0].remove(found[0][-1])
            return
    if len(root) > 1:
        root.remove(root[-1])


def _rounded(root: Any) -> None:
    for node in root.iter():
        if isinstance(node.tag, str) and re.fullmatch(r"\s*[+-]?\d*\.\d+([eE][+-]?\d+)?\s*", node.text or ""):
            node.text = f"{float(node.text):.1f}"


def _as_properties(response: Response) -> None:
    response.body = (
        re.sub(rb"(?m)^(\s*)([\w-]+):", rb"\1\2 =", response.body).replace(b"  ", b"\t") + b"\n: [unclosed\n"
    )


@_mutant("format-no-xml-input", "xml-input", "PUT with an XML body returns 415.")
def _no_xml_input(request: Request, forward: Forward) -> Response:
    if _xml_put(request):
        return problem(415, f"Content-Type: {request.media_type} is not taken")(request)
    return forward(request)


def _xml_put(request: Request) -> bool:
    return _PUT(request) and request.media_type.endswith("xml")


def _no_id(request: Request) -> None:
    request.body = re.sub(rb"<goal_id>.*</goal_id>", b"", request.body, flags=re.DOTALL)


def _unsigned(request: Request) -> None:
    request.body = request.body.replace(b">-", b">")


def _json_problem(response: Response) -> None:
    detail = re.sub(rb"<[^>]+>", b" ", response.body).decode("utf-8", "replace").replace('"', "'")
    made = problem(response.status, detail if response.media_type.endswith("xml") else "no")
    if response.media_type.endswith("xml"):
        response.body = made(Request("rest", "GET")).body
        response.put("Content-Type", "application/problem+json")


_mutant("format-xml-by-default", "json-default", "A request without Accept gets XML.").rewritten(_GET, _any_is_xml)
_mutant("format-xml-broken", "xml", "The last end tag of XML responses is missing.").altered(
    _GET, text(r"</\w+>\s*$", ""), _XML
)
_mutant("format-xml-as-html", "xml", "XML responses have the media type text/html.").altered(
    _GET, header("Content-Type", "text/html; charset=utf-8"), _XML
)
_mutant("format-xml-item-missing", "same-values", "XML responses lack the last item of an array.").altered(
    _GET, tree(_shortened), _XML
)
_mutant("format-xml-root", "xml-root", "The root element of XML responses is always <response>.").altered(
    _GET, tree(lambda root: setattr(root, "tag", "response")), _XML
)
_mutant("format-xml-stray", "xml", "In XML responses text stands between the fields.").altered(
    _GET, tree(lambda root: setattr(root, "text", "ok")), _XML
)
_mutant("format-text-unreadable", "text", "Plain text responses are not YAML.").altered(_GET, _as_properties, _TEXT)
_mutant("format-text-as-octets", "text", "Plain text responses have the media type application/octet-stream.").altered(
    _GET, header("Content-Type", "application/octet-stream"), _TEXT
)
_mutant("format-xml-rounded", "same-values", "XML responses round numbers to one digit.").altered(
    _GET, tree(_rounded), _XML
)
_mutant("format-text-rounded", "same-values", "Plain text responses round small numbers to 0.0.").altered(
    rest("GET", POSE), text(r"0\.0\d+", "0.0"), _TEXT
)
_mutant("format-text-without-frame", "same-values", "Plain text responses lack child_frame_id.").altered(
    rest("GET", POSE), text(r"child_frame_id:[^\n]*\n", ""), _TEXT
)
_mutant("format-q-ignored", "q-values", "The robot ignores quality values in Accept.").rewritten(
    _GET, _accept(lambda given: re.sub(r"\s*;\s*q=0?\.[0-9]+", "", given))
)
_mutant(
    "format-wildcard-wins", "specific-range", "In Accept, a wildcard takes precedence over a specific media type."
).rewritten(_GET, _accept(lambda given: "*/*" if re.search(r"\*/\*(?!\s*;\s*q=0(\.0*)?\s*(,|$))", given) else given))
_mutant("format-no-vary", "vary", "Responses have no Vary header.").altered(_GET, header("Vary", None))
_mutant("format-vary-sometimes", "vary", "XML responses have no Vary header.").altered(_GET, header("Vary", None), _XML)
_mutant("format-charset-wrong", "charset", "XML and text responses in UTF-8 declare charset=utf-16.").altered(
    _GET, lambda answer: answer.put("Content-Type", f"{answer.media_type}; charset=utf-16")
)
_mutant(
    "format-named-twice", "http/field-once", "Responses have two Content-Type headers with different media types."
).altered(_GET, lambda answer: answer.fields.append(("Content-Type", "text/html")))
_mutant("format-large-xml", "xml-input", "XML bodies over 32 KiB return 413.").instead(
    lambda request: _xml_put(request) and len(request.body) > _SMALL, problem(413, "too large")
)
_mutant("format-xml-id-lost", "xml-input", "A goal that is sent as XML gets another id.").rewritten(_xml_put, _no_id)
_mutant(
    "format-xml-velocity-unsigned",
    "rest-resources/velocity-converges",
    "A velocity that is sent as XML is obeyed without its signs.",
).made(secretly(lambda request: _xml_put(request) and request.path == VELOCITY, _unsigned))
_mutant(
    "format-text-unquoted",
    "text-quoted",
    "Plain text responses never quote ids, so that YAML may read them as other types.",
).altered(_GET, text(r"(?m)^(\s*id: )['\"]([^'\"\\]*)['\"]", r"\1\2"), _TEXT)
_mutant("format-text-null", "text-quoted", "Plain text responses do not quote the ids null and true.").altered(
    _GET, text(r"(?m)^(\s*id: )['\"](null|true)['\"]", r"\1\2"), _TEXT
)
_mutant("format-xml-whole-seconds", "same-values", "In XML, the pose's stamp has nanosec 0.").xml(
    rest("GET", POSE), each("nanosec", says("0")), _XML
)
_mutant(
    "format-problems-in-json", "problem-xml", "Errors of GET are JSON although the client accepts only XML."
).altered(_GET, _json_problem, lambda response: response.status >= 400)
_mutant(
    "format-problems-of-input-in-json", "problem-xml", "Errors of PUT are JSON although the client accepts only XML."
).altered(_PUT, _json_problem, lambda response: response.status >= 400)
