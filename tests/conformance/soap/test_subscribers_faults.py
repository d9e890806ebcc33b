"""Faults of the subscribers service are seen."""

from __future__ import annotations

from dataclasses import replace

import pytest
from spoiling import cleaned, instead, renamed, to_response

from conformance.checks.soap_delivery import test_soap_interop as interop
from conformance.checks.soap_subscribers import test_soap_plan as plan
from conformance.checks.soap_subscribers import test_soap_subscribers as subscribers

CASES = [
    (
        "no orientation",
        to_response(renamed(rb"(?s)<orientation>.*?</orientation>", b"")),
        subscribers.test_pose_and_velocity,
        "soap-subscribers/pose",
    ),
    (
        "35 covariances",
        to_response(renamed(rb"<covariance>[^<]*</covariance>(?=</)", b"")),
        subscribers.test_pose_and_velocity,
        "soap-subscribers/pose",
    ),
    (
        "velocity NaN",
        to_response(renamed(rb"(?s)(<linear>.*?<x>)[^<]*", rb"\1NaN")),
        subscribers.test_pose_and_velocity,
        "soap-subscribers/velocity",
    ),
    (
        "quaternion too long",
        to_response(renamed(rb"(<w>)[^<]*", rb"\g<1>3.0")),
        subscribers.test_pose_and_velocity,
        "soap-subscribers/pose",
    ),
    ("short type names", to_response(renamed(rb"/msg/", b"/")), subscribers.test_lists, "soap-subscribers/sensors"),
    (
        "services without types",
        to_response(renamed(rb"<type>[^<]*</type>", b"")),
        subscribers.test_lists,
        "soap-subscribers/services",
    ),
    (
        "response invalid",
        to_response(renamed(rb"(?s)(<x>.*?</x>)(<y>.*?</y>)", rb"\2\1")),
        subscribers.test_pose_and_velocity,
        "soap-subscribers/response-valid",
    ),
    (
        "wrapper in another namespace",
        to_response(renamed(rb"http://soap.turtlebot.mybot.org/", b"urn:other")),
        subscribers.test_pose_and_velocity,
        "soap-subscribers/response-valid",
    ),
    ("plan elsewhere", cleaned(rb"(<x>)[^<]*(</x>)", rb"\g<1>7.5\2"), plan.test_plan, "soap-subscribers/plan"),
    (
        "plan in another frame",
        to_response(renamed(rb"<frame_id>map", b"<frame_id>odom")),
        plan.test_plan,
        "soap-subscribers/plan",
    ),
    (
        "a plan for everything",
        instead(
            lambda a: b"no_such_frame" in a.body,
            lambda a, f: f(replace(a, body=a.body.replace(b"no_such_frame", b"map"))),
        ),
        plan.test_no_plan,
        "soap-subscribers/plan-none",
    ),
    (
        "faults for goals",
        instead(lambda a: b"GetGoal" in a.body, lambda a, f: f(a).having(body=b"")),
        subscribers.test_goal,
        "soap-subscribers/goal",
    ),
    (
        "zeep finds nothing",
        to_response(renamed(rb"(?s)<return>.*</return>", b"")),
        interop.test_subscribers,
        "soap-subscribers/interop",
    ),
]


@pytest.mark.parametrize(("fault", "check", "id_"), [case[1:] for case in CASES], ids=[case[0] for case in CASES])
def test_caught(judged, run, fault, check, id_):
    # Quickly first; what is rare shows at standard effort.
    assert id_ in run(judged(fault), check) or id_ in run(judged(fault, effort="standard"), check)
