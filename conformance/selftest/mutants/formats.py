"""Robots whose formats do not agree, or are not what was asked for."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

from conformance.selftest.mutants.changes import (
    GOAL,
    LINEAR,
    POSE,
    VELOCITY,
    altered,
    header,
    named,
    problem,
    rest,
    rewritten,
    success,
    text,
    tree,
)
from conformance.selftest.mutants.mutant import Fault
from conformance.selftest.wire import Ask

if TYPE_CHECKING:
    from collections.abc import Callable

    from conformance.selftest.wire import Answer

_GET = rest("GET")
_PUT = rest("PUT", VELOCITY, LINEAR, GOAL)


def _typed(media_type: str) -> Callable[[Answer], bool]:
    return lambda answer: success(answer) and answer.media_type == media_type


_XML, _TEXT, _JSON = _typed("application/xml"), _typed("text/plain"), _typed("application/json")


def _accept(edit: Callable[[str], str]) -> Callable[[Ask], None]:
    def apply(ask: Ask) -> None:
        given = ask.field("Accept")
        if given is not None:
            ask.put("Accept", edit(given))

    return apply


def _any_is_xml(ask: Ask) -> None:
    if (ask.field("Accept") or "*/*").strip() in {"*/*", ""}:
        ask.put("Accept", "application/xml")


def _renamed(root: Any) -> None:
    root.tag = "response"


def _shortened(root: Any) -> None:
    """Leave one of several items out."""
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


def _as_properties(answer: Answer) -> None:
    answer.body = re.sub(rb"(?m)^(\s*)([\w-]+):", rb"\1\2 =", answer.body).replace(b"  ", b"\t") + b"\n: [unclosed\n"


def _fault(name: str, says: str, id_: str, make: Any) -> Fault:
    return Fault(name, says, (f"rest-formats/{id_}",), "rest", make)


def _no_xml_input(ask: Ask, forward: Callable[[Ask], Answer]) -> Answer:
    if _PUT(ask) and ask.media_type.endswith("xml"):
        return problem(415, f"Content-Type: {ask.media_type} is not taken")(ask)
    return forward(ask)


def _json_problem(answer: Answer) -> None:
    detail = re.sub(rb"<[^>]+>", b" ", answer.body).decode("utf-8", "replace").replace('"', "'")
    made = problem(answer.status, detail if answer.media_type.endswith("xml") else "no")
    if answer.media_type.endswith("xml"):
        answer.body = made(Ask("rest", "GET")).body
        answer.put("Content-Type", "application/problem+json")


FAULTS = (
    _fault("format-xml-by-default", "Without Accept, the answer is XML.", "json-default", rewritten(_GET, _any_is_xml)),
    _fault("format-xml-broken", "XML is not closed.", "xml", altered(_GET, text(r"</\w+>\s*$", ""), _XML)),
    _fault(
        "format-xml-as-html",
        "XML comes as text/html.",
        "xml",
        altered(_GET, header("Content-Type", "text/html; charset=utf-8"), _XML),
    ),
    _fault(
        "format-xml-item-missing",
        "XML lacks the last item of an array.",
        "same-values",
        altered(_GET, tree(_shortened), _XML),
    ),
    _fault("format-xml-root", "The root of XML is always <response>.", "xml-root", altered(_GET, tree(_renamed), _XML)),
    _fault("format-text-unreadable", "Text is no YAML.", "text", altered(_GET, _as_properties, _TEXT)),
    _fault(
        "format-text-as-octets",
        "Text comes as application/octet-stream.",
        "text",
        altered(_GET, header("Content-Type", "application/octet-stream"), _TEXT),
    ),
    _fault("format-xml-rounded", "XML rounds to one digit.", "same-values", altered(_GET, tree(_rounded), _XML)),
    _fault(
        "format-text-rounded",
        "Text rounds numbers down.",
        "same-values",
        altered(rest("GET", POSE), text(r"0\.0\d+", "0.0"), _TEXT),
    ),
    _fault(
        "format-text-without-frame",
        "Text leaves child_frame_id out.",
        "same-values",
        altered(rest("GET", POSE), text(r"child_frame_id:[^\n]*\n", ""), _TEXT),
    ),
    _fault(
        "format-q-ignored",
        "Quality values are ignored.",
        "q-values",
        rewritten(_GET, _accept(lambda given: re.sub(r"\s*;\s*q=0?\.[0-9]+", "", given))),
    ),
    _fault(
        "format-wildcard-wins",
        "A wildcard wins over a specific range.",
        "specific-range",
        rewritten(
            _GET, _accept(lambda given: "*/*" if re.search(r"\*/\*(?!\s*;\s*q=0(\.0*)?\s*(,|$))", given) else given)
        ),
    ),
    _fault("format-no-vary", "Answers carry no Vary.", "vary", altered(_GET, header("Vary", None))),
    _fault("format-vary-sometimes", "XML answers carry no Vary.", "vary", altered(_GET, header("Vary", None), _XML)),
    _fault("format-no-xml-input", "XML is not taken in PUT.", "xml-input", lambda: _no_xml_input),
    _fault(
        "format-problems-in-json",
        "Errors are JSON, although XML was asked for.",
        "problem-xml",
        altered(_GET, _json_problem, lambda answer: answer.status >= 400),
    ),
)
