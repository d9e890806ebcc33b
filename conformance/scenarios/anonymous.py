"""Reads without credentials, of operations for which the description requires some."""

from conformance.api.rest.applicable import allowed
from conformance.api.rest.inputs import usual_inputs, written
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.values import Values
from conformance.documents.openapi import operations_of
from conformance.scenarios.scenario import NotPossibleError, scenario
from conformance.scenarios.stage import Leaves, Need, Stage
from conformance.transport.exchange import Exchange, NoAnswerError


@scenario(needs={Need.REST}, leaves=Leaves.UNTOUCHED, stage=Stage.INPUT)
def anonymous_reads(api: RestInterface, values: Values) -> tuple[Exchange, ...]:
    """Send each read for which the description requires credentials, without any."""
    closed = [
        item
        for item in operations_of(api.run.contract)
        # An alternative without a scheme means that credentials are optional (OpenAPI 3.1, 4.8.30).
        if item.method == "GET" and item.security and all(item.security) and allowed(api, item)
    ]
    if not closed:
        raise NotPossibleError("no read that may be called requires credentials by the description")
    found = []
    for operation in closed:
        if operation.label in api.streams:
            continue
        request = written(operation, usual_inputs(operation, values)[0])
        try:
            found.append(api.client.send("GET", request.target, headers=request.headers, authorized=False, fresh=True))
        except NoAnswerError:
            continue  # the survey tells what gets no response
    return tuple(found)
