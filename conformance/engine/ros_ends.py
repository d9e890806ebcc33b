"""The part of result.json on a ROS map: the comparison of each operation, and the first difference."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from typing import Any, Final

from conformance.contract.described import ROS
from conformance.statement.motion_calls import NAME, names_operation
from conformance.statement.ros_map import RosMap, followers
from conformance.transport.exchange import Attempt, Request
from conformance.verdict.finding import Finding

# By kind of operation: the words for its ROS side in messages.
_DOES: Final = {
    "topic": "reads", "publishes": "publishes on", "service": "calls", "action": "sends goals to", "lists": "lists",
}  # fmt: skip
#: Requirements that expect the web API's value, and observe ROS's.
_SEEN_ON_ROS: Final = frozenset(
    f"{ROS}/{name}"
    for name in (
        "write-exact", "once", "order", "refused-nothing", "service-once", "goal-once", "goal-cancel", "subscriptions",
    )
)  # fmt: skip


class RosEnds:
    """Counts the cases of each operation of a ROS map.

    Args:
        ros: the map.
        concerned: returns the labels of the description's operations that a request concerns.
    """

    def __init__(self, ros: RosMap, concerned: Callable[[Request], Iterable[str]]) -> None:
        self._ros, self._concerned = ros, concerned
        self._compared: Counter[str] = Counter()

    def count(self, requirement: str, exchange: Attempt | None) -> None:
        """Count a case."""
        if exchange is not None and requirement.startswith(f"{ROS}/"):
            self._compared.update(self._calls(exchange.request))

    def _calls(self, request: Request) -> list[str]:
        """Return the map's operations that a request belongs to; of several with one template, the named one."""
        path = request.target.partition("?")[0]
        labels = [*self._concerned(request), f"{request.method} {path}"]
        found: dict[str, str] = {}
        for call, one in self._ros.operations.items():
            found |= {
                each: call for each in (call, *followers(one)) if any(names_operation(each, label) for label in labels)
            }
        exact = [call for call in found if call == f"{request.method} {request.target}"]
        named = [found[each] for each in found if not NAME.search(each) and path.endswith(each.partition(" ")[2])]
        return list(dict.fromkeys(exact or named or found.values()))

    def document(self, findings: Iterable[Finding]) -> Iterator[dict[str, Any]]:
        """Yield a row for each operation: its end on ROS, how many cases were judged, and the first finding."""
        of_ros = [one for one in findings if one.requirement.startswith(f"{ROS}/") and one.exchange]
        calls_of = {one.number: self._calls(one.exchange.request) for one in of_ros if one.exchange}
        for call, one in self._ros.operations.items():
            key = next(key for key in _DOES if hasattr(one, key))
            mine = sorted((each for each in of_ros if call in calls_of[each.number]), key=lambda each: each.number)
            row = {"operation": call, "does": _DOES[key], "name": getattr(one, key), "compared": self._compared[call]}
            row |= {"type": one.type} if key != "lists" else {}
            if mine:
                web, ros = mine[0].observed, f"expected: {mine[0].expected}"
                if mine[0].requirement in _SEEN_ON_ROS:
                    # The response came from the web API, the effect was seen on ROS.
                    response, _, seen = web.partition(": ")
                    web, ros = f"{ros}; {response}" if seen else ros, seen or web
                numbers = [finding.number for finding in mine]
                row |= {"findings": numbers, "differs": {"web": web, "ros": ros, "requirement": mine[0].requirement}}
            yield row
