"""Recognise tracebacks and other internals of a program in response bodies."""

import re

from conformance.transport.exchange import Request

# As much of a body is looked through, octets.
_LOOKED_THROUGH = 200_000
_SHOWN = 120
# What error pages of the usual languages and frameworks look like; none of it is in any request of the suite.
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


def inside_shown(body: bytes) -> str:
    """Return the first part of a traceback or of similar internals in a body, or empty."""
    found = _INSIDES.search(body[:_LOOKED_THROUGH])
    return found[0].decode("utf-8", "replace")[:_SHOWN] if found else ""


# A file of a program: an absolute path with at least three segments, or with a drive letter.
_PATH = re.compile(
    rb"(?<![\w:/.])/(?:home|root|usr|opt|var|srv|app|code|src|work|tmp|mnt|etc|Users)(?:/[\w.@+-]+){2,}"
    rb"|[A-Z]:\\\\?(?:[\w .-]+\\\\?){2,}"
)


def path_shown(body: bytes, request: Request) -> str:
    """Return the first path of the server's file system in a body that was not in the request, or empty."""
    for found in _PATH.finditer(body[:_LOOKED_THROUGH]):
        if found[0] not in request.url.encode() and found[0] not in request.body:
            return found[0].decode("utf-8", "replace")[:_SHOWN]
    return ""
