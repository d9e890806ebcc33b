"""The robot must reject invalid SOAP messages: valid ones broken in one way, confirmed by lxml and xmlschema."""

import random
from itertools import islice

import pytest
from hypothesis import strategies as st

from conformance.api.mutations import Mutation
from conformance.api.soap.callable_services import SoapServices, accepted_messages, callable_services
from conformance.api.soap.calls import SoapResponse, call, expect_answer
from conformance.api.soap.messages import ordinary, variants
from conformance.api.soap.mutations import Payload, invalid_ones, mutations
from conformance.api.soap.service import SoapService
from conformance.documents.xml import Node
from conformance.documents.xsd_shapes import Element
from conformance.verdict.effort import Effort
from conformance.verdict.evidence import Judge, RefutedError
from conformance.verdict.explorer import Explorer

pytestmark = pytest.mark.phase("acting")
_KINDS = ("missing", "unknown", "duplicate", "order", "namespace", "lexical", "range", "non-finite", "nil", "body")
_FAULT, _CLIENT = "strict-input/soap-fault", "soap-basic-profile/R2724"
_IDS = (*(f"strict-input/soap-{kind}" for kind in _KINDS), _FAULT, _CLIENT)


def _targets(soap: SoapServices, service: SoapService) -> list[tuple[Element, Node]]:
    """Return the declaration of each message that the robot accepts, with the message."""
    accepted = accepted_messages(soap, service, *_IDS)
    found = [(service.contract.shape(operation.request or ""), message) for operation, message in accepted]
    return [(declared, message) for declared, message in found if declared is not None]


def _judge_refusal(judge: Judge, mutant: Mutation[Payload], answer: SoapResponse) -> bool:
    """Judge whether the robot rejected an invalid message, and with which fault; return whether that was right."""
    why = f" ({mutant.reason})" if mutant.reason else ""
    if mutant.reason:
        cause = f"{mutant.kind} {answer.status} {answer.code}"
        expect_answer(judge, _CLIENT, answer).fault("Client", f"there is {mutant.what}", cause=cause)
    refused = expect_answer(judge, f"strict-input/soap-{mutant.kind}", answer).that(
        answer.is_refused,
        f"a fault or status 4xx for {mutant.what}{why}",
        cause=f"{mutant.kind} {answer.status} {answer.is_taken}",
    )
    if answer.is_taken:
        return refused
    return expect_answer(judge, _FAULT, answer).that(
        answer.fault is not None and answer.status == 500,
        f"a fault with status 500 for {mutant.what}",
        cause=f"{answer.status} {answer.fault is None}",
    )


@pytest.mark.requirement(*_IDS)
def test_single_mutations(soap: SoapServices, judge: Judge, effort: Effort) -> None:
    """Send every single mutation of a message that the robot accepts."""
    chance = random.Random(soap.run.seed)  # noqa: S311 - choice of cases, not of secrets
    sent: dict[str, int] = dict.fromkeys(_KINDS, 0)
    services = callable_services(soap, *_IDS)
    for service in services:
        found = [mutant for declared, message in _targets(soap, service) for mutant in mutations(declared, message)]
        chance.shuffle(found)
        # Equally many of each kind: otherwise most cases would be wrong forms of numbers.
        for kind in _KINDS:
            ours = [mutant for mutant in found if mutant.kind == kind]
            for mutant in invalid_ones(ours[: effort.cases(60)], service.contract.types):
                sent[kind] += 1
                _judge_refusal(judge, mutant, call(service, *mutant.made))
    for kind, count in sent.items():
        if not count:
            judge.skip(f"strict-input/soap-{kind}", _nothing(services, kind))


def _nothing(services: list[SoapService], kind: str) -> str:
    names = " and ".join(service.name for service in services)
    return f"no operation of the {names} service that took a message has anything to break by {kind!r}"


@pytest.mark.requirement(*_IDS)
def test_mutations_of_any_message(soap: SoapServices, judge: Judge, explore: Explorer) -> None:
    """Send mutations of messages with any other values."""
    for service in callable_services(soap, *_IDS):
        targets = [
            (declared, _fullest(declared, message)) for declared, message in _targets(soap, service) if message.children
        ]
        if not targets:
            continue

        def refute_accepted(case: tuple[Element, Mutation[Payload]], service: SoapService = service) -> None:
            for invalid in invalid_ones([case[1]], service.contract.types):
                if not _judge_refusal(judge, invalid, call(service, *invalid.made)):
                    raise RefutedError(invalid.what)

        explore(st.one_of([_any_mutation(*target) for target in targets]), refute_accepted, cases=80)


def _any_mutation(declared: Element, base: Node) -> st.SearchStrategy[tuple[Element, Mutation[Payload]]]:
    """Return a strategy for any single mutation of any valid message of an operation."""
    # Values change nothing in what there is to mutate, so that only the mutation that was chosen has to be made.
    count = sum(1 for _ in mutations(declared, base))

    def mutation(drawn: Node, chosen: int) -> tuple[Element, Mutation[Payload]]:
        return declared, next(islice(mutations(declared, drawn), chosen, None))

    return st.builds(mutation, variants(declared, base), st.integers(0, count - 1))


def _fullest(declared: Element, message: Node) -> Node:
    """Return a message with all optional elements, so that those are broken as well."""
    full = ordinary(declared, optional=True)
    return full if len(full.paths()) > len(message.paths()) else message
