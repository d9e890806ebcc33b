"""The pytest plugin: options, markers, fixtures, and what becomes of a check's outcome.

``roaas certify`` runs it with a session made by the command; in somebody's own project
``pytest --pyargs conformance --robot-rest URL`` makes one from the options.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from collections.abc import Generator

    from conformance.contract.statement import Statement
    from conformance.engine.session import Session
    from conformance.transport.client import HttpClient
    from conformance.verdict.effort import Effort
    from conformance.verdict.evidence import Judge
    from conformance.verdict.explorer import Explorer

# Reading first; then what needs a robot at rest; deliveries late, because a robot drives long after them; attacks last.
PHASES = ("reach", "reading", "describe", "motion", "input", "delivery", "attack")
SESSION: pytest.StashKey[Session] = pytest.StashKey()


def pytest_addoption(parser: pytest.Parser) -> None:
    """Options for use in a project of one's own; ``roaas certify`` has better ones."""
    group = parser.getgroup("robot", "RoAAS: conformance of a robot's web services")
    group.addoption("--robot-statement", metavar="FILE", help="implementation conformance statement (TOML)")
    group.addoption("--robot-rest", metavar="URL", help="base URL of the robot's REST interface")
    group.addoption("--robot-publishers-wsdl", metavar="URL", help="WSDL of the publishers service, URL or file")
    group.addoption("--robot-subscribers-wsdl", metavar="URL", help="WSDL of the subscribers service, URL or file")
    group.addoption("--robot-class", action="append", metavar="NAME", help="conformance class to judge (repeatable)")
    group.addoption("--robot-allow-motion", action="store_true", help="the robot may be moved")
    group.addoption("--robot-effort", default="standard", help="quick, standard or deep")
    group.addoption("--robot-seed", type=int, default=0, help="seed of all random cases")
    group.addoption("--robot-timeout", type=float, default=None, help="deadline of one request, s")


def pytest_configure(config: pytest.Config) -> None:
    """Register the markers."""
    config.addinivalue_line("markers", "requirement(*ids): the requirements that a check judges")
    config.addinivalue_line("markers", "phase(name): when in a run a check's turn comes")
    config.addinivalue_line("markers", "motion: the check moves the robot")
    config.addinivalue_line("markers", "needs(*interfaces): rest, publishers, subscribers")
    given = config.pluginmanager.get_plugin("roaas-session")
    if given is not None:
        config.stash[SESSION] = given.session


def ids_of(item: pytest.Item) -> tuple[str, ...]:
    """The requirements that a check judges; empty for a test that is no check."""
    return tuple(id_ for mark in item.iter_markers("requirement") for id_ in mark.args)


def _session(config: pytest.Config) -> Session:
    if SESSION not in config.stash:
        # Imported late: the plugin is loaded in every pytest run where the suite is installed.
        from conformance.engine.pytest_run import session_from_options  # noqa: PLC0415

        config.stash[SESSION] = session_from_options(config)
    return config.stash[SESSION]


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Keep the checks that judge something claimed, in the order of their phases."""
    if not any(ids_of(item) for item in items):
        return
    session = _session(config)
    ledger = session.contract.ledger
    kept: list[pytest.Item] = []
    dropped: list[pytest.Item] = []
    for item in items:
        ids = ids_of(item)
        wanted = not ids or any(id_ in ledger and ledger[id_].class_ in session.claims for id_ in ids)
        (kept if wanted else dropped).append(item)
    config.hook.pytest_deselected(items=dropped)
    items[:] = sorted(kept, key=_turn)


def _turn(item: pytest.Item) -> tuple[int, str]:
    """When a check's turn comes: by its phase, then by its module's name, whichever folder that is in."""
    mark = item.get_closest_marker("phase")
    return PHASES.index(mark.args[0]) if mark else 0, item.path.name


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """Skip what cannot be judged in this run; the reason goes into the verdict."""
    if not ids_of(item):
        return
    session = _session(item.config)
    session.judge.check_name = item.nodeid.rsplit("/", 1)[-1]
    session.judge.at_risk = ()
    if session.aborted:
        pytest.skip(session.aborted)
    if item.get_closest_marker("motion") and not session.allow_motion:
        pytest.skip("it moves the robot, and --allow-motion was not given")
    for mark in item.iter_markers("needs"):
        for name in mark.args:
            if getattr(session, name) is None:
                _no_address(session, ids_of(item), name)
            if name in session.unreachable:
                pytest.skip(f"the robot's {name} interface does not answer: {session.unreachable[name]}")


def _no_address(session: Session, ids: tuple[str, ...], name: str) -> None:
    """Skip for want of an interface; a vendor who named no classes has not claimed what needs it."""
    reason = f"the robot's {name} interface has no address"
    if session.statement.claims is None:
        for id_ in ids:
            session.judge.unclaimed(id_, reason)
    pytest.skip(reason)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item: pytest.Item) -> Generator[None, object, object]:
    """Run a check, and turn what it raises into evidence."""
    ids = ids_of(item)
    if not ids:
        return (yield)
    from conformance.engine.outcome import settle  # noqa: PLC0415 - see _session

    session = _session(item.config)
    refuted, judged = session.judge.refuted(), session.judge.counts(ids)
    try:
        result: object = yield
    except Exception as error:  # noqa: BLE001 - whatever a robot makes of a check has to become a verdict
        settle(session, ids, judged, error)
        result = None
    ours = {id_: count for id_, count in session.judge.refuted().items() if count > refuted.get(id_, 0)}
    musts = [id_ for id_ in ours if session.contract.ledger[id_].level == "MUST"]
    if musts:
        pytest.fail("\n".join(session.judge.told(id_) for id_ in musts), pytrace=False)
    return result


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: pytest.CallInfo[None]) -> Generator[None, Any, Any]:
    """Put a skip's reason down as evidence."""
    report: pytest.TestReport = yield
    ids = ids_of(item)
    if ids and report.skipped and call.excinfo is not None:
        session = _session(item.config)
        reason = str(getattr(call.excinfo.value, "msg", call.excinfo.value))
        say = session.judge.error if session.aborted else session.judge.skip
        for id_ in ids:
            say(id_, reason)
    return report


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Leave the robot at rest, whatever happened, Ctrl-C included."""
    if SESSION in session.config.stash:
        from conformance.robot.stopping import leave_at_rest  # noqa: PLC0415 - see _session

        leave_at_rest(session.config.stash[SESSION])


@pytest.fixture(name="roaas", scope="session")
def _roaas(request: pytest.FixtureRequest) -> Session:
    """The run."""
    return _session(request.config)


@pytest.fixture
def judge(roaas: Session) -> Judge:
    """Takes what a check sees."""
    return roaas.judge


@pytest.fixture
def statement(roaas: Session) -> Statement:
    """What the vendor says of the robot."""
    return roaas.statement


@pytest.fixture
def effort(roaas: Session) -> Effort:
    """How much to try."""
    return roaas.effort


@pytest.fixture
def rest(roaas: Session) -> HttpClient:
    """The robot's REST interface."""
    if roaas.rest is None:
        pytest.skip("the robot's REST interface has no address")
    return roaas.rest


@pytest.fixture
def explore(request: pytest.FixtureRequest, roaas: Session) -> Explorer:
    """Hypothesis, seeded by the run's seed and the check's name."""
    from conformance.verdict.explorer import Explorer  # noqa: PLC0415 - see _session

    return Explorer(roaas.seed, request.node.nodeid.rsplit("/", 1)[-1], roaas.effort)
