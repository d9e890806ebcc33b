"""Fixtures for every room's tests, such as a ROS domain of one's own, and the order in which processes share tests."""

import fcntl
import os
import signal
import tempfile
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from hypothesis import settings

from conformance.commandline.secrecy import SECRETS

# How long an example takes is the machine's affair, which others may use as well. Every run has the same examples.
settings.register_profile("tests", deadline=None, derandomize=True)
settings.load_profile("tests")

# A shell's background jobs ignore these, and so would all processes that the tests start and end by them.
signal.signal(signal.SIGINT, signal.default_int_handler)
if hasattr(signal, "SIGQUIT"):
    signal.signal(signal.SIGQUIT, signal.SIG_DFL)

# Folders whose tests start whole commands: few tests that take long. One that began last would run alone at the end.
_OF_COMMANDS = {"ci", "first_verdict", "hostile", "loadtests", "motion", "selftest"}


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with the modules that start commands, and with those that have most tests, if processes share the tests."""
    if "PYTEST_XDIST_WORKER" in os.environ:
        tests = Counter(item.path for item in items)
        items.sort(key=lambda item: (item.path.parent.name not in _OF_COMMANDS, -tests[item.path], item.path))


# Ids up to 101 leave DDS's ports below Linux's ephemeral range.
_DOMAIN_IDS = range(40, 102)


@pytest.fixture(autouse=True)
def _no_secrets() -> Iterator[None]:
    """Let no test mask what was a secret in another one."""
    SECRETS.forget()
    yield
    SECRETS.forget()


@contextmanager
def _held_domain_id() -> Iterator[int]:
    for candidate in _DOMAIN_IDS:
        lock = Path(tempfile.gettempdir(), f"roaas-domain-{candidate}.lock").open("w")  # noqa: SIM115 - held below
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            lock.close()
            continue
        with lock:
            yield candidate
        return
    pytest.fail(f"all ROS domain ids from {_DOMAIN_IDS[0]} to {_DOMAIN_IDS[-1]} are taken by other tests")


@pytest.fixture
def domain_id(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """Yield a ROS domain id that no other test of any process on this machine holds."""
    with _held_domain_id() as held:
        monkeypatch.setenv("ROS_DOMAIN_ID", str(held))
        monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        yield held


@pytest.fixture(scope="module")
def module_domain_id() -> Iterator[int]:
    """Yield a domain id for a robot that the tests of one module share."""
    with _held_domain_id() as held:
        yield held


@pytest.fixture(scope="session")
def session_domain_id() -> Iterator[int]:
    """Yield a domain id for a robot that many tests share; the environment is the user's affair."""
    with _held_domain_id() as held:
        yield held
