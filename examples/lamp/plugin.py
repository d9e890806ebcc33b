"""The lamp as the generic suite sees it: an observer that judges the response to every PUT of a run."""

import json
from collections.abc import Iterable

from conformance.api.device import Device as AnyDevice
from conformance.api.rest.interface import RestInterface
from conformance.transport.exchange import Exchange, Listener


class EveryPut(Listener):
    """Judges that the response to a PUT has the target of this request, whichever check sends it."""

    def __init__(self, api: RestInterface) -> None:
        self._judge, self._url = api.run.judge, api.client.url("/lamp")

    def answered(self, exchange: Exchange) -> None:
        """Judge one exchange if it is a PUT that the lamp accepted."""
        request, response = exchange.request, exchange.response
        if request.method != "PUT" or request.url != self._url or request.raw or response.status != 200:
            return
        try:
            sent, target = json.loads(request.body)["brightness"], json.loads(response.body)["target"]
        except (ValueError, TypeError, KeyError):
            return  # http/declared-body judges that
        self._judge.check(
            "lamp/target", target == sent, exchange, f"the target {sent} that was sent", found=f"{target}"
        )


class Device(AnyDevice):
    """A lamp."""

    def observers(self, api: RestInterface) -> Iterable[Listener]:
        """Return the listener that judges every PUT."""
        return (EveryPut(api),)
