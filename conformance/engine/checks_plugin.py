"""The pytest plugin that runs the checks on a robot: selection, order, fixtures, and evidence from exceptions."""

from collections.abc import Callable, Generator
from importlib import import_module
from pathlib import Path
from typing import Any, TypeVar

import pytest

from conformance.api.interfaces import Interfaces
from conformance.api.rest.interface import RestInterface
from conformance.api.soap.callable_services import SoapServices
from conformance.api.soap.service import SoapService
from conformance.commandline.secrecy import SECRETS
from conformance.contract.classes import Interface, Level
from conformance.contract.ledger import expanded
from conformance.contract.pack import Contract
from conformance.engine.robot_under_test import RobotUnderTest
from conformance.scenarios.plan import Step, order_steps
from conformance.scenarios.scenario import Recordings
from conformance.scenarios.stage import STAGES, Stage
from conformance.statement.statement import Statement
from conformance.transport.client import Connection, HttpClient
from conformance.verdict.effort import Effort
from conformance.verdict.evidence import Judge
from conformance.verdict.explorer import Explorer
from conformance.verdict.finding import Finding
from conformance.verdict.run import Run

_NO_ADDRESS = "the robot's {} interface has no address"
_Interface = TypeVar("_Interface")
# Marks a check whose skip reason is recorded already, for example by an earlier check with the same failure.
_TOLD_BEFORE: pytest.StashKey[bool] = pytest.StashKey()


def is_check(item: pytest.Item) -> bool:
    """Return whether a test judges requirements."""
    return item.get_closest_marker("requirement") is not None


def _there(interface: _Interface | None, name: Interface) -> _Interface:
    if interface is None:
        pytest.skip(_NO_ADDRESS.format(name))
    return interface


class ChecksPlugin:
    """A pytest plugin for one run.

    Args:
        connect: returns the connected robot; called once, when there is a check to run.
        contract: returns the contract pack; called when the first file with checks is collected.
        recordings: keeps the traces of scenarios; None if they are discarded.
    """

    def __init__(
        self,
        connect: Callable[[], RobotUnderTest],
        contract: Callable[[], Contract],
        recordings: Recordings | None = None,
    ) -> None:
        self._connect, self._contract = connect, contract
        self._has_fixtures = False
        self._recordings = Recordings() if recordings is None else recordings
        self._connected: RobotUnderTest | None = None
        self._told: set[str] = set()

    def _robot(self) -> RobotUnderTest:
        if self._connected is None:
            self._connected = self._connect()
            self._connected.is_at_rest = False
        return self._connected

    def ids_of(self, item: pytest.Item) -> tuple[str, ...]:
        """Return the ids of the requirements that a check judges."""
        renamed = self._robot().run.contract.ids_by_alias
        return tuple(dict.fromkeys(renamed.get(id_, id_) for id_ in self.parts_of(item)))

    def parts_of(self, item: pytest.Item) -> tuple[str, ...]:
        """Return the ids by which a check names its requirements; an alias is a part of a requirement."""
        marked = (id_ for mark in item.iter_markers("requirement") for id_ in mark.args)
        return expanded(marked, self._robot().run.contract.ledger)

    def step_of(self, item: pytest.Item) -> Step:
        """Return a check's step in the plan of the run."""
        stage, scenario = item.get_closest_marker("phase"), item.get_closest_marker("scenario")
        return Step(
            name=item.name.removeprefix("test_").replace("_", " "),
            stage=Stage(stage.args[0]) if stage else STAGES[0],
            requirements=self.ids_of(item),
            scenario=scenario.args[0] if scenario else None,
            moves=item.get_closest_marker("motion") is not None,
        )

    def pytest_configure(self, config: pytest.Config) -> None:
        """Register the markers."""
        config.addinivalue_line("markers", "requirement(*ids): the requirements that a check judges")
        config.addinivalue_line("markers", "phase(name): when in a run a check's turn comes")
        config.addinivalue_line("markers", "scenario(scenario): whose trace a rule judges")
        config.addinivalue_line("markers", "rule(rule, scenario): what judges it")
        config.addinivalue_line("markers", "motion: the check moves the robot")
        config.addinivalue_line("markers", "needs(*interfaces): rest, publishers, subscribers")

    def pytest_collect_file(self, file_path: Path, parent: pytest.Collector) -> None:
        """Register the fixtures of the checks before the first file with checks is collected."""
        if self._has_fixtures or file_path.parent.parent.name != "rules":
            return
        self._has_fixtures = True
        # Imported late: the plugin is loaded in every pytest run where the suite is installed.
        from conformance.api.device import fixtures_of  # noqa: PLC0415
        from conformance.scenarios.collecting import RulesPlugin  # noqa: PLC0415

        parent.config.pluginmanager.register(RulesPlugin(self._recordings), "roaas-rules")
        for name in ("conformance.rules.fixtures", *fixtures_of(self._contract())):
            parent.config.pluginmanager.register(import_module(name), name)

    def pytest_collection_modifyitems(self, config: pytest.Config, items: list[pytest.Item]) -> None:
        """Deselect checks of classes that are not claimed or selected, and sort the others by the plan."""
        if not any(map(is_check, items)):
            return
        run = self._robot().run
        ledger = run.contract.ledger
        claimed = {id_ for id_, requirement in ledger.items() if requirement.binds(run.claims)}
        chosen = {id_ for id_ in claimed if run.selection.has(id_)}
        played = claimed if run.selection.played is None else claimed & run.selection.played
        kept = [
            item
            for item in items
            if not is_check(item)
            or not (chosen if item.get_closest_marker("motion") else played).isdisjoint(self.ids_of(item))
        ]
        dropped = [item for item in items if item not in kept]
        config.hook.pytest_deselected(items=dropped)
        for item in kept:
            run.judge.announce(self.parts_of(item))
        steps = [(self.step_of(item), item) for item in kept]
        turns = {id(step): number for number, step in enumerate(order_steps([step for step, _ in steps], ledger))}
        items[:] = [item for _, item in sorted(steps, key=lambda pair: turns[id(pair[0])])]

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_setup(self, item: pytest.Item) -> None:
        """Skip a check that cannot run; the reason becomes the verdict's reason."""
        if not is_check(item):
            return
        run = self._robot().run
        self._robot().begin(item.nodeid.rsplit("/", 1)[-1])
        if run.interrupted:
            # Ctrl-C arrived in code that swallows exceptions: raise it again here.
            raise KeyboardInterrupt
        if run.aborted and not self._is_recorded(item):
            pytest.skip(run.aborted)
        if not self._is_recorded(item) and run.limit.over:
            item.stash[_TOLD_BEFORE] = True
            for id_ in self.ids_of(item):
                run.out_of_time(id_)
            pytest.skip(run.limit.reason)
        if item.get_closest_marker("motion") and not run.allow_motion:
            pytest.skip("it moves the robot, and --allow-motion was not given")
        for mark in item.iter_markers("needs"):
            for name in mark.args:
                self._need(Interface(name), self.ids_of(item))

    def _is_recorded(self, item: pytest.Item) -> bool:
        """Return whether a check judges records only, and sends nothing."""
        mark = item.get_closest_marker("scenario")
        return mark is not None and mark.args[0].name in self._recordings.played

    def _need(self, name: Interface, ids: tuple[str, ...]) -> None:
        """Skip a check that needs an interface which has no address or is not described by the contract."""
        run = self._robot().run
        if not self._robot().has(name):
            reason = _NO_ADDRESS.format(name)
            for id_ in ids if name not in run.contract.interfaces else ():
                run.judge.note_unclaimed(id_, reason)
            pytest.skip(reason)
        if name in run.unreachable:
            pytest.skip(f"the robot's {name} interface does not answer: {run.unreachable[name]}")

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_call(self, item: pytest.Item) -> Generator[None, object, object]:
        """Run a check, and turn exceptions into evidence."""
        if not is_check(item):
            return (yield)
        ids = self.parts_of(item)
        # Imported late: the plugin is loaded in every pytest run where the suite is installed.
        from conformance.engine.record_exception import record_exception  # noqa: PLC0415

        robot = self._robot()
        judge = robot.run.judge
        judged, recent = judge.counts(ids), robot.connection.recent
        before = recent[-1] if recent else None
        try:
            with robot.run.limit.lift(when=item.get_closest_marker("motion") is not None):
                result: object = yield
        except Exception as error:  # noqa: BLE001 - whatever a robot makes of a check has to become a verdict
            record_exception(robot.run, robot.alive, ids, judged, error)
            result = None
        if recent and recent[-1].kind is not None and recent[-1] is not before:
            # A check may have ignored a missing response, so see whether the robot still responds.
            robot.alive()
        self._tell(item, robot.run)
        return result

    def _tell(self, item: pytest.Item, run: Run) -> None:
        """Fail the pytest item if a MUST failed; skip it if earlier checks failed for the same causes."""
        from conformance.verdict.finding import in_full  # noqa: PLC0415 - as above

        musts = {
            id(finding): finding
            for finding in run.judge.met
            if run.contract.ledger[finding.requirement].level is Level.MUST and not finding.doubt
        }
        new: list[Finding] = []
        for finding in musts.values():
            if not finding.causes or not finding.causes <= self._told:
                new.append(finding)
            self._told |= finding.causes
        first = next((finding for finding in new if run.selection.ends_at(finding.requirement)), None)
        if first and not run.aborted:
            run.aborted = f"the run ended at its first finding (-x), of {first.requirement}"
        if new:
            pytest.fail(SECRETS.masked("\n".join(map(in_full, new))), pytrace=False)
        if musts:
            item.stash[_TOLD_BEFORE] = True
            pytest.skip(f"Not tested, because of a failure before: {next(iter(musts.values())).brief}")

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(self, item: pytest.Item, call: pytest.CallInfo[None]) -> Generator[None, Any, Any]:
        """Record the reason of a skip as evidence."""
        report: pytest.TestReport = yield
        ids = self.ids_of(item) if is_check(item) and _TOLD_BEFORE not in item.stash else ()
        if ids and report.skipped and call.excinfo is not None:
            run = self._robot().run
            reason = str(getattr(call.excinfo.value, "msg", call.excinfo.value))
            say = run.judge.note_stopped if run.aborted else run.judge.skip
            for id_ in ids:
                say(id_, reason)
        return report

    def pytest_sessionfinish(self) -> None:
        """Stop the robot at the end of the session, also after Ctrl-C."""
        if self._connected is not None:
            self._connected.leave_at_rest()

    @pytest.fixture(scope="session")
    def run(self) -> Run:
        """Return the data of the run."""
        return self._robot().run

    @pytest.fixture(scope="session")
    def connection(self) -> Connection:
        """Return the settings that all clients of the run share."""
        return self._robot().connection

    @pytest.fixture(scope="session")
    def interfaces(self) -> Interfaces:
        """Return the robot's interfaces, each of which may be missing."""
        return self._robot().interfaces

    @pytest.fixture
    def judge(self, run: Run) -> Judge:
        """Return the judge, which records evidence."""
        return run.judge

    @pytest.fixture
    def statement(self, run: Run) -> Statement:
        """Return the vendor's statement."""
        return run.statement

    @pytest.fixture
    def effort(self, run: Run) -> Effort:
        """Return how much to try."""
        return run.effort

    @pytest.fixture
    def api(self, interfaces: Interfaces) -> RestInterface:
        """Return the robot's REST interface together with the run."""
        return _there(interfaces.rest, Interface.REST)

    @pytest.fixture
    def rest(self, api: RestInterface) -> HttpClient:
        """Return the HTTP client of the robot's REST interface."""
        return api.client

    @pytest.fixture
    def soap(self, interfaces: Interfaces) -> SoapServices:
        """Return the robot's SOAP services, each of which may be missing."""
        return interfaces.soap

    @pytest.fixture
    def publishers(self, soap: SoapServices) -> SoapService:
        """Return the SOAP service whose operations act."""
        return _there(soap.publishers, Interface.PUBLISHERS)

    @pytest.fixture
    def subscribers(self, soap: SoapServices) -> SoapService:
        """Return the SOAP service whose operations only read."""
        return _there(soap.subscribers, Interface.SUBSCRIBERS)

    @pytest.fixture
    def explore(self, request: pytest.FixtureRequest, run: Run) -> Explorer:
        """Return the Hypothesis runner, seeded by the run's seed and the check's name."""
        from conformance.verdict.explorer import Explorer  # noqa: PLC0415 - as above

        return Explorer(run.seed, request.node.nodeid.rsplit("/", 1)[-1], run.effort, run.tally)
