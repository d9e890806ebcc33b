"""Nothing is held against robots that conform, whichever freedoms they take."""

from __future__ import annotations

from importlib import import_module

import pytest

from conformance.checks.describe import test_wsdl as wsdl
from conformance.checks.soap_basic_profile import test_soap_observed as observed
from conformance.checks.soap_basic_profile import test_soap_profile_headers as headers
from conformance.checks.soap_basic_profile import test_soap_profile_http as over_http
from conformance.checks.soap_basic_profile import test_soap_profile_messages as messages
from conformance.checks.soap_delivery import test_soap_delivery as delivery
from conformance.checks.soap_delivery import test_soap_interop as interop
from conformance.checks.soap_subscribers import test_soap_plan as plan
from conformance.checks.soap_subscribers import test_soap_subscribers as subscribers
from conformance.checks.strict_input import test_soap_strict as strict
from conformance.checks.xml_security import test_xml_security_rest as security_rest
from conformance.checks.xml_security import test_xml_security_soap as security

PUBLISHERS = (
    delivery.test_operations,
    delivery.test_range,
    delivery.test_syntax,
    delivery.test_addressing,
    delivery.test_codes,
    interop.test_publishers,
)
REST_OF_THEM = (
    observed.test_every_answer_is_watched,
    subscribers.test_pose_and_velocity,
    subscribers.test_lists,
    subscribers.test_goal,
    plan.test_no_plan,
    interop.test_subscribers,
    headers.test_other_versions,
    headers.test_must_understand,
    headers.test_other_headers,
    headers.test_order_of_faults,
    messages.test_answers,
    messages.test_dispatch,
    messages.test_unknown_operation,
    messages.test_encodings,
    messages.test_invalid_messages,
    over_http.test_soap_action,
    over_http.test_malformed,
    over_http.test_methods,
    over_http.test_media_types,
    strict.test_single_mutations,
    strict.test_mutations_of_any_message,
    wsdl.test_served,
    wsdl.test_same_as_contract,
    wsdl.test_address,
    wsdl.test_profile,
    security.test_attacks,
    security.test_addressing,
    security_rest.test_attacks,
)


@pytest.mark.parametrize(("name", "seed"), [("plain", 1), ("baroque", 2)])
def test_conforming_independent_robots(connected, run, name, seed):
    rest, wsdl_url, stop = import_module(f"conformance.selftest.independent_robots.{name}").serve(0, 0)
    try:
        session = connected(rest, wsdl_url.rsplit("/", 1)[0], effort="quick")
        session.seed = seed
        failed = run(session, *PUBLISHERS, *REST_OF_THEM)
    finally:
        stop()
    levels = {id_: session.contract.ledger[id_].level for id_ in failed}
    assert {id_: text for id_, text in failed.items() if levels[id_] == "MUST"} == {}
    unjudged = [id_ for id_ in session.contract.ledger if "/soap-" in id_ and not session.judge.evidence[id_].cases]
    assert unjudged == []


def test_a_legacy_robot_may_be_lax(connected, run):
    rest, wsdl_url, stop = import_module("conformance.selftest.independent_robots.legacy").serve(0, 0)
    try:
        session = connected(rest, wsdl_url.rsplit("/", 1)[0], effort="quick")
        session.subscribers = None
        failed = run(session, *PUBLISHERS)
    finally:
        stop()
    assert set(failed) <= {"soap-delivery/refuses-code", "strict-input/soap-code"}


def test_the_robot_without_a_fault(judged, run):
    assert run(judged(effort="standard"), *PUBLISHERS) == {}


def test_nothing_reaches_the_publishers_without_permission(judged, run):
    asked = []

    def recording(ask, forward):
        asked.append((ask.method, ask.target))
        return forward(ask)

    session = judged(recording, motion=False)
    run(session, *REST_OF_THEM[:-1])
    posted = [target for method, target in asked if method not in {"GET", "OPTIONS"} and "publisher" in target]
    assert posted == []
    assert session.judge.evidence["soap-basic-profile/R2724"].skips
    assert not session.judge.evidence["soap-basic-profile/R1125"].skips
