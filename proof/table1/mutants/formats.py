"""Mutants with faults in content negotiation, XML, plain text or problem details."""

import re
from collections.abc import Callable
from typing import Any

from proof.mutation.changes import Make, When, altered, problem, rest, secretly, success
from proof.mutation.messages import Forward, Request, Response
from proof.mutation.table import Table
from proof.mutation.xml_trees import find_named, tree
from proof.table1.mutants.paths import GOAL, LINEAR, VELOCITY

MUTANTS = Table()
_mutant = MUTANTS.of_class("rest-formats", "rest")

_GET = rest("GET")
_PUT = rest("PUT", VELOCITY, LINEAR, GOAL)
_SMALL = 32 * 1024


def _of_type(media_type: str) -> Callable[[Response], bool]:
    return lambda response: success(response) and response.media_type == media_type


_XML, _TEXT, _JSON = _of_type("application/xml"), _of_type("text/plain"), _of_type("application/json")


def _accept(edit: Callable[[str], str]) -> Callable[[Request], None]:
    def apply(request: Request) -> None:
        given = request.field("Accept")
        if given is not None:
            request.put("Accept", edit(given))

    return apply


def _any_is_xml(request: Request) -> None:
    if (request.field("Accept") or "*/*").strip() in {"*/*", ""}:
        request.put("Accept", "application/xml")


def _edit_reads(edit: Callable[[Response], object], when: When = success) -> Make:
    """Return a change that applies ``edit`` to responses to GET."""
    return altered(_GET, edit, when)


def _shorten(root: Any) -> None:
    """Remove the last item of a list in an XML response."""
    for name in ("covariance", "sensor", "item", "service"):
        found = find_named(root, name)
        if len(found) > 1:
            found[-1].getparent().remove(found[-1])
            return
        if found and len(found[0]) > 1:
            found[0].remove(found[0][-1])
            return
    if len(root) > 1:
        root.remove(root[-1])


def _round(root: Any) -> None:
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


def _drop_signs(request: Request) -> None:
    request.body = request.body.replace(b">-", b">")


def _json_problem(response: Response) -> None:
    detail = re.sub(rb"<[^>]+>", b" ", response.body).decode("utf-8", "replace").replace('"', "'")
    made = problem(response.status, detail if response.media_type.endswith("xml") else "no")
    if response.media_type.endswith("xml"):
        response.body = made(Request("rest", "GET")).body
        response.put("Content-Type", "application/problem+json")


_mutant("format-xml-root", "xml-root", "The root element of XML responses is always <response>.").altered(
    _GET, tree(lambda root: setattr(root, "tag", "response")), _XML
)
_mutant("format-q-ignored", "q-values", "The robot ignores quality values in Accept.").rewritten(
    _GET, _accept(lambda given: re.sub(r"\s*;\s*q=0?\.[0-9]+", "", given))
)
_mutant(
    "format-wildcard-wins", "specific-range", "In Accept, a wildcard takes precedence over a specific media type."
).rewritten(_GET, _accept(lambda given: "*/*" if re.search(r"\*/\*(?!\s*;\s*q=0(\.0*)?\s*(,|$))", given) else given))
_mutant("format-charset-wrong", "charset", "XML and text responses in UTF-8 declare charset=utf-16.").altered(
    _GET, lambda answer: answer.put("Content-Type", f"{answer.media_type}; charset=utf-16")
)
_mutant(
    "format-named-twice", "http/field-once", "Responses have two Content-Type headers with different media types."
).altered(_GET, lambda answer: answer.fields.append(("Content-Type", "text/html")))
_mutant(
    "format-xml-velocity-unsigned",
    "rest-resources/velocity-converges",
    "A velocity that is sent as XML is obeyed without its signs.",
).made(secretly(lambda request: _xml_put(request) and request.path == VELOCITY, _drop_signs))
