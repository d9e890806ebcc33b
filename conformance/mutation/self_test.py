"""What a contract pack says for its self-test: good devices, mutants, and what only the pack knows of them.

The pack's plugin module names the module with it: ``SELFTEST = "lamp_contract.selftest"``. Without that, it is
``selftest.py`` beside ``pack.toml``. The module has a value ``SELFTEST``. A small pack says how its device starts::

    LAMP = GoodDevice("lamp", lambda _: [sys.executable, str(Path(__file__).with_name("lamp.py")), "0"])
    SELFTEST = SelfTest(devices=(LAMP,))

The suite then makes mutants by rule from the pack's descriptions. Everything else has a default.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache
from importlib import import_module
from pathlib import Path

from conformance.contract.locating import ContractError, module_of
from conformance.contract.pack import Contract
from conformance.mutation.messages import Change
from conformance.mutation.mutant import Mutant

MODULE = "selftest.py"


@dataclass(frozen=True)
class Start:
    """How one device is to start.

    Attributes:
        domain_id: its ROS domain, for a device on ROS.
        seed: of everything random in it.
    """

    domain_id: int = 0
    seed: int = 0


@dataclass(frozen=True)
class GoodDevice:
    """A conforming device, which runs in a process of its own.

    Attributes:
        name: its name, as ``--target`` takes it.
        command: returns the command that starts it on free ports. When it is ready, it prints ``ready rest=URL`` or
            ``ready rest=URL soap=URL``, the URLs being an origin and a WSDL. It ends at SIGTERM. Raises
            NotInstalledError where something that it needs is not installed.
        statement: the file of its statement; None: nothing is declared.
        on_ros: whether it needs ROS, so that a probe can watch it.
        shows_effects: whether clients can read from the device itself what reached it.
        once: whether it is judged once, as a variant, in place of once for each seed.
    """

    name: str
    command: Callable[[Start], list[str]]
    statement: Path | None = None
    on_ros: bool = False
    shows_effects: bool = True
    once: bool = False


@dataclass(frozen=True)
class HarmlessChange:
    """A change between clients and a good device that leaves it conforming.

    Attributes:
        name: its name; says: what it is, in a few words.
        make: makes the change for one run.
    """

    name: str
    says: str
    make: Callable[[], Change]


@dataclass(frozen=True)
class OpenPlace:
    """Changes by rule that break no clause, so that they are no mutants.

    Attributes:
        pattern: of the changes' names (``operator:operation:place[:form]``), a regular expression that matches all.
        reason: why they break no clause.
        side: "rest" or "soap"; empty: both.
        methods: of HTTP; empty: all.
    """

    pattern: str
    reason: str
    side: str = ""
    methods: tuple[str, ...] = ()

    def covers(self, name: str, side: str, method: str) -> bool:
        """Return whether a change of this name, to an operation of this side and method, breaks no clause."""
        there = self.side in {"", side} and (not self.methods or method in self.methods)
        return there and re.fullmatch(self.pattern, name) is not None


def only_publishers(soap: str) -> tuple[str, str]:
    """Return the WSDLs of a device with one SOAP service: that of the publishers, and none."""
    return soap, ""


@dataclass(frozen=True)
class SelfTest:
    """What a pack's self-test needs.

    Attributes:
        devices: good devices; the first one is behind mutants where ``--target`` names no other.
        mutants: mutants made by hand.
        short: names of the mutants that ``--short`` judges, the slowest first; empty: the first fifteen.
        quick: the device that starts fastest: it is behind mutants by rule, and in variants; empty: the first one.
        device_for: the device in a variant or behind a web server, by the variant's or server's name, if not ``quick``.
        wsdls: returns the WSDLs of publishers and subscribers, from the URL that a device prints as ``soap=``.
        variants: circumstances in which a good device stays one, beside those that the suite knows.
        classes: classes of the pack that can see a change in an operation, its own class first, by a regular expression
            of the operation's name; the first that matches counts. Without one: all of the pack that judge its
            interface.
        open_places: what the contract leaves open.
    """

    devices: tuple[GoodDevice, ...] = ()
    mutants: tuple[Mutant, ...] = ()
    short: tuple[str, ...] = ()
    quick: str = ""
    device_for: Mapping[str, str] = field(default_factory=dict)
    wsdls: Callable[[str], tuple[str, str]] = only_publishers
    variants: tuple[HarmlessChange, ...] = ()
    classes: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    open_places: tuple[OpenPlace, ...] = ()

    def device(self, name: str) -> GoodDevice:
        """Return the device of a name.

        Raises:
            KeyError: there is none.
        """
        return {device.name: device for device in self.devices}[name]

    def device_in(self, variant: str) -> GoodDevice:
        """Return the device that is judged in a variant, or behind a web server; of any other name, the quick one.

        Raises:
            KeyError: the pack names no device.
        """
        name = self.device_for.get(variant) or self.quick
        return self.device(name) if name or not self.devices else self.devices[0]

    def classes_of(self, operation: str) -> tuple[str, ...]:
        """Return the pack's classes that can see a change in an operation; empty: the pack does not say."""
        return next((found for pattern, found in self.classes.items() if re.fullmatch(pattern, operation)), ())


@cache
def self_test_of(contract: Contract) -> SelfTest:
    """Return what a pack says for its self-test; of a pack that says nothing, the defaults.

    Raises:
        ContractError: its module cannot be imported, or has no ``SELFTEST``.
    """
    named: str = getattr(contract.plugin, "SELFTEST", "")
    path = contract.directory / MODULE
    if not named and not path.is_file():
        return SelfTest()
    try:
        found = getattr(import_module(named) if named else module_of(path), "SELFTEST", None)
    except (ImportError, OSError, SyntaxError) as error:
        raise ContractError(f"{contract.directory}: {named or MODULE} cannot be imported: {error}") from error
    if not isinstance(found, SelfTest):
        raise ContractError(f"{contract.directory}: {named or MODULE} has no SELFTEST, a SelfTest of {__name__}")
    return found
