"""The hooks through which a contract pack describes its device to the generic suite; the defaults move nothing."""

from collections.abc import Iterable, Iterator, Mapping
from types import MappingProxyType
from typing import Any

from conformance.contract.pack import Contract
from conformance.documents.wsdl import SoapOperation
from conformance.documents.xml import Node
from conformance.transport.exchange import Listener
from conformance.verdict.evidence import Checker
from conformance.verdict.run import Run

# Stands for RestInterface, SoapService and Question, whose modules import this module.
Rest = Any
Soap = Any
Question = Any

_SETTLE_S = 2.0


class Device:
    """The model of one device in one run. A pack's plugin module subclasses it as ``Device``.

    Attributes:
        run: the data of the run.
    """

    #: Whether the suite sends this device only the valid moves of the pack, and generates none.
    is_known = False
    #: pytest plugins (names of modules) with the fixtures of the pack's checks.
    fixtures: tuple[str, ...] = ()
    #: SOAP operations that may refuse a valid message at any time, because the thing that they read may have ended.
    comes_and_goes: frozenset[str] = frozenset()

    #: What `--init` writes below the generic tables of a first statement.
    statement_template: str = ""
    #: Why `--init` writes it as a comment although its interfaces answer, by class.
    doubts: Mapping[str, str] = MappingProxyType({})

    def __init__(self, run: Run) -> None:
        self.run = run

    @property
    def settle_s(self) -> float:
        """Time within which a command takes effect, s."""
        return _SETTLE_S

    @property
    def hold_s(self) -> float | None:
        """Time for which a command lasts unless it is repeated, s; None means for ever."""
        return None

    def fit(self, api: Rest, operation_id: str, value: Any) -> Any:  # noqa: ARG002 - for packs
        """Return a valid value for an operation (body, or parameters by name) that is also sensible for the device."""
        return value

    def mark(self, operation_id: str, value: Any) -> Any:  # noqa: ARG002 - for packs
        """Return a valid value with a text that identifies the suite, if the operation has room for one."""
        return value

    def answers_alike(self, template: str) -> bool:  # noqa: ARG002 - for packs
        """Return whether equal requests to a resource get equal responses."""
        return False

    def is_near(self, place: str, shown: Any, wanted: Any) -> bool:  # noqa: ARG002 - for packs
        """Return whether a value that GET returns equals the one that was sent, within the device's tolerance."""
        return bool(shown == wanted)

    def messages(self, service: Soap, operation: SoapOperation) -> Iterator[Node]:  # noqa: ARG002 - for packs
        """Yield SOAP messages that the device accepts, the most promising first; empty if the default one suffices."""
        return iter(())

    def questions(self, api: Rest) -> Iterable[Question]:  # noqa: ARG002 - for packs
        """Return requests whose responses only the pack can tell apart."""
        return ()

    def listeners(self, api: Rest) -> Iterable[Listener]:  # noqa: ARG002 - for packs
        """Return the listeners of the pack, which get every exchange of the run."""
        return ()

    def checkers(self, api: Rest | None, services: Iterable[Soap]) -> Iterable[Checker]:  # noqa: ARG002 - for packs
        """Return the checkers of the pack's contract, which judge every exchange of the run."""
        return ()

    def halt(self, api: Rest) -> None:
        """Send the device a stop command, without waiting until it stands still."""

    def bring_to_rest(self, api: Rest) -> str:  # noqa: ARG002 - for packs
        """Stop the device and wait until it stands still; return why it does not, or an empty text."""
        return ""

    def leave_at_rest(self, api: Rest) -> str:  # noqa: ARG002 - for packs
        """Stop the device at the end of a run, within seconds; return why it may still move, or an empty text."""
        return ""


def device_of(run: Run) -> Device:
    """Return the device of a run, as its contract pack knows it."""
    plugin = run.contract.plugin
    found: Device = getattr(plugin, "Device", Device)(run)
    return found


def fixtures_of(contract: Contract) -> tuple[str, ...]:
    """Return the pytest plugins of a pack."""
    found: tuple[str, ...] = getattr(contract.plugin, "Device", Device).fixtures
    return found
