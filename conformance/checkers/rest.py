"""All checkers of REST, over the exchanges of a run one after another."""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import chain
from typing import Final

from conformance.api.rest.request_context import RequestContext
from conformance.api.rest.things import doubt_of_write
from conformance.checkers import declared, fields, problem, texts
from conformance.checkers.answers import Answers
from conformance.checkers.changes import Changes
from conformance.checkers.codings import Codings
from conformance.checkers.commands import Commands
from conformance.checkers.contents import Contents
from conformance.checkers.entity_tags import Conditional, EntityTags
from conformance.checkers.entries import Entries, Listed
from conformance.checkers.identities import Identities, Uniques
from conformance.checkers.lists import Lists
from conformance.checkers.memory import Memory
from conformance.checkers.occasion import Occasion
from conformance.checkers.representations import Representations
from conformance.checkers.resources import Resources
from conformance.checkers.siblings import Siblings
from conformance.checkers.texts import Texts
from conformance.checkers.totals import Sublists
from conformance.checkers.transitions import Transitions
from conformance.checkers.untouched import Elsewhere, Parts, Untouched
from conformance.checkers.writes import Writes
from conformance.contract.pack import Contract
from conformance.documents.openapi import resource_at
from conformance.transport.exchange import Attempt, NoAnswer, Unanswered
from conformance.verdict.evidence import Case

# Checkers of every response.
_ANY: Final = (fields.framing, fields.content_type, fields.once, fields.date, fields.last_modified, fields.formats)
# Checkers that need the description's operation.
_DOCUMENTS: Final = (
    fields.json, fields.charset, problem.inside, problem.same_status, problem.form, fields.allow, fields.challenge,
    fields.promised_fields, declared.crash, declared.server_error, declared.status, declared.body, texts.whole,
)  # fmt: skip

# Requirements whose failures only warn if the description says that a device applies writes later or partly.
_STORED: Final = frozenset(f"description/{name}" for name in ("written-is-read", "patch", "defaults"))


class Histories:
    """Judges exchanges by the earlier ones of a run."""

    def __init__(self, contract: Contract) -> None:
        self._contract = contract
        self._memory = Memory(contract)
        # Checkers that remember values which a request of unknown effect may change.
        self._states = (
            Writes(contract), Changes(contract), Untouched(contract), Answers(contract), Commands(contract),
            Parts(contract), Siblings(contract), Elsewhere(contract), Representations(contract),
        )  # fmt: skip
        self._checkers = (
            Conditional(), Lists(), Resources(), EntityTags(), Texts(), Identities(), self._memory, *self._states,
            Uniques(), declared.WriteOnly(), Contents(), Transitions(contract), Sublists(contract), Entries(contract),
            Listed(contract),
        )  # fmt: skip

    def forget(self, *, deletes: bool) -> None:
        """Forget states that a request of unknown effect may have changed."""
        self._memory.forget(deletes=deletes)
        for checker in self._states:
            checker.forget()

    def __call__(self, occasion: Occasion) -> Iterator[Case]:
        """Yield the cases of one exchange."""
        for case in chain.from_iterable(checker(occasion) for checker in self._checkers):
            is_stored = not case.holds and case.requirement in _STORED
            path = occasion.context.target.partition("?")[0]
            resource = resource_at(self._contract, path) if is_stored else None
            late = doubt_of_write(*resource.operations.values()) if resource is not None else ""
            # All differences of such a resource are one finding, not one for each member.
            yield replace(case, doubt=late, cause=late) if late and not case.doubt else case


class RestCheckers:
    """Judges every exchange with a REST interface, whichever check sent it.

    Args:
        contract: by which it is judged.
        base_url: the base URL of the interface.
        elsewhere: URLs below it that belong to other interfaces.
    """

    def __init__(self, contract: Contract, base_url: str, elsewhere: Iterable[str] = ()) -> None:
        self._contract, self._base_url = contract, base_url
        self._elsewhere = frozenset(url.split("?", 1)[0] for url in elsewhere)
        self._histories, self._codings = Histories(contract), Codings()
        self._documents = (*_DOCUMENTS, declared.Negotiation())
        self.forget = self._histories.forget

    def __call__(self, attempt: Attempt) -> Iterator[Case]:
        """Yield the cases of one exchange; none if it went to another interface."""
        if attempt.request.url.split("?", 1)[0] in self._elsewhere:
            return
        context = RequestContext.of(self._contract, self._base_url, attempt.request)
        if context is None:
            return
        if isinstance(attempt, Unanswered):
            self.forget(deletes=attempt.request.method == "DELETE")
            # A malformed request may be answered in any way.
            if context.usual and attempt.kind is NoAnswer.MALFORMED:
                yield Case(False, attempt, fields.WELL_FRAMED, attempt.problem, requirement="http/framing")  # noqa: FBT003
            return
        occasion = Occasion(self._contract, attempt, context)
        for check in _ANY:
            yield from check(occasion)
        yield from self._codings(occasion)
        if not attempt.response.content.is_plain:
            return  # the remaining checkers read the content
        yield from self._histories(occasion)
        for check in () if context.is_own_of(attempt.response) else self._documents:
            yield from check(occasion)
