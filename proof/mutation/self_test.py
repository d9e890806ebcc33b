"""A contract pack's declarations for `roaas selftest`: good devices, mutants, and facts about both.

The pack's plugin module names the module that declares it: ``SELFTEST = "lamp_contract.selftest"``. The default is
``selftest.py`` beside ``pack.toml``. That module has a value ``SELFTEST``. A small pack declares how its device
starts::

    LAMP = GoodDevice("lamp", lambda _: [sys.executable, str(Path(__file__).with_name("lamp.py")), "0"])
    SELFTEST = SelfTest(devices=(LAMP,))

The suite then generates mutants from the pack's descriptions. Everything else has a default. A device that needs
a program, a package or a build in Go asks for it here, and gets NotInstalledError where it is not installed.
"""

import os
import re
import shutil
import subprocess
import tempfile
import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

from conformance.commandline.guard import is_of_memory
from conformance.contract.locating import ContractError, module_of
from conformance.contract.pack import Contract
from proof.mutation.messages import Change
from proof.mutation.table import Mutant

MODULE = "selftest.py"
# Go compiles its standard library once, on a slow machine in more than a minute.
_BUILD_S = 300.0


@dataclass(frozen=True)
class Start:
    """How to start one device.

    Attributes:
        domain_id: its ROS domain, if it uses ROS.
        seed: seed of everything random in it.
    """

    domain_id: int = 0
    seed: int = 0


@dataclass(frozen=True)
class GoodDevice:
    """A conforming device, which runs as a process.

    Attributes:
        name: its name, as in ``--target``.
        command: returns the command that starts it on free ports. The process prints ``ready rest=URL`` or
            ``ready rest=URL soap=URL`` (an origin and a WSDL) when it is ready, and ends at SIGTERM. Raises
            NotInstalledError if something that the device needs is not installed.
        statement: the file of its statement; None if nothing is declared.
        on_ros: whether it uses ROS, so that a probe can watch it.
        shows_effects: whether clients can read from the device which commands reached it.
        once: whether it is certified once, as a variant, instead of once for each seed.
    """

    name: str
    command: Callable[[Start], list[str]]
    statement: Path | None = None
    on_ros: bool = False
    shows_effects: bool = True
    once: bool = False


@dataclass(frozen=True)
class HarmlessChange:
    """A change between clients and a good device that keeps it conforming.

    Attributes:
        name: its name.
        says: what it changes, in a few words.
        make: returns a new instance of the change, for one run.
    """

    name: str
    says: str
    make: Callable[[], Change]


@dataclass(frozen=True)
class OpenPlace:
    """Generated changes that break no clause of the contract, so that they are not mutants.

    Attributes:
        pattern: a regular expression that matches the whole name of such a change
            (``operator:operation:place[:form]``).
        reason: why they break no clause.
        side: "rest" or "soap"; empty means both.
        methods: HTTP methods; empty means all.
    """

    pattern: str
    reason: str
    side: str = ""
    methods: tuple[str, ...] = ()

    def covers(self, name: str, side: str, method: str) -> bool:
        """Return whether a change of this name, side and method breaks no clause."""
        there = self.side in {"", side} and (not self.methods or method in self.methods)
        return there and re.fullmatch(self.pattern, name) is not None


def only_publishers(soap: str) -> tuple[str, str]:
    """Return the WSDLs of a device with only one SOAP service, the publishers: its URL and an empty text."""
    return soap, ""


@dataclass(frozen=True)
class SelfTest:
    """Everything that a pack declares for its self-test.

    Attributes:
        devices: good devices; the first one is the default of ``--target``.
        mutants: hand-written mutants.
        short: names of the mutants that ``--short`` judges, the slowest first; empty means the first fifteen.
        quick: the device that starts fastest, used for generated mutants and variants; empty means the first one.
        device_for: the device for a variant or behind a web server, by the name of that, if not ``quick``.
        wsdls: returns the WSDLs of publishers and subscribers from the URL that a device prints as ``soap=``.
        variants: harmless changes of this pack, beside those of the suite.
        classes: the classes that can detect a change in an operation, its own class first, by a regular expression of
            the operation's name; the first match counts. Default: all classes of the pack that judge its interface.
        clauses: the clause of the contract that an operation keeps, by a regular expression of the operation's name;
            the first match counts.
        open_places: generated changes that break no clause.
    """

    devices: tuple[GoodDevice, ...] = ()
    mutants: tuple[Mutant, ...] = ()
    short: tuple[str, ...] = ()
    quick: str = ""
    device_for: Mapping[str, str] = field(default_factory=dict)
    wsdls: Callable[[str], tuple[str, str]] = only_publishers
    variants: tuple[HarmlessChange, ...] = ()
    classes: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    clauses: Mapping[str, str] = field(default_factory=dict)
    open_places: tuple[OpenPlace, ...] = ()

    def device(self, name: str) -> GoodDevice:
        """Return the device with a name.

        Raises:
            KeyError: there is no such device.
        """
        return {device.name: device for device in self.devices}[name]

    def device_in(self, variant: str) -> GoodDevice:
        """Return the device for a variant or web server, by its name; by default the quick one.

        Raises:
            KeyError: the pack names a device that it does not have.
        """
        name = self.device_for.get(variant) or self.quick
        return self.device(name) if name or not self.devices else self.devices[0]

    def classes_of(self, operation: str) -> tuple[str, ...]:
        """Return the pack's classes that can detect a change in an operation; empty if not declared."""
        return next((found for pattern, found in self.classes.items() if re.fullmatch(pattern, operation)), ())

    def clause_of(self, operation: str) -> str:
        """Return the clause of the contract that an operation keeps; empty if not declared."""
        return next((found for pattern, found in self.clauses.items() if re.fullmatch(pattern, operation)), "")


@cache
def self_test_of(contract: Contract) -> SelfTest:
    """Return a pack's declarations for its self-test, or the defaults.

    Raises:
        ContractError: its module cannot be imported, or has no ``SELFTEST``.
    """
    named: str = getattr(contract.plugin, "SELFTEST", "")
    in_ = getattr(contract.plugin, "__package__", None) or ""
    if in_.startswith("conformance.packs."):  # the proof of a pack of the suite is in this room, under the pack's name
        named = f"proof.{in_.rpartition('.')[2]}.{Path(MODULE).stem}"
    path = contract.directory / MODULE
    if not named and not path.is_file():
        return SelfTest()
    try:
        found = getattr(import_module(named) if named else module_of(path), "SELFTEST", None)
    except (ImportError, OSError, SyntaxError) as error:
        if is_of_memory(error):
            raise MemoryError from error
        raise ContractError(f"{contract.directory}: {named or MODULE} cannot be imported: {error}") from error
    if not isinstance(found, SelfTest):
        raise ContractError(f"{contract.directory}: {named or MODULE} has no SELFTEST, a SelfTest of {__name__}")
    return replace(found, mutants=tuple(_with_present_ids(mutant, contract.ids_by_alias) for mutant in found.mutants))


def _with_present_ids(mutant: Mutant, renamed: Mapping[str, str]) -> Mutant:
    """Return a mutant with the present ids of the requirements that must kill it."""
    return replace(mutant, catches=tuple(dict.fromkeys(renamed.get(id_, id_) for id_ in mutant.catches)))


class NotInstalledError(Exception):
    """Raised when a program or package is not installed; the message says how to install it."""


def program(name: str, package: str) -> str:
    """Return the path of a program, from PATH or /usr/sbin (which Debian leaves out of a user's PATH).

    Raises:
        NotInstalledError: it is not installed.
    """
    found = shutil.which(name, path=os.pathsep.join([os.environ.get("PATH", os.defpath), "/usr/sbin", "/sbin"]))
    if found is None:
        raise NotInstalledError(f"not installed: apt install {package}")
    return found


def check_installed(*modules: str) -> None:
    """Check that Python packages are installed.

    Raises:
        NotInstalledError: one is not.
    """
    lacking = [name for name in modules if find_spec(name) is None]
    if lacking:
        raise NotInstalledError(f"not installed: pip install {' '.join(lacking)}")


def build(*sources: Path) -> Path:
    """Build a Go program, unless the built file is newer than all source files, and return its path.

    Raises:
        NotInstalledError: Go is not installed, or the build fails.
    """
    go = program("go", "golang-go")
    checksum = zlib.crc32(b"".join(source.read_bytes() for source in sources))
    binary = Path(tempfile.gettempdir(), f"roaas-go-{os.getuid()}", f"{sources[0].stem}-{checksum:08x}")
    if binary.exists():
        return binary
    binary.parent.mkdir(mode=0o700, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=binary.parent) as folder:
        environment = {**os.environ, "GOFLAGS": "-mod=mod", "GOPROXY": "off"}
        command = [go, "build", "-o", f"{folder}/built", *map(str, sources)]
        done = subprocess.run(  # noqa: S603 - the program found above, on files of ours
            command, capture_output=True, check=False, env=environment, timeout=_BUILD_S
        )
        if done.returncode:
            raise NotInstalledError(f"go build fails: {done.stderr.decode(errors='replace')[-200:]}")
        # Another run may have built it first: either result will do.
        Path(folder, "built").replace(binary)
    return binary
