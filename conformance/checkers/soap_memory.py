"""Judge what SOAP operations create, read, write and remove as REST's things are judged."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import replace
from typing import Final

from conformance.api.rest.request_context import RequestContext
from conformance.api.soap.resources import BASE, Resources, SoapExchange
from conformance.checkers.occasion import Occasion
from conformance.checkers.rest import Histories
from conformance.documents.openapi import SAFE, matching
from conformance.transport.exchange import Attempt, Exchange, Request
from conformance.verdict.evidence import Case

_FAILED: Final = 500
# Requirements of SOAP by what REST calls them.
_AS_SOAP: Final = {
    "created-is-there": "created-is-there", "deleted-is-gone": "deleted-is-gone", "written-is-read": "written-is-read",
    "refused-keeps": "refused-keeps", "own-identifier": "created-is-there", "states": "states", "list-filter": "lists",
    "list-order": "lists", "list-pages": "lists", "list-limit": "lists", "list-total": "lists",
    "defaults": "written-is-read", "read-only": "written-is-read",
}  # fmt: skip
_STATUS: Final = re.compile(r" status 2\d\d$")
# End of what is expected of a state that no operation has changed.
_BY_ITSELF: Final = "as it was read before"
# End of what is expected of the first read after a write, and what may be special about the message that wrote.
_WROTE: Final = "wrote it"
_CHARSET: Final = re.compile(r"charset=[\"']?([\w-]+)", re.IGNORECASE)


def _form_of(sent: Request) -> str:
    """Return how the texts of a message are written, if not as characters in UTF-8; else an empty text."""
    charset = _CHARSET.search(next((text for name, text in sent.headers if name.lower() == "content-type"), ""))
    if charset is not None and charset[1].lower() != "utf-8":
        return f" in {charset[1]}"
    return " with character references" if b"&#" in sent.body else ""


class SoapThings:
    """Judges SOAP operations as the checkers of REST judge resources.

    Args:
        resources: the operations as resources.
    """

    def __init__(self, resources: Resources) -> None:
        self._resources, self._histories = resources, Histories(resources.contract)
        # Identifiers of the things that it had, by list.
        self._known: dict[str, set[str]] = defaultdict(set)
        self._form = ""  # of the last message that wrote

    def __call__(self, attempt: Attempt) -> Iterator[Case]:
        """Yield the cases of one exchange."""
        seen = self._resources.as_rest(attempt)
        context = RequestContext.of(self._resources.contract, BASE, seen.request) if seen is not None else None
        if seen is None or context is None:
            return
        if not isinstance(seen, Exchange) or seen.response.status >= _FAILED:
            self._histories.forget(deletes=True)
            return
        shown = self._resources.items_in(seen, self._known[context.target]) if isinstance(seen, SoapExchange) else ()
        self._form = self._form if seen.request.method in SAFE else _form_of(attempt.request)
        for one in (seen, *shown):
            yield from self._cases(one)

    def _cases(self, seen: Exchange) -> Iterator[Case]:
        contract = self._resources.contract
        context = RequestContext.of(contract, BASE, seen.request)
        # Except for reads, accepting a message that the XML schema forbids does not count as success here.
        is_allowed = seen.response.ok and seen.request.method not in SAFE
        occasion = Occasion(contract, seen, context, is_allowed) if context is not None else None
        for found in self._histories(occasion) if occasion is not None else ():
            name = _AS_SOAP.get(found.requirement.partition("/")[2], "")
            # A WSDL seldom says whether a message replaces what it leaves out; and SOAP has no status of a creation.
            is_open = (found.requirement.endswith("/defaults") and found.doubt) or _STATUS.search(found.cause)
            if name and not is_open:
                case = self._resources.in_soap(found)
                # An axis, which always exists, may leave any state by itself.
                is_alone = name == "states" and found.expected.endswith(_BY_ITSELF) and not self._is_created(seen)
                doubt = case.doubt or ("it may have left the state by itself" if is_alone else "")
                expected = case.expected + self._form * case.expected.endswith(_WROTE)
                yield replace(case, requirement=f"soap/{name}", doubt=doubt, expected=expected)

    def _is_created(self, seen: Exchange) -> bool:
        """Return whether an operation creates things where one was read."""
        above = seen.request.url.removeprefix(BASE).rpartition("/")[0]
        return matching(self._resources.contract, "POST", above) is not None
