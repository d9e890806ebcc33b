"""Stop a device that only its description tells of, at the end of a run."""

import math
import time
from contextlib import suppress
from typing import Final

from conformance.api.rest.inputs import usual_inputs, written
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.values import Values
from conformance.documents.openapi import operations_of
from conformance.transport.exchange import NoAnswerError, NotPermittedError

_DEADLINE_S: Final = 2.0
_LONGEST_S: Final = 5.0


def send_stops(api: RestInterface) -> None:
    """Stop the device by its motion map, or by what the description marks (x-roaas-stop), if it may have been moved.

    Each operation is sent with the values that the run knows for it, such as the ids of the newest moves. Takes at most
    a few seconds; never raises.
    """
    with suppress(NoAnswerError, NotPermittedError):
        if api.stop_device is not None:
            api.stop_device()
    if not api.call_rules.allow or math.isinf(api.client.connection.acted_at):
        return
    until = time.monotonic() + _LONGEST_S
    for operation in operations_of(api.run.contract):
        for inputs in usual_inputs(operation, api.values or Values()) if operation.stop else ():
            if time.monotonic() > until:
                return
            request = written(operation, inputs)
            fields = [*request.headers, *([("Content-Type", request.content_type)] if request.content_type else [])]
            try:
                api.client.send(
                    request.method, request.target, headers=fields, body=request.body, timeout_s=_DEADLINE_S
                )
            except (NoAnswerError, NotPermittedError):
                continue
