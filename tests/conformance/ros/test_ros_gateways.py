"""Services, actions and what comes and goes: a right gateway is not blamed, and one with a fault is."""

import json
import sys

import pytest
from gateway_processes import gateway
from gateways.gateway_mutants import rows
from processes import ended

#: The requirement that each of these faults breaks, and the style of the gateway that has it.
KILLED = {
    "call doubled": ("service-once", "fastapi"),
    "absent service as success": ("service-failure", "flask"),
    "last response": ("service-response", "aiohttp"),
    "goal doubled": ("goal-once", "aiohttp"),
    "aborted as succeeded": ("goal-outcome", "fastapi"),
    "cancel lost": ("goal-cancel", "flask"),
    "list keeps what is gone": ("lists", "fastapi"),
    "reliable only": ("qualities", "flask"),
    "messages mixed": ("own-topic", "aiohttp"),
    "last response in a crowd": ("service-response", "flask"),
    "reordered in a crowd": ("order", "aiohttp"),
    "stream drops": ("stream-once", "aiohttp"),
    "stream reorders": ("stream-order", "fastapi"),
    "stream throttle ignored": ("stream-throttle", "rosbridge"),
    "unsubscribe ignored": ("stream-once", "rosbridge"),
    "service error as success": ("service-failure", "rosbridge"),
}


def _judged(style, domain_id, folder, *options, fault=""):
    """Return what a run says of a gateway, and the verdict of each requirement."""
    with gateway(style, domain_id, folder, fault) as statement:
        effort = "standard" if "crowd" in fault else "quick"
        more = ["--ros-play", "--ros-domain-id", domain_id, "--effort", effort, "--out", folder / "out", *options]
        done = ended(sys.executable, "-m", "roaas", "certify", statement, *more)
    assert "Traceback" not in done.stdout + done.stderr, done.stderr
    result = json.loads((folder / "out" / "result.json").read_text(encoding="utf-8"))
    return done, {one["id"].removeprefix("ros-gateway/"): one["verdict"] for one in result["requirements"]}


def test_a_right_gateway_is_not_blamed(tmp_path, domain_id):
    selected = sorted({id_ for id_, _ in KILLED.values()})
    options = [word for id_ in selected for word in ("--select", f"ros-gateway/{id_}")]
    done, judged = _judged("aiohttp", domain_id, tmp_path, *options)
    assert {id_: judged[id_] for id_ in selected} == dict.fromkeys(selected, "pass"), done.stdout


def test_a_right_rosbridge_is_not_blamed(tmp_path, domain_id):
    done, judged = _judged("rosbridge", domain_id, tmp_path)
    assert {id_: word for id_, word in judged.items() if word not in {"pass", "not-claimed"}} == {}, done.stdout
    assert done.returncode == 0


@pytest.mark.parametrize("fault", KILLED)
def test_a_fault_breaks_its_requirement(tmp_path, domain_id, fault):
    requirement, style = KILLED[fault]
    assert fault in {row.fault for row in rows()}
    done, judged = _judged(style, domain_id, tmp_path, "--select", f"ros-gateway/{requirement}", fault=fault)
    assert judged[requirement] == ("warn" if requirement == "qualities" else "fail"), done.stdout
