"""Methods, entity tags and conditions of one resource; checkers judge what these scenarios send (RFC 9110 9, 13)."""

from conformance.scenarios.neighbours import neighbours
from conformance.scenarios.own_things import own_things
from conformance.scenarios.rule import Outcome, rule
from conformance.scenarios.survey import Survey


@rule("description/head", on=(neighbours,))
def head(_trace: Survey) -> tuple[Outcome, ...]:
    """Play the reads by HEAD; `checkers.resources` judges them."""
    return ()


@rule("description/method-refused", on=(own_things,))
def method_refused(_trace: Survey) -> tuple[Outcome, ...]:
    """Play the requests by undeclared methods; `checkers.resources` judges them."""
    return ()


@rule("description/entity-tag", on=(own_things,))
def entity_tag(_trace: Survey) -> tuple[Outcome, ...]:
    """Play the writes of single members; `checkers.entity_tags` judges the tags."""
    return ()


@rule("description/if-match", on=(own_things,))
def if_match(_trace: Survey) -> tuple[Outcome, ...]:
    """Play the writes by conditions; `checkers.entity_tags` judges them."""
    return ()
