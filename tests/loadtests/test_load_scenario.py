"""`roaas load --scenario`: users of a Locust file, measured as any others."""

import json
import sys
import urllib.request
from collections import Counter
from pathlib import Path

import pytest
from processes import ended

from reports.latency.page import latency_html

EXAMPLE = Path(__file__).parents[2] / "examples" / "scenario" / "operators.py"
USER = """
from locust import between, task
from loadtests.scenario import RobotUser

class One(RobotUser):
    wait_time = between(0.01, 0.02)

    @task
    def work(self):
"""


@pytest.fixture
def device(started):
    """Start a toy device; returns its URL."""

    def start(*options):
        return f"http://127.0.0.1:{started('toy_api.py', *options)[1]}"

    return start


@pytest.fixture
def scenario(tmp_path):
    """Write a scenario with one task; returns its file."""

    def write(*lines, text=USER):
        file = tmp_path / "scenario.py"
        file.write_text(text + "".join(f"        {line}\n" for line in lines))
        return file

    return write


def calls(url):
    with urllib.request.urlopen(f"{url}/calls", timeout=60) as answer:  # noqa: S310 -- http
        return json.load(answer)


def sent(result):
    """Return how many requests of each operation the blocks of a run have."""
    found = Counter()
    for series in result["time_series"]["series"]:
        found[series["operation"]] += sum(point["count"] + point["errors"] for point in series["points"])
    return found


def test_the_example_runs_and_each_request_is_in_its_result(device, load, tmp_path):
    url, statement = device(), tmp_path / "robot.toml"
    statement.write_text(
        f'[robot]\nname = "toy"\n[api]\nopenapi = "{url}/openapi.json"\n'
        '[slo]\n"GET /state" = { p50_ms = 9000 }\n"GET /text" = { p50_ms = 1 }\n"POST /drive" = { p50_ms = 1 }\n'
    )
    run = load(statement, f"--scenario {EXAMPLE} --users 8 --duration 4 --warmup 0")
    result = run.result
    assert result["plan"]["model"] == "closed"
    assert result["plan"]["scenario"]["file"] == "operators.py"
    assert (result["plan"]["gap_s"], result["plan"]["users"]) == (0.0, 8)
    assert set(result["plan"]["operations"]) == {"GET /state", "GET /items", "GET /items/{item_id}"}
    assert result["counts"]["failed"] == {}
    done, measured = calls(url), sent(result)
    for name, number in measured.items():
        reached = sum(count for call, count in done.items() if call.startswith(name.partition("{")[0]))
        reached -= sum(count for call, count in done.items() if name == "GET /items" and call.startswith("GET /items/"))
        assert 0 < number <= reached <= number + 8, "those after the plan's end alone are not recorded"
    assert 24 <= measured["GET /state"] <= 54, "six of eight users, twice a second each"
    assert {"GET /state"} == {entry["operation"] for entry in result["slo"]}
    assert "not called, so not judged: [slo] GET /text" in result["notes"]
    assert "not measured, so not judged: [slo] POST /drive" in result["notes"]
    assert result["noise_floor"], "blocks of the same users are compared with one another"
    assert run.code == (0 if result["valid"] else 4), run.out + run.err
    page = latency_html(result)
    assert "closed model, 8 users of operators.py" in page
    assert not result["valid"] or "a slow robot gets fewer requests" in page


def test_failures_count_in_the_percentiles_by_the_description_or_by_the_scenario(device, load, scenario):
    file = scenario(
        'self.client.get("/state")',
        'with self.client.get("/text", catch_response=True) as text:',
        "    text.success() if text.status_code == 200 else text.failure(text.text)",
        'with self.client.get("/items", catch_response=True) as items:',
        '    items.failure("too few things")',
        'assert self.client.get("/items/nothing").status_code == 404',
    )
    run = load(f"{device('--fail-every', '10')}/openapi.json --scenario {file} --users 2 --duration 2 --warmup 0.2")
    result = run.result
    series = {entry["operation"]: entry for entry in result["series"]}
    assert series["GET /text"]["errors"] == 0, "the scenario has said that it is good"
    assert series["GET /items"]["count"] == series["GET /items/{item_id}"]["count"] == 0
    state = series["GET /state"]
    assert state["errors"] / (state["errors"] + state["count"]) == pytest.approx(0.1, abs=0.05)
    kinds = {(entry["operation"], entry["kind"]): entry["message"] for entry in result["errors"]}
    assert kinds["GET /items", "scenario"] == "too few things"
    assert ("GET /items/{item_id}", "status") in kinds
    assert "p99" in state["at_least"] or state["service_ms"]["p99"] is None
    assert run.code == 4
    assert any("requests failed" in reason for reason in result["invalid_because"])


def test_workers_share_the_users_and_what_may_change_something_is_stopped_at_the_end(device, load, scenario, tmp_path):
    key = tmp_path / "key"
    key.write_text("t0ken-of-robot")
    url = device("--auth", "header")
    file = scenario('self.client.post("/drive", json={"speed": 0.5})', 'self.client.get("/items")')
    run = load(
        f"{url}/openapi.json --scenario {file} --call 'POST /drive' --processes 2",
        "--users 3 --duration 2 --warmup 0.2 --api-key 'header X-Robot-Key' --api-key-file",
        key,
    )
    result = run.result
    assert [worker["state"] for worker in result["workers"]] == ["finished"] * 2
    counts = sorted(worker["requests"] for worker in result["workers"])
    assert counts[0] * 2 == pytest.approx(counts[1], rel=0.3), "one user, and two"
    assert result["counts"]["failed"] == {}
    done = calls(url)
    assert done["POST /halt"] == 1
    assert done["POST /drive"] > 20
    assert result["plan"]["limits"]["max_rate"] == 500
    assert "t0ken" not in run.out + run.err + json.dumps(result)


def test_each_request_answers_the_devices_challenge(device, load, scenario, tmp_path):
    user, url = tmp_path / "user", device("--auth", "digest")
    user.write_text("robot:s3same-robot")
    run = load(
        f"{url}/openapi.json --scenario",
        scenario('self.client.get("/state")'),
        "--digest-file",
        user,
        "--users 2 --duration 2",
    )
    assert run.result["counts"]["answered"] > 20
    assert run.result["counts"]["failed"] == {}
    assert "s3same" not in run.out + run.err + json.dumps(run.result)


def test_a_limit_on_the_rate_holds_for_all_users_together(device, load, scenario, tmp_path):
    url, statement = device(), tmp_path / "robot.toml"
    statement.write_text(f'[robot]\nname = "toy"\n[api]\nopenapi = "{url}/openapi.json"\n[load]\nmax_rate = 20\n')
    file = scenario('self.client.get("/state")')
    run = load(statement, f"--scenario {file} --users 4 --duration 3 --warmup 0.2")
    assert 0.5 < run.result["counts"]["achieved_rate"] / 20 < 1.1
    assert "4 users of a scenario in the closed model under a cap of 20 requests/s" in run.out
    assert run.code == 0 or not run.result["trustworthy"], run.out + run.err


_REFUSED = {
    'get("/nowhere")': "GET /nowhere is not in the description: no path of it matches",
    'put("/state")': "PUT /state is not in the description: the path has GET",
    'post("/drive")': "POST /drive is not called: ",
    'call("GET /things")': "the description has no operation 'GET /things'",
    'call("GET /items/{item_id}")': "the path needs a value for item_id",
    'get("/state", headers={"A": "b\\r\\nC: d"})': "contains a line break",
}


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ('self.client.put("/state")', "PUT /state is not in the description: the path has GET"),
        ('{}["left"]', "KeyError: 'left' (scenario.py, line "),
    ],
)
def test_a_scenario_that_fails_ends_the_run(device, load, scenario, line, told, tmp_path):
    tried = (f"lambda: self.client.{call}" for call in _REFUSED)
    file = scenario(
        "from loadtests.clients.scenario import ScenarioError",
        f"for call in ({', '.join(tried)}):",
        "    try:",
        "        call()",
        "    except ScenarioError as error:",
        f"        open({str(tmp_path / 'told')!r}, 'a').write(f'{{error}}\\n')",
        line,
    )
    run = load(f"{device()}/openapi.json --scenario {file} --users 1 --duration 60")
    assert run.code == 4
    reason = next(reason for reason in run.result["invalid_because"] if reason.startswith("the scenario failed: "))
    assert told in reason
    found = (tmp_path / "told").read_text().splitlines()
    assert all(part in line for part, line in zip(_REFUSED.values(), found, strict=True)), found


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ("--operation 'GET /state'", "--operation does not go with --scenario"),
        ("--rate 5", "--rate does not go with --scenario"),
        ("--knee", "--knee does not go with --scenario"),
        ("--against http://127.0.0.1:1", "--against does not go with --scenario"),
    ],
)
def test_what_the_users_decide_is_no_option(device, usage_error, scenario, options, told):
    assert told in usage_error(f"{device()}/openapi.json --scenario {scenario('pass')} {options}")


_NO_SCENARIOS = {
    "1 / 0": "cannot be used: ZeroDivisionError: division by zero (scenario.py, line 1)",
    "def": "cannot be used: SyntaxError",
    "import locust": "has no class of users",
    "import locust\nclass A(locust.HttpUser):\n    pass": "A is not measured: derive it from",
    "from loadtests.scenario import RobotUser\nclass A(RobotUser):\n    pass": "A has no task",
}
# Locust changes the process that imports it.
_READ = """
import hashlib, sys
from loadtests.measuring.scenario import read
from loadtests.measuring.errors import GeneratorError
from loadtests.settings.settings import Scenario
for text in sys.argv[2:]:
    open(sys.argv[1], "w").write(text)
    try:
        read(Scenario(sys.argv[1], hashlib.sha256(text.encode()).hexdigest()))
    except GeneratorError as error:
        print(error)
"""


def test_a_file_that_is_no_scenario_is_refused(device, load, scenario, tmp_path):
    run = load(f"{device()}/openapi.json --scenario {scenario(text='1 / 0')}")
    assert (run.code, _NO_SCENARIOS["1 / 0"] in run.err) == (2, True), run.err
    done = ended(sys.executable, "-c", _READ, tmp_path / "scenario.py", *_NO_SCENARIOS)
    assert len(done.stdout.splitlines()) == len(_NO_SCENARIOS), done.stderr
    for line, told in zip(done.stdout.splitlines(), _NO_SCENARIOS.values(), strict=True):
        assert told in line


def test_a_robot_that_is_not_there_is_not_measured(device, load, scenario, free_port):
    file = scenario('self.client.get("/state")')
    run = load(f"{device()}/openapi.json --scenario {file} --base-url http://127.0.0.1:{free_port}")
    assert (run.code, "the robot cannot be reached" in run.err) == (3, True), run.err
