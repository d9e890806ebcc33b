"""Recognise bodies that show a program's internals, such as tracebacks, and malformed JSON or XML."""

import html
import re
from urllib.parse import unquote, unquote_plus

from conformance.documents.json_text import read_json
from conformance.documents.openapi import is_json, is_xml
from conformance.transport.exchange import Exchange, Request

_LOOKED_THROUGH = 200_000  # bytes of a body that are searched for a traceback
_SHOWN = 120  # characters of the traceback that a finding shows
# Differences of a text that a response repeats: JSON escapes, and a full stop after it.
_ESCAPED = re.compile(r"\\([\\\"/])")
_END = " .,;:!"
# Texts of error pages of common languages and frameworks.
_INSIDES = re.compile(
    rb"Traceback \(most recent call last\)"
    rb"|File (?:\"|&quot;|&#34;|\\\")[^\"&]{1,300}\.py(?:\"|&quot;|&#34;|\\\"), line \d+"
    rb"|File \"[^\"\n]+\", line \d+"
    rb"|\bat [\w.$<>/]+\([\w$]+\.(?:java|kt|scala|groovy):\d+\)"
    rb"|\bat [\w.$<> ]+ \(?(?:file://|node:|/)[^\s:)]+:\d+:\d+\)?"
    rb"|\bat [\w$.<>]+\(.*\) in \S+:line \d+"
    rb"|\b(?:java|javax|jakarta|org|com|sun)(?:\.\w+)+(?:Exception|Error)\b"
    rb"|\bSystem\.\w*Exception\b"
    rb"|goroutine \d+ \[\w+"
    rb"|<(?:\w+:)?stackTrace\b"
    rb"|thread '[^']*' panicked at"
    rb"|terminate called after"
    rb"|\bstd::\w+(?:_error|exception)\b|\brclcpp::exceptions"
    rb"|Werkzeug Debugger|DEBUG = True</code>|PHP (?:Fatal error|Warning)|[Ss]tack ?[Tt]race:"
)


def inside_shown(exchange: Exchange) -> str:
    """Return the first part of a traceback or of similar internals in a response, or empty; see _first()."""
    return _first(_INSIDES, exchange)


# Path of a source file: absolute with at least three segments, or with a drive letter.
_PATH = re.compile(
    rb"(?<![\w:/.])/(?:home|root|usr|opt|var|srv|app|code|src|work|tmp|mnt|etc|Users)(?:/[\w.@+-]+){2,}"
    rb"|[A-Z]:\\\\?(?:[\w .-]+\\\\?){2,}"
)


def path_shown(exchange: Exchange) -> str:
    """Return the first path of the server's file system in a response, or empty; see _first()."""
    return _first(_PATH, exchange)


def _first(pattern: re.Pattern[bytes], exchange: Exchange) -> str:
    """Return the first match in a response that does not repeat a part of its request, or empty."""
    sent = None
    for found in pattern.finditer(exchange.response.body[:_LOOKED_THROUGH]):
        sent = sent if sent is not None else _sent_text(exchange.request)
        text = found[0].decode("utf-8", "replace")
        if _plain(text).strip(_END) not in sent:
            return text[:_SHOWN]
    return ""


def _sent_text(request: Request) -> str:
    """Return all texts of a request as a response may repeat them, in lower case."""
    given = [request.url, *(value for _, value in request.headers), request.body.decode("utf-8", "replace")]
    given += [request.raw.decode("utf-8", "replace")] if request.raw else []
    # Decode twice, for devices that decode a query inside a query.
    return "\n".join(_plain(form) for text in given for form in (text, unquote_plus(text), unquote_plus(unquote(text))))


def _plain(text: str) -> str:
    return _ESCAPED.sub(r"\1", html.unescape(unquote(text))).lower()


def unreadable(media_type: str, body: bytes) -> str:
    """Return why a JSON or XML body cannot be parsed; empty if it can, and for other media types."""
    if is_json(media_type):
        return read_json(body).unreadable
    if not is_xml(media_type):
        return ""
    # Imported late: lxml costs a tenth of a second that --help need not pay.
    from conformance.documents.xml import NotXmlError, parse  # noqa: PLC0415

    try:
        parse(body, doctype=True)
    except NotXmlError as error:
        return str(error)
    return ""
