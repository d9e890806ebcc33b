"""Judge every GET of the goal in a run: no response may mix two goals, and an unchanged goal must stay the same.

A mixture has, for instance, the new goal's id with the old goal's stamp or pose. A client that waits for its goal sees
the right one in the end, so only the first responses after a change show the fault.
"""

from collections import Counter, deque
from typing import Any, Final

from conformance.api.rest.interface import RestInterface
from conformance.documents.representation import UnreadableError, flattened, projected, read
from conformance.packs.table1.robot.message_shapes import GOAL, read_as
from conformance.packs.table1.robot.robot import GOAL_PATH
from conformance.transport.exchange import Exchange, Listener, Request, Response

# A value that is the old goal's after so many changes, and after most of those that change it, is so by rule.
_OFTEN: Final = 3
_MOST: Final = 0.5
# By what the first of these readings shows, and the second, a change is judged; by further ones, what lives.
_AT_FIRST: Final = 2
# A goal is shown one way, another way, and the first way again.
_SHOWN: Final = 3
# What a goal's own progress changes.
_PROGRESS: Final = "status."
Shown = dict[str, Any]


class GoalObserver(Listener):
    """Listens to all exchanges of one run and judges the goals in them.

    Args:
        api: the robot's REST interface.
    """

    def __init__(self, api: RestInterface) -> None:
        self._judge = api.run.judge
        self._url = api.client.url(GOAL_PATH)
        # What was shown last before something was asked of the goal, and since then.
        self._before: Shown | None = None
        self._since: list[Shown] = []
        self._first: Exchange | None = None
        self._newest: deque[tuple[Shown, Exchange]] = deque(maxlen=_SHOWN)
        # How often a value has changed with the goal, and was the old one first; what changes by itself.
        self._changed: Counter[str] = Counter()
        self._stale: Counter[str] = Counter()
        self._living: set[str] = set()

    def answered(self, exchange: Exchange) -> None:
        """Take one exchange of the run; only those about the goal count."""
        if exchange.request.url != self._url:
            return
        if exchange.request.method == "PUT" and exchange.request.raw is None:
            self._judge_response(exchange)
        if exchange.request.method != "GET":
            self._before = self._since[-1] if self._since else self._before
            self._since = []
            self._newest.clear()
            return
        if exchange.response.media_type != "application/json":
            return
        value, problem = read_as(exchange.response, GOAL)
        if problem:
            return
        shown = flattened(projected(value, GOAL.schema))
        self._newest.append((shown, exchange))
        self._compare()
        if self._before == shown and not self._since:
            return  # a robot may take a while to show another goal
        self._since = [*self._since[-2:], shown]
        if len(self._since) == 1:
            self._first = exchange
        elif len(self._since) > _AT_FIRST:
            one, other = self._since[-2:]
            self._living |= {_whole(place) for place, value in one.items() if other.get(place) != value}
        elif self._before is not None and self._first is not None:
            self._look(self._before, self._since[0], self._since[1], self._first)

    def _judge_response(self, exchange: Exchange) -> None:
        """Judge that the response to a PUT has the id of the goal in the request, where it has any."""
        sent, shown = _id_of(exchange.request), _id_of(exchange.response)
        if exchange.response.ok and sent and shown:
            self._judge.check(
                "rest-resources/goal-id",
                shown == sent,
                exchange,
                f"the goal's id {sent!r} in the response to its PUT",
                found=f"{shown!r}",
                cause="another id in the response",
            )

    def _compare(self) -> None:
        """Judge a GET by the GETs before and after it, if those agree and nothing changed the goal in between."""
        if len(self._newest) < _SHOWN:
            return
        (first, _), (between, exchange), (last, _) = self._newest
        if first != last:
            return
        odd = [place for place, value in first.items() if between.get(place) != value]
        odd = [place for place in odd if not place.startswith(_PROGRESS)]
        self._judge.check(
            "rest-resources/goal-get",
            not odd,
            exchange,
            "the goal as it is shown just before and just after",
            found=f"{odd[0]} is {between.get(odd[0])!r} for {first[odd[0]]!r}" if odd else "",
            cause=f"{odd[0]} now and then" if odd else "",
        )

    def _look(self, before: Shown, first: Shown, later: Shown, exchange: Exchange) -> None:
        """Judge the first goal shown after a change: each field is the old goal's or the new one's, not mixed."""
        others = {place for place, value in later.items() if before.get(place) != value}
        stale = {place for place in others if first.get(place) == before.get(place)}
        self._changed.update(others)
        # A goal that is not shown yet is no mixture.
        self._stale.update(stale if stale != others else ())
        for place in sorted(stale):
            often = self._stale[place] >= max(_OFTEN, _MOST * self._changed[place])
            self._judge.check(
                "rest-resources/goal-get",
                not often or _whole(place) in self._living,
                exchange,
                "one goal, and no part of the one before it",
                found=f"{place} is that of the goal before, in what is shown first of {self._stale[place]} goals",
                cause=f"{place} of the goal before",
            )


def _id_of(message: Request | Response) -> str:
    """Return the id of a goal; empty where it is missing or cannot be read."""
    try:
        found = flattened(read(message.media_type, message.body, GOAL.schema)).get("goal_id.id")
    except UnreadableError:
        return ""
    return found if isinstance(found, str) else ""


def _whole(place: str) -> str:
    """Return the field's place, or that of the whole stamp for a part of a stamp."""
    parent = place.rpartition(".")[0]
    return parent if parent.endswith("stamp") else place
