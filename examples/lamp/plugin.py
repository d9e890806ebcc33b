"""The lamp as the generic suite sees it: a checker that judges the response to every PUT of a run."""

import json
from collections.abc import Iterable, Iterator

from conformance.api.device import Device as AnyDevice
from conformance.api.device import Soap
from conformance.api.rest.interface import RestInterface
from conformance.transport.exchange import Attempt, Exchange
from conformance.verdict.evidence import Case, Checker, case


def every_put(attempt: Attempt) -> Iterator[Case]:
    """Judge that the response to a PUT has the target of this request, whichever check sends it."""
    request = attempt.request
    if request.method != "PUT" or not request.url.endswith("/lamp") or request.raw or not isinstance(attempt, Exchange):
        return
    try:
        sent, target = json.loads(request.body)["brightness"], json.loads(attempt.response.body)["target"]
    except (ValueError, TypeError, KeyError):
        return  # http/declared-body judges that
    if attempt.response.status == 200:
        yield case("lamp/target", target == sent, attempt, f"the target {sent} that was sent", f"{target}")


class Device(AnyDevice):
    """A lamp."""

    def checkers(
        self,
        api: RestInterface | None,  # noqa: ARG002 - the lamp needs no more than the exchange
        services: Iterable[Soap],  # noqa: ARG002 - as above
    ) -> Iterable[Checker]:
        """Return the checker of every PUT."""
        return (every_put,)
