"""The class states: a right cell is led through all states, and each fault of its state machine is named."""

import random
import time
import tomllib
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import msgspec
import pytest
from aiohttp import web
from cell import FAULTS, MAP, Cell
from driven_device import driven
from small_device import certified, reading, small_device

from conformance.contract.pack import Contract
from conformance.rules.states import test_state_machine
from conformance.scenarios.rule import Rule
from conformance.scenarios.states import Step, Walk, walked
from conformance.statement.state_map import StateMap
from conformance.statement.statement import StatementError, load_statement, motion_map_of
from conformance.transport.exchange import Exchange, Request, Response
from conformance.verdict.evidence import Case
from reports.certificate.moves_drawn import grid

EXAMPLES = Path(__file__).parents[3] / "examples"
_RULES = [one for one in vars(test_state_machine).values() if isinstance(one, Rule)]


@pytest.fixture
def judged(tmp_path):
    """Return the outcome of one run over the class, by a device and more of its map."""

    def run(cell, more="", *options):
        statement = tmp_path / "cell.toml"
        with small_device(cell.description, cell.routes) as url:
            statement.write_text(f'[api]\nopenapi = "{url}/openapi.json"\n{MAP}{more}', encoding="utf-8")
            return certified(statement, tmp_path / "out", "--select", "states", *(options or ("--allow-motion",)))

    return run


def _failed(cell, folder):
    """Return the requirements that a device breaks, without a run of the command."""
    states = msgspec.convert(tomllib.loads(MAP)["states"], StateMap)
    with driven(cell.description, cell.routes, folder) as (api, _, _):
        api.run.allow_motion = True
        walk = walked.play(api, states)
    judged = {one.requirement: list(one.judge(walk, states)) for one in _RULES}
    assert all(any(isinstance(one, Case) for one in found) for found in judged.values())
    return {
        name.partition("/")[2]
        for name, found in judged.items()
        if not all(one.holds for one in found if isinstance(one, Case))
    }


def test_a_right_cell_is_led_through_all_states_and_back(judged, tmp_path):
    cell = Cell()
    outcome = judged(cell)
    assert (outcome.exit_code, outcome.blamed) == (0, {}), outcome.text
    assert outcome.requirement("states/refused")["cases"] == 15
    assert cell.state == "ready"
    shown = grid(tmp_path / "out", outcome.result)
    assert shown is not None
    assert "".join(cell.sign[:3] for cell in shown.rows["POST /reset"]) == "✓ r·✓ r✓ r✓ t"
    assert "".join(cell.sign[:3] for cell in shown.rows["POST /estop"]) == "✓ t·✓ t·✓ t"


@pytest.fixture(scope="module")
def failed_by(tmp_path_factory):
    """Return the requirements that each fault breaks; the devices are led at the same time, as each mostly waits."""
    folders = {fault: tmp_path_factory.mktemp("cell") for fault in FAULTS}
    Contract.load()  # several threads that begin to read one kind of TOML at once have crashed msgspec
    with ThreadPoolExecutor(len(FAULTS)) as pool:
        return dict(zip(FAULTS, pool.map(lambda fault: _failed(Cell(fault), folders[fault]), FAULTS), strict=True))


@pytest.mark.parametrize(("fault", "requirement"), FAULTS.items())
def test_a_fault_is_named(failed_by, fault, requirement):
    assert requirement in failed_by[fault]
    assert failed_by[fault] <= {requirement, "leads", "order", "keeps"}


_RESTING = """
[states]
read = "GET /cell"
at = "/state"
at_rest = ["ready"]
[states.operations]
"POST /start" = { from = ["ready"], via = ["starting"], to = "running" }
"POST /stop" = { from = ["ready", "starting", "running"], to = "ready" }
"""
_MOTION = """
[motion.state]
read = "GET /pose"
axes = { x = { at = "/x", limits = [-100, 100], unit = "m" } }
[motion.goto]
send = "POST /start"
body = { x = "{x}" }
tolerance = 0.02
"""


class Arm(Cell):
    """A cell whose arm moves while a program runs, and for a while after that.

    Args:
        coasts_s: how long it moves after its program has ended or was stopped, s.
        creeps: how fast it does, m/s.
        noise: standard deviation of its position as it is read.
        program_s: how long a program runs, s; None: until it is stopped.
    """

    def __init__(self, coasts_s=0.0, creeps=0.3, noise=0.0, program_s=None):
        super().__init__(program_s=program_s)
        self._creeps, self._coasts_s, self._noise = creeps, coasts_s, noise
        self._x, self._at, self._until, self._random = 0.0, time.monotonic(), 0.0, random.Random(3)  # noqa: S311 - noise
        pose = {"type": "object", "required": ["x"], "properties": {"x": {"type": "number"}}}
        self.description["paths"]["/pose"] = reading(pose)
        self.routes["/pose"] = {"GET": self._pose}

    def _go_on(self):
        now, runs = time.monotonic(), self._state in {"starting", "running"}
        moves_s = max(0.0, (now if runs else min(now, self._until)) - self._at)
        self._x, self._at = self._x + moves_s * (0.3 if runs else self._creeps), now

    def _to(self, state):
        self._go_on()
        runs = self._state in {"starting", "running"}
        self._until = time.monotonic() + self._coasts_s if runs else self._until
        super()._to(state)

    async def _pose(self, _):
        _ = self.state
        self._go_on()
        return web.json_response({"x": self._x + self._random.gauss(0.0, self._noise)})


_ENDS = '\n[states.changes.running]\nto = ["ready"]\nwithin_s = 3\n'


@pytest.mark.parametrize(
    ("arm", "more", "blamed"),
    [
        (Arm(), "", False),
        (Arm(noise=0.03), "", False),
        (Arm(coasts_s=0.6), "", False),
        (Arm(coasts_s=9, creeps=0.02), "", False),
        (Arm(coasts_s=0.6, noise=0.01, program_s=0.5), _ENDS, False),
        (Arm(coasts_s=9), "", True),
        (Arm(coasts_s=9, noise=0.01), "", True),
        (Arm(coasts_s=9, program_s=0.5), _ENDS, True),
    ],
    ids=[
        "it rests", "with noise", "it settles", "it creeps within its tolerance", "its program ends and it settles",
        "it moves on", "it moves on with noise", "its program ends and it moves on",
    ],
)  # fmt: skip
def test_ready_is_not_said_while_it_moves(arm, more, blamed, tmp_path):
    states = msgspec.convert(tomllib.loads(_RESTING + more)["states"], StateMap)
    motion = motion_map_of(_MOTION, "the map")
    with driven(arm.description, arm.routes, tmp_path) as (api, _, _):
        api.run.allow_motion = True
        api.run.statement = msgspec.structs.replace(api.run.statement, motion_map=motion)
        walk = walked.play(api, states)
    assert walk.rests
    found = [one for one in test_state_machine.order.judge(walk, states) if isinstance(one, Case) and not one.holds]
    assert bool(found) is blamed, [rest.ways for rest in walk.rests]
    assert all(" moved by " in one.observed and "/cell" in one.exchange.request.target for one in found)


@pytest.mark.parametrize(("program_s", "over_s"), [(0.4, 60.0), (0.6, 0.25)])
def test_a_program_that_ends_by_itself_is_no_fault(program_s, over_s, judged):
    """One ends between a read and the command after it, unless that comes soon."""
    more = 'running = { to = ["ready"], within_s = 2 }\n'
    outcome = judged(Cell(program_s=program_s, over_s=over_s), more)
    assert (outcome.exit_code, outcome.blamed) == (0, {}), outcome.text


@pytest.mark.parametrize(("ends", "blamed"), [(["paused", "ready"], set()), (["ready"] * 2, {"leads"})])
def test_what_was_over_before_it_could_pause_is_excused_by_a_try_in_time(ends, blamed):
    more = 'running = { to = ["ready"] }\n'
    states = msgspec.convert(tomllib.loads(MAP + more)["states"], StateMap)
    exchange = Exchange(Request("POST", "http://cell/pause", (), b""), Response(200, (), b"", 1.0))
    steps = [Step("POST /pause", "running", exchange, True, (end,), end == "paused") for end in ends]
    walk = Walk(states.states, {}, tuple(steps), "ready", "ready")
    judged = {one.requirement: list(one.judge(walk, states)) for one in _RULES}
    failed = {name for name, found in judged.items() if not all(one.holds for one in found if isinstance(one, Case))}
    assert failed == {f"states/{one}" for one in blamed}


def test_nothing_is_sent_without_permission(judged):
    cell = Cell()
    outcome = judged(cell, "", "--never", "/nothing")
    assert outcome.exit_code == 4
    assert "--allow-motion" in outcome.text
    assert cell.sent == []


@pytest.mark.parametrize("path", [one for one in EXAMPLES.glob("*/*.toml") if "[states]" in one.read_text("utf-8")])
def test_a_map_among_the_examples_is_right(path):
    states = msgspec.convert(tomllib.loads(path.read_text("utf-8"))["states"], StateMap)
    assert len(states.states) > 5


@pytest.mark.parametrize(
    ("table", "said"),
    [
        ('[states]\nread = "GET /cell"\nat = "/state"\noperations = {}\n', "fewer than two states"),
        ('[states]\nread = "GET /cell"\nat = "state"\noperations = {}\n', "state"),
        (
            '[states]\nread = "GET /cell"\nat = "/s"\n[states.operations]\n"POST /a" = { to = "b", form = ["a"] }\n',
            "form",
        ),
        ('[states]\nread = "GET /cell"\nat = "/s"\n[states.operations]\ngo = { to = "b" }\n', "needs send ="),
        (MAP.replace("within_s = 2", 'at_rest = ["redy"]'), "at_rest names 'redy'"),
        ('[states]\nread = "GET /cell"\nat = "/s"\npattern = "a"\noperations = {}\n', "must have one group"),
        ('[states]\nread = "GET /cell"\nat = "/s"\npattern = "(a"\noperations = {}\n', "no regular expression"),
    ],
)
def test_a_wrong_map_is_told(tmp_path, table, said):
    path = tmp_path / "cell.toml"
    path.write_text(table, encoding="utf-8")
    with pytest.raises(StatementError, match=said):
        load_statement(path, Contract.load())


def test_an_operation_that_the_description_lacks_is_told(judged):
    outcome = judged(Cell(), '[states.operations."POST /strat"]\nto = "running"\n')
    assert outcome.exit_code == 2
    assert "did you mean 'POST /start'" in outcome.text
