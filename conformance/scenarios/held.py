"""Operations that states forbade in the survey: others bring a newly created thing into the right state."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Final

from conformance.api.call_rules import words_of
from conformance.api.rest.applicable import callable_operations
from conformance.api.rest.inputs import request_of, usual_inputs
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.statuses import HELD
from conformance.api.rest.things import collection_of
from conformance.api.rest.values import Values
from conformance.api.rest.variations import Kind, Variation
from conformance.checkers.changes import another_of
from conformance.documents.openapi import Operation
from conformance.scenarios.creating import created_path
from conformance.scenarios.scenario import scenario
from conformance.scenarios.stage import Leaves, Need, Stage
from conformance.scenarios.survey import Probe, Survey, Surveyor
from conformance.transport.exchange import NoAnswerError, Outgoing

_HELD = 6  # operations that are tried
_OTHERS = 6  # operations that are tried after each of these
# Operations after which a thing allows no further operation.
_FINAL: Final = frozenset({"cancel", "abort", "stop", "end", "finish", "terminate"})


@scenario(needs={Need.REST}, leaves=Leaves.UNTOUCHED, stage=Stage.READING)
def held_operations(api: RestInterface, values: Values) -> Survey:
    """Call operations that the state forbade on a new thing, after its other operations and those described."""
    callable_ = {key: one for key, one in callable_operations(api).items() if not one.motion}
    surveyor, actions = Surveyor(api, values), [one for one in callable_.values() if _acts(one)]
    is_held = {one.label: api.usual_status.get(one.label) in HELD and one.label not in api.working for one in actions}
    for operation in [one for one in actions if is_held[one.label] or another_of(one)][:_HELD]:
        api.run.limit.check()
        with api.run.limit.lift(), suppress(NoAnswerError):
            _Held(surveyor, callable_, operation, actions).call()
    return surveyor.trace


def _acts(operation: Operation) -> bool:
    """Return whether an operation acts without content, and creates nothing."""
    return operation.method == "POST" and not operation.bodies and "201" not in operation.responses


@dataclass
class _Held:
    """One operation, with the operations that may lead to its state."""

    surveyor: Surveyor
    operations: Mapping[tuple[str, str], Operation]
    operation: Operation
    actions: list[Operation]

    def __post_init__(self) -> None:
        self.item = self.operation.template.rpartition("}")[0] + "}"
        below = [
            operation
            for operation in self.actions
            if operation.template.startswith(f"{self.item}/") and operation is not self.operation
        ]
        self._endings = [operation for operation in below if words_of(operation.template[len(self.item) :]) & _FINAL]
        # Operations that the description names come before others on the same thing.
        said = words_of(self.operation.text)
        named = [
            operation for operation in self.actions if "{" not in operation.template and operation is not self.operation
        ]
        found = sorted(named, key=lambda operation: -len(said & words_of(operation.template)))
        found = [operation for operation in found if said & words_of(operation.template)]
        # Twice, because one of them may need another one before it.
        self._others = [*found, *([operation for operation in below if operation not in self._endings] * 2)][:_OTHERS]

    def call(self) -> None:
        """Call it until it is accepted, and then on another thing, where the description speaks of a second one."""
        path = self._create()
        if not path and "}" in self.operation.template:
            return
        is_done = self._call(self.operation, path).ok
        for other in self._others if not is_done else ():
            self._call(other, path)
            if is_done := self._call(self.operation, path).ok:
                break
        second = self._create() if is_done and path and another_of(self.operation) else ""
        if second:
            self._read(path)
            self._call(self.operation, second)
            self._read(path)
        for ending in self._endings:
            for text in filter(None, (second, path)):
                self._call(ending, text)

    def _create(self) -> str:
        """Create a thing for the operation; return its path, or nothing."""
        create = self.operations.get(("POST", collection_of(self.item)))
        read = self.operations.get(("GET", self.item))
        return created_path(self.surveyor, create, read) if create is not None and read is not None else ""

    def _read(self, path: str) -> None:
        read = self.operations["GET", self.item]
        inputs = usual_inputs(read, self.surveyor.values)[0]
        self.surveyor.send(read, Variation(Kind.AGAIN, "", "", inputs), Outgoing("GET", path))

    def _call(self, operation: Operation, path: str) -> Probe:
        """Call an operation, of a thing if it is one's."""
        inputs = usual_inputs(operation, self.surveyor.values)[0]
        request = request_of(operation, inputs)
        if operation.template.startswith(f"{self.item}/"):
            target = path.rstrip("/") + operation.template[len(self.item) :]
            request = Outgoing(request.method, target, request.headers, request.body)
        return self.surveyor.send(operation, Variation(Kind.AGAIN, "", "", inputs), request)
