"""A lending library as a web service, by the contract in data/library-contract; with some faults on request."""

import json
import re
from collections.abc import Callable
from email.message import Message
from pathlib import Path
from typing import Any
from urllib.parse import parse_qsl

import yaml

from proof.table1.independent_robots.plain import reading
from proof.table1.independent_robots.plain.reading import (
    MalformedError,
    RefusedError,
    as_json,
    choose,
    element,
    fit_element,
    parse_xml,
    write,
)
from proof.table1.independent_robots.plain.server import Answer, start

CONTRACT = Path(__file__).parent.parent / "data" / "library-contract"
_BOOK = {"title": "id", "year": "int32", "price": "double", "shelf": {"room": "id", "row": "int32"}}
_LEND = {"isbn": "int32", "member": "int32", "fee": "double"}
_SOAP = "http://schemas.xmlsoap.org/soap/envelope/"
_TNS = "urn:example:lending"
_ISBN = re.compile(r"/books/([^/]*)")
_FIRST = {"title": "Emma", "year": 1815, "price": 7.25, "shelf": {"room": "A", "row": 3}}


class Library:
    """Answers REST requests.

    Args:
        fault: name of what is wrong with this library, or empty.
    """

    def __init__(self, fault: str = "") -> None:
        self.books: dict[int, Any] = {9780141439600: _FIRST}
        self.fault = fault
        self.asked = 0
        self.log: list[tuple[str, str]] = []

    def answer(self, method: str, target: str, headers: Message, body: bytes) -> Answer:
        self.asked += 1
        self.log.append((method, target))
        accept = ", ".join(headers.get_all("Accept") or []) or None
        try:
            answer = self._answer(method, target, headers, body, accept)
        except RefusedError as refused:
            problem = {"status": refused.status, "detail": str(refused)}
            answer = Answer(refused.status, as_json(problem), "application/problem+json")
            if choose(accept) == "application/xml":
                xml = element("problem", problem).replace("<problem>", '<problem xmlns="urn:ietf:rfc:7807">')
                answer = Answer(refused.status, xml.encode(), "application/problem+xml")
            if refused.status == 405:
                answer.fields["Allow"] = ", ".join(self._methods(target.partition("?")[0]))
        answer.fields["Vary"] = "Accept"
        if self.fault == "every-20th-fails" and self.asked % 20 == 0:
            return Answer(500, b"Traceback (most recent call last)", "text/plain")
        return answer

    def _methods(self, path: str) -> list[str]:
        if path in {"/books/", "/opening-hours", "/openapi.json"}:
            return ["GET", "HEAD", "OPTIONS"]
        return ["GET", "HEAD", "PUT", "DELETE", "OPTIONS"] if _ISBN.fullmatch(path) else []

    def _answer(self, method: str, target: str, headers: Message, body: bytes, accept: str | None) -> Answer:
        path, _, query = target.partition("?")
        methods = self._methods(path)
        if not methods:
            raise RefusedError(404, f"there is no {path[:100]!r}")
        if method == "OPTIONS":
            return Answer(204, fields={"Allow": ", ".join(methods)})
        if method not in methods:
            raise RefusedError(405, f"there is no {method[:20]} here")
        if path == "/openapi.json":
            return Answer(200, json.dumps(self._description()).encode(), "application/json")
        if path == "/opening-hours":
            return self._shown({"opens": 9, "closes": 18.5, "days": ["Mon", "Thu"]}, "Hours", accept)
        if path == "/books/":
            return self._list(query, accept)
        return self._book(method, path, headers, body, accept)

    def _description(self) -> Any:
        document = yaml.safe_load((CONTRACT / "openapi.yaml").read_text(encoding="utf-8"))
        if self.fault == "undescribed":
            del document["paths"]["/opening-hours"]
        return document

    def _list(self, query: str, accept: str | None) -> Answer:
        given = dict(parse_qsl(query, keep_blank_values=True))
        if "limit" not in given:
            raise RefusedError(422, "limit: missing in the query")
        limit = reading.number(given["limit"], "limit", integer=True)
        if not 1 <= limit <= 100:
            raise RefusedError(422, f"limit: {given['limit']!r} is not 1 to 100")
        shown = [{"isbn": isbn, **book} for isbn, book in sorted(self.books.items())]
        return self._shown(shown[: int(limit)], "Books", accept)

    def _book(self, method: str, path: str, headers: Message, body: bytes, accept: str | None) -> Answer:
        isbn = int(reading.number(path.rpartition("/")[2], "isbn", integer=True))
        if not 1 <= isbn <= 9999999999999:
            raise RefusedError(422, f"isbn: {isbn} is none")
        if method == "PUT":
            self.books[isbn] = self._input(headers, body)
            return Answer(204)
        if isbn not in self.books:
            raise RefusedError(404, f"isbn: there is no book {isbn}")
        if method == "DELETE":
            del self.books[isbn]
            return Answer(204)
        return self._shown({"isbn": isbn, **self.books[isbn]}, "Book", accept)

    def _input(self, headers: Message, body: bytes) -> Any:
        media_type = headers.get_content_type() if "Content-Type" in headers else ""
        if media_type == "application/json":
            value = reading.parse_json(body)
            if self.fault == "takes-unknown-fields" and isinstance(value, dict):
                value = {name: value[name] for name in value if name in _BOOK}
            return reading.fit(_bounded(value), _BOOK)
        if media_type == "application/xml":
            top = parse_xml(body)
            if top.name != "Book":
                raise RefusedError(422, f"{top.name[:50]!r} is no Book")
            return fit_element(top, _BOOK, "Book", ordered=False)
        raise RefusedError(415, f"Content-Type: {headers.get('Content-Type', 'none')!r} is not taken")

    def _shown(self, value: Any, root: str, accept: str | None) -> Answer:
        format_ = choose(accept)
        if format_ is None:
            raise RefusedError(406, f"Accept: {accept!r} has nothing of ours")
        if self.fault == "xml-rounds" and format_ == "application/xml":
            value = json.loads(json.dumps(value), parse_float=lambda text: float(round(float(text))))
        return Answer(200, write(value, root, format_), format_)


def _bounded(value: Any) -> Any:
    """Leave numbers that no int holds as what they are not, so that they are refused as such."""
    if isinstance(value, dict):
        return {name: _bounded(item) for name, item in value.items()}
    return str(value) if isinstance(value, float) and abs(value) == float("inf") else value


class Lending:
    """Answers SOAP requests."""

    def __init__(self) -> None:
        self.base = ""

    def answer(self, method: str, target: str, headers: Message, body: bytes) -> Answer:
        path, _, query = target.partition("?")
        if path != "/lending":
            return Answer(404, b"not here", "text/plain")
        if method in {"GET", "HEAD"}:
            name = "lending.xsd" if "xsd" in query else "lending.wsdl"
            text = (CONTRACT / name).read_text(encoding="utf-8").replace("http://127.0.0.1:8080", self.base)
            text = text.replace('schemaLocation="lending.xsd"', f'schemaLocation="{self.base}/lending?xsd=1"')
            return Answer(200, text.encode(), "text/xml; charset=utf-8")
        if method != "POST" or headers.get_content_type() != "text/xml":
            return Answer(415 if method == "POST" else 405, fields={"Allow": "POST"})
        return self._answered(body)

    def _answered(self, body: bytes) -> Answer:
        try:
            return _enveloped(200, self._lend(body))
        except MalformedError:
            return Answer(400)
        except RefusedError as refused:
            return _fault("Client", str(refused))
        except _FaultError as fault:
            return _fault(fault.args[0], fault.args[1])

    def _lend(self, body: bytes) -> str:
        top = parse_xml(body)
        if top.local == "Envelope" and top.namespace != _SOAP:
            raise _FaultError("VersionMismatch", "SOAP 1.1, please")
        if top.name != f"{_SOAP} Envelope":
            raise _FaultError("Client", "no Envelope")
        parts = list(top.children)
        if parts and parts[0].name == f"{_SOAP} Header":
            for block in parts.pop(0).children:
                ours = block.attributes.get(f"{_SOAP} actor", "") in {"", "http://schemas.xmlsoap.org/soap/actor/next"}
                if ours and block.attributes.get(f"{_SOAP} mustUnderstand") == "1":
                    raise _FaultError("MustUnderstand", f"{block.name!r} is not understood")
        if [part.name for part in parts] != [f"{_SOAP} Body"] or len(parts[0].children) != 1:
            raise _FaultError("Client", "one Body with one child, please")
        request = parts[0].children[0]
        if request.name != f"{_TNS} Lend":
            raise _FaultError("Client", f"there is no operation {request.name!r}")
        fit_element(request, _LEND, "", ordered=True)
        return f'<m:LendResponse xmlns:m="{_TNS}"><days>14</days></m:LendResponse>'


class _FaultError(Exception):
    """A fault's code and text."""


def _enveloped(status: int, content: str) -> Answer:
    text = f'<s:Envelope xmlns:s="{_SOAP}"><s:Body>{content}</s:Body></s:Envelope>'
    return Answer(status, text.encode(), "text/xml; charset=utf-8")


def _fault(code: str, text: str) -> Answer:
    fields = element("faultcode", f"s:{code}") + element("faultstring", text)
    return _enveloped(500, f"<s:Fault>{fields}</s:Fault>")


def open_library(library: Library) -> tuple[str, str, Callable[[], None]]:
    """Serve a library on loopback. Returns its REST base URL, its WSDL's URL and what closes it."""
    lending = Lending()
    rest, stop_rest = start(library, 0)
    lending.base, stop_soap = start(lending, 0)

    def close() -> None:
        stop_rest()
        stop_soap()

    return rest, f"{lending.base}/lending?wsdl", close
