"""The inside of a program, as it shows in an answer by accident."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from conformance.transport.exchange import Exchange, Response
    from conformance.verdict.evidence import Judge

# What error pages of the usual languages and frameworks look like; none of it is in any request of the suite.
_INSIDES = re.compile(
    rb"Traceback \(most recent call last\)"
    rb"|File (?:\"|&quot;|&#34;|\\\")[^\"&]{1,300}\.py(?:\"|&quot;|&#34;|\\\"), line \d+"
    rb"|\bat [\w.$<>/]+\([\w$]+\.(?:java|kt|scala|groovy):\d+\)"
    rb"|\bat [\w.$<> ]+ \(?(?:file://|node:|/)[^\s:)]+:\d+:\d+\)?"
    rb"|\b(?:java|javax|jakarta|org|com|sun)(?:\.\w+)+(?:Exception|Error)\b"
    rb"|\bSystem\.\w*Exception\b"
    rb"|goroutine \d+ \[\w+\]"
    rb"|thread '[^']*' panicked at"
    rb"|terminate called after throwing"
    rb"|\bstd::\w+(?:_error|exception)\b|\brclcpp::exceptions"
    rb"|Werkzeug Debugger|DEBUG = True</code>|PHP (?:Fatal error|Warning)|[Ss]tack ?[Tt]race:"
)


def judge(judge: Judge, exchange: Exchange, answer: Response) -> None:
    """Judge one error answer."""
    found = _INSIDES.search(answer.body[:200_000])
    judge.check(
        "http/no-traceback",
        found is None,
        exchange,
        "an error without the inside of the program",
        found=f"the answer shows {found[0].decode('utf-8', 'replace')[:120]!r}" if found else "",
        cause="traceback",
    )
