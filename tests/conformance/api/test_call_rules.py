"""What may be called: safe methods, what patterns allow, and nothing that is excluded, harmful or moves the device."""

import pytest

from conformance.api.call_rules import CallRules, Reason, plan_lines
from conformance.documents.openapi import Body, Operation, read_operations
from conformance.documents.parameters import Parameter

_GOTO = Operation("goTo", "POST", "/move/goto", tags=("move",))
_READ = Operation("", "GET", "/state/{id}")


_COMMAND = {"enum": ["beep", "Shut-Down"]}
_ADMIN = Operation("", "POST", "/admin/{command}", parameters=(Parameter("command", "path", True, _COMMAND),))
_POWER = Operation("", "POST", "/power", bodies={"application/json": Body("", {"properties": {"do": _COMMAND}})})


@pytest.mark.parametrize(
    ("operation", "rules", "reason"),
    [
        (_READ, CallRules(), Reason.SAFE),
        (Operation("", "HEAD", "/a"), CallRules(), Reason.SAFE),
        (_GOTO, CallRules(), Reason.CHANGES),
        (_GOTO, CallRules(("POST /move/*",)), Reason.ALLOWED),
        (_GOTO, CallRules(("post /move/goto",)), Reason.ALLOWED),
        (_GOTO, CallRules(("/move/*",)), Reason.ALLOWED),
        (_GOTO, CallRules(("* /move/goto",)), Reason.ALLOWED),
        (_GOTO, CallRules(("goTo",)), Reason.ALLOWED),
        (_GOTO, CallRules(("move",)), Reason.ALLOWED),
        (_GOTO, CallRules(("PUT /move/*", "/state/*")), Reason.CHANGES),
        (_GOTO, CallRules(("move",), ("goTo",)), Reason.NEVER),
        (_READ, CallRules(never=("GET /state/*",)), Reason.NEVER),
        (Operation("", "POST", "/system/shutdown"), CallRules(("/system/*",)), Reason.HARMFUL),
        (Operation("", "POST", "/system/shutdown"), CallRules(("POST /system/shutdown",)), Reason.ALLOWED),
        (Operation("factoryReset", "POST", "/a"), CallRules(("*",)), Reason.HARMFUL),
        (Operation("factoryReset", "POST", "/a"), CallRules(("factoryReset",)), Reason.ALLOWED),
        (Operation("", "GET", "/hf-auth/start"), CallRules(), Reason.HARMFUL),
        (Operation("", "GET", "/hf-auth/start"), CallRules(("GET /hf-auth/start",)), Reason.SAFE),
        (Operation("", "GET", "/tokenize/{token}"), CallRules(), Reason.SAFE),
        (Operation("", "GET", "/lua/firmware"), CallRules(("*",)), Reason.HARMFUL),
        (Operation("", "GET", "/lua/firmware"), CallRules(("GET /lua/firmware",)), Reason.SAFE),
        (Operation("", "GET", "/formats"), CallRules(), Reason.SAFE),
        (Operation("runShellCommand", "POST", "/a"), CallRules(("*",)), Reason.HARMFUL),
        (Operation("", "POST", "/scripts/{name}/run"), CallRules(("*",)), Reason.HARMFUL),
        (Operation("", "POST", "/kill_all"), CallRules(("POST /*",)), Reason.HARMFUL),
        (Operation("", "POST", "/start", tags=("Network Hotspot",)), CallRules(("*",)), Reason.HARMFUL),
        (Operation("", "GET", "/address", tags=("network",)), CallRules(), Reason.SAFE),
        (Operation("updatePose", "PUT", "/pose"), CallRules(("*",)), Reason.ALLOWED),
        (Operation("", "POST", "/update"), CallRules(("*",)), Reason.HARMFUL),
        (Operation("a_delete", "DELETE", "/a"), CallRules(("/a",)), Reason.ALLOWED),
        (Operation("lamps_destroy", "DELETE", "/lamps/{id}"), CallRules(("*",)), Reason.ALLOWED),
        (Operation("lamps_destroy", "POST", "/lamps/{id}"), CallRules(("*",)), Reason.HARMFUL),
        (Operation("", "POST", "/delete/{id}"), CallRules(("*",)), Reason.HARMFUL),
        (Operation("UpdateJob", "POST", "/a/UpdateJob", created=True), CallRules(("*",)), Reason.ALLOWED),
        (Operation("UpdateFirmware", "POST", "/a/UpdateFirmware", created=True), CallRules(("*",)), Reason.HARMFUL),
        (Operation("", "POST", "/a", motion=True), CallRules(("/a",)), Reason.MOVES),
        (Operation("", "POST", "/a", motion=True), CallRules(("/a",), motion=True), Reason.ALLOWED),
        (Operation("", "GET", "/a", motion=True), CallRules(), Reason.MOVES),
        (Operation("", "GET", "/a", motion=True), CallRules(motion=True), Reason.ALLOWED),
        (Operation("", "GET", "/a", never=True), CallRules(("GET /a",)), Reason.EXCLUDED),
        (_ADMIN, CallRules(("*",)), Reason.HARMFUL),
        (_ADMIN, CallRules(("POST /admin/{command}",)), Reason.ALLOWED),
        (_POWER, CallRules(("*",)), Reason.HARMFUL),
        # The author of a contract has decided.
        (Operation("", "POST", "/system/shutdown"), CallRules(by_author=True), Reason.ALLOWED),
        (Operation("", "GET", "/a", motion=True), CallRules(by_author=True), Reason.MOVES),
        (Operation("", "PUT", "/a", motion=True), CallRules(motion=True, by_author=True), Reason.ALLOWED),
    ],
)
def test_decisions(operation, rules, reason):
    assert rules.decide(operation) is reason


def test_a_run_says_what_it_calls_and_why():
    lines = plan_lines(CallRules(("/move/*", "/gone"), ("/state/*",)), [_GOTO, _READ, Operation("", "PUT", "/a")])
    assert lines[0] == "Calls 1 of 3 operations; state is changed by 1; not called: 2."
    assert [line.split(":")[-1].strip() for line in lines[1:]] == ["POST /move/goto", "PUT /a", "GET /state/{id}"]
    assert CallRules(("/move/*", "/gone")).unused_patterns([_GOTO]) == ["/gone"]


def test_what_the_motion_map_sends_is_called():
    moves = Operation("", "PUT", "/goal/{east}")
    lines = plan_lines(
        CallRules((), ("/never",)), [moves, Operation("", "PUT", "/never")], ["PUT /goal/{x}", "PUT /never"]
    )
    assert lines[0] == "Calls 1 of 2 operations; state is changed by 1; not called: 1."
    assert lines[1] == "  Calls 1, because the map in the statement names it: PUT /goal/{east}"


def test_what_is_held_back_for_its_name_is_told_with_the_option_that_names_it():
    (line,) = plan_lines(CallRules(("*",)), [Operation("", "GET", "/lua/firmware")])[1:]
    assert line.endswith("allows it, as in --call 'GET /lua/firmware': GET /lua/firmware")


def test_what_the_description_says_of_motion_and_of_tests():
    said = {"responses": {}, "x-roaas-motion": True}
    paths = {
        "/a": {"get": said},
        "/b": {"post": {"responses": {}, "x-roaas-never": True}},
        "/c": {"put": {"responses": {}}},
    }
    found = read_operations({"paths": paths}, closed=True)
    assert [(one.motion, one.never) for one in found] == [(True, False), (False, True), (False, False)]
