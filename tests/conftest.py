"""Fixtures for every room's tests, such as a ROS domain of one's own, and the order in which processes share tests."""

import gc
import inspect
import itertools
import os
import signal
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack
from pathlib import Path

import pytest
from _pytest.terminal import TerminalReporter
from hypothesis import settings
from xdist.scheduler import LoadFileScheduling

from conformance.commandline.secrecy import SECRETS
from conformance.contract.pack import Contract
from proof.selftest.robots import own_domain

# How long an example takes is the machine's affair, which others may use as well. Every run has the same examples.
settings.register_profile("tests", deadline=None, derandomize=True)
settings.load_profile("tests")

# A shell's background jobs ignore these, and so would all processes that the tests start and end by them.
signal.signal(signal.SIGINT, signal.default_int_handler)
if hasattr(signal, "SIGQUIT"):
    signal.signal(signal.SIGQUIT, signal.SIG_DFL)

# What takes longest begins first; a module that began last would run alone at the end. Load tests are two chains of
# minutes, the modules named here take one to three, and tests of these folders start whole commands.
_LONGEST = (
    "test_ros_gateway.py", "test_sprinklers.py", "test_wired_device.py", "test_lost_robot.py", "test_lost_device.py",
    "test_hostile_devices.py", "test_secrets.py", "test_servers.py", "test_things_that_end.py",
    "test_stateful_devices.py", "test_motion_drive.py", "test_wheel.py",
    "test_web_servers.py", "test_gateway.py", "test_load_secrets.py", "test_certify_command.py", "test_soap.py",
    "test_bombs.py",
)  # fmt: skip
_OF_COMMANDS = {
    "ci", "cli", "described", "first_verdict", "fleet", "hostile", "loadtests", "motion", "ros", "selftest", "soap",
    "states", "webservices",
}  # fmt: skip


# Load tests measure. However many processes share the tests, two at most run at a time: one of these, one of the rest.
_HALF = ("command", "workers", "described_soap", "locust", "stages", "against")
_HALF_OF_LOAD_TESTS = {f"tests/loadtests/test_load_{name}.py" for name in _HALF}


#: Their tests share nothing, and wait for most of their minutes.
_APART = (
    "test_ros_proposals.py", "test_lost_robot.py", "test_lost_device.py", "test_secrets.py", "test_bombs.py",
    "test_certify_command.py", "test_endings.py",
)  # fmt: skip


class _Sharing(LoadFileScheduling):
    """Give each process whole modules, those of some modules one by one, and all load tests to gw0 and gw1."""

    def schedule(self) -> None:
        """Have the first units, which are the load tests, go to the first processes, whichever is ready first."""
        in_order = sorted(self.assigned_work, key=lambda node: (len(node.gateway.id), node.gateway.id))
        self.assigned_work = {node: self.assigned_work[node] for node in in_order}
        super().schedule()

    def _split_scope(self, nodeid: str) -> str:
        module = super()._split_scope(nodeid)
        if module.endswith(_APART):
            return nodeid
        if not module.startswith("tests/loadtests/test_load_"):
            return module
        return f"load tests, {module in _HALF_OF_LOAD_TESTS}"


@pytest.hookimpl(optionalhook=True)  # of a plugin
def pytest_xdist_make_scheduler(config: pytest.Config, log: object) -> LoadFileScheduling:
    """Return what shares the tests among the processes."""
    return _Sharing(config, log)


class _Failures:
    """Names each failing test at once; pytest names them in the end. Then it shows how busy each process was."""

    def __init__(self, terminal: TerminalReporter) -> None:
        self._terminal, self._seconds = terminal, Counter[str]()

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Write the name of a test that failed."""
        if report.failed:
            self._terminal.write_line(f"\nfailed: {report.nodeid}")
        if node := getattr(report, "node", None):
            self._seconds[node.gateway.id] += report.duration

    def pytest_terminal_summary(self) -> None:
        """Write for how long each process ran tests: one with far less than the whole run had nothing left to do."""
        for process, seconds in sorted(self._seconds.items()):
            self._terminal.write_line(f"{process}: {seconds:.0f} s of tests")


@pytest.hookimpl(trylast=True)  # pytest makes the reporter in this hook
def pytest_configure(config: pytest.Config) -> None:
    """Name failing tests on a terminal, which gw0, gw1, ... have not."""
    config.addinivalue_line("markers", "side_by_side(at_once): of tests that mostly wait, and measure no latencies")
    if terminal := config.pluginmanager.get_plugin("terminalreporter"):
        config.pluginmanager.register(_Failures(terminal))


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with load tests, the longest modules and those that start commands, if processes share the tests."""
    if "PYTEST_XDIST_WORKER" in os.environ:
        tests = Counter(item.path for item in items)
        items.sort(key=lambda item: (*_turn(item.path), -tests[item.path], item.path))


def _turn(module: Path) -> tuple[int, bool]:
    """Return when a module begins; the least comes first."""
    is_load_test = module.parent.name == "loadtests" and module.name.startswith("test_load_")
    place = _LONGEST.index(module.name) if module.name in _LONGEST else len(_LONGEST)
    return -1 if is_load_test else place, module.parent.name not in _OF_COMMANDS


def pytest_collection_finish() -> None:
    """Look seldom for garbage in circles, and never among modules and tests, which live as long as the process.

    Let load tests, in gw0 and gw1, go first. All processes collect at one priority, as each waits for the last.
    """
    if os.environ.get("PYTEST_XDIST_WORKER", "gw0") not in {"gw0", "gw1"}:
        os.nice(10)  # inherited by what the tests start
    gc.collect()
    gc.freeze()
    gc.set_threshold(50_000, 50)


_FIRST_DOMAIN_ID = 40
# A node of the test before may still be seen in its domain, so that each test, and each process of pytest, begins its
# search for a free one elsewhere: in the first forty, as the others are room for those that are taken.
_STARTS = 40
_turns = itertools.count(10 * int(os.environ.get("PYTEST_XDIST_WORKER", "gw0").removeprefix("gw")))


def _first_domain_id() -> int:
    return _FIRST_DOMAIN_ID + next(_turns) % _STARTS


@pytest.fixture(autouse=True)
def _no_secrets() -> Iterator[None]:
    """Let no test mask what was a secret in another one."""
    SECRETS.forget()
    yield
    SECRETS.forget()


#: So many tests of a module that are marked `side_by_side` go on at a time, unless their mark says another number.
_AT_ONCE = 3


def _call(test: pytest.Function, folder: Path) -> None:
    names = inspect.signature(test.function).parameters
    with ExitStack() as held:
        given = dict(test.callspec.params) if hasattr(test, "callspec") else {}
        given |= {"tmp_path": folder} if "tmp_path" in names else {}
        given |= {"domain_id": held.enter_context(own_domain(_first_domain_id()))} if "domain_id" in names else {}
        test.function(**given)


@pytest.fixture(scope="module")
def _begun(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[dict[str, Future[None]]]:
    """Begin the selected tests of a module in threads, some at a time."""
    Contract.load()  # threads that begin to read one kind of TOML at once have crashed msgspec
    every = {one: one.get_closest_marker("side_by_side") for one in request.session.items if one.path == request.path}
    tests = [one for one, mark in every.items() if mark]
    at_once = every[tests[0]].args or (_AT_ONCE,)
    with pytest.MonkeyPatch.context() as patched, ThreadPoolExecutor(*at_once) as pool:
        patched.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        yield {one.nodeid: pool.submit(_call, one, tmp_path_factory.mktemp("beside")) for one in tests}
        pool.shutdown(cancel_futures=True)


@pytest.fixture(autouse=True)
def _side_by_side(request: pytest.FixtureRequest) -> None:
    """Await the thread of a test that is marked `side_by_side`, instead of calling it.

    It may have parameters, `tmp_path` and `domain_id`. Others of the module stand before it, or begin after it.
    """
    if request.node.get_closest_marker("side_by_side"):
        begun = request.getfixturevalue("_begun")[request.node.nodeid]
        request.node.obj = lambda **_: begun.result()


@pytest.fixture
def domain_id(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """Yield a ROS domain id that no other test of any process on this machine holds."""
    with own_domain(_first_domain_id()) as held:
        monkeypatch.setenv("ROS_DOMAIN_ID", str(held))
        monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        yield held


@pytest.fixture(scope="module")
def module_domain_id() -> Iterator[int]:
    """Yield a domain id for a robot that the tests of one module share."""
    with own_domain(_first_domain_id()) as held:
        yield held


@pytest.fixture(scope="session")
def session_domain_id() -> Iterator[int]:
    """Yield a domain id for a robot that many tests share; the environment is the user's affair."""
    with own_domain(_first_domain_id()) as held:
        yield held
