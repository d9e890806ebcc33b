"""Judge every GET of the goal in a run: no response may mix two goals, and an unchanged goal must stay the same.

A mixture has, for instance, the new goal's id with the old goal's stamp or pose. A client that waits for its goal sees
the right one in the end, so only the first responses after a change show the fault.
"""

from collections import Counter, deque
from collections.abc import Callable, Iterator
from typing import Any, Final

from conformance.documents.representation import UnreadableError, flattened, projected, read
from conformance.packs.table1.robot.goal import difference
from conformance.packs.table1.robot.message_shapes import GOAL, GOAL_POSE, read_as
from conformance.packs.table1.robot.robot import GOAL_PATH
from conformance.transport.exchange import Attempt, Exchange, Request, Response
from conformance.verdict.evidence import Case, case

# A value counts as stale if it was the old goal's after _OFTEN changes, and after the share _MOST of all changes.
_OFTEN: Final = 3
_MOST: Final = 0.5
# The first readings after a change judge the change; later ones judge what remains of the old goal.
_AT_FIRST: Final = 2
# Readings that show a swap of goals: one value, another, and the first again.
_SHOWN: Final = 3
_PROGRESS: Final = "status."  # prefix of the members that change as a goal advances
Shown = dict[str, Any]


class Goals:
    """Judges the goals in all exchanges of one run."""

    def __init__(self, url: Callable[[str], str]) -> None:
        self._url = url(GOAL_PATH)
        # The goal as last read before a command.
        self._before: Shown | None = None
        self._since: list[Shown] = []  # the goal as read since the command
        self._first: Exchange | None = None
        self._newest: deque[tuple[Shown, Exchange]] = deque(maxlen=_SHOWN)
        # How often a member changed with the goal, and how often it first had the old value.
        self._changed: Counter[str] = Counter()
        self._stale: Counter[str] = Counter()
        self._living: set[str] = set()  # members that change by themselves

    def __call__(self, attempt: Attempt) -> Iterator[Case]:
        """Process one exchange of the run, if it is about the goal."""
        if not isinstance(attempt, Exchange) or attempt.request.url != self._url:
            return
        exchange = attempt
        if exchange.request.method == "PUT" and exchange.request.raw is None:
            yield from self._judge_response(exchange)
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
        yield from self._compare()
        if self._before == shown and not self._since:
            return  # a robot may take a while to show another goal
        self._since = [*self._since[-2:], shown]
        if len(self._since) == 1:
            self._first = exchange
        elif len(self._since) > _AT_FIRST:
            one, other = self._since[-2:]
            self._living |= {_whole(place) for place, value in one.items() if other.get(place) != value}
        elif self._before is not None and self._first is not None:
            yield from self._look(self._before, self._since[0], self._since[1], self._first)

    def _judge_response(self, exchange: Exchange) -> Iterator[Case]:
        """Judge that the response to a PUT repeats the request's goal, as far as it contains one.

        A robot may have transformed the pose to another frame.
        """
        sent, shown = _goal_in(exchange.request), _goal_in(exchange.response)
        if not exchange.response.ok or not shown:
            return
        id_, other = (item.get("goal_id", {}).get("id") for item in (sent, shown))
        if id_ and other:
            yield case(
                "rest-resources/goal-id",
                other == id_,
                exchange,
                f"the goal's id {id_!r} in the response to its PUT",
                found=f"{other!r}",
                cause="another id in the response",
            )
        target, understood = _target(sent), _target(shown)
        if target is None or understood is None or target["header"]["frame_id"] != understood["header"]["frame_id"]:
            return
        differs = difference(shown, {"goal": sent["goal"]})
        yield case(
            "rest-resources/goal-put",
            not differs,
            exchange,
            "the pose in the request, as both are in the same frame",
            found=differs,
            cause="another pose in the response",
        )

    def _compare(self) -> Iterator[Case]:
        """Judge a GET by the GETs before and after it, if those agree and nothing changed the goal in between."""
        if len(self._newest) < _SHOWN:
            return
        (first, _), (between, exchange), (last, _) = self._newest
        if first != last:
            return
        odd = [place for place, value in first.items() if between.get(place) != value]
        odd = [place for place in odd if not place.startswith(_PROGRESS)]
        yield case(
            "rest-resources/goal-get",
            not odd,
            exchange,
            "the goal as GET returned it just before and just after",
            found=f"{odd[0]} is {between.get(odd[0])!r} for {first[odd[0]]!r}" if odd else "",
            cause=f"{odd[0]} now and then" if odd else "",
        )

    def _look(self, before: Shown, first: Shown, later: Shown, exchange: Exchange) -> Iterator[Case]:
        """Judge the first goal shown after a change: each field is the old goal's or the new one's, not mixed."""
        others = {place for place, value in later.items() if before.get(place) != value}
        stale = {place for place in others if first.get(place) == before.get(place)}
        self._changed.update(others)
        # A goal that is not yet shown is not mixed with another.
        self._stale.update(stale if stale != others else ())
        for place in sorted(stale):
            often = self._stale[place] >= max(_OFTEN, _MOST * self._changed[place])
            yield case(
                "rest-resources/goal-get",
                not often or _whole(place) in self._living,
                exchange,
                "one goal, and no part of the one before it",
                found=f"the {place} of the previous goal in the first reading of {self._stale[place]} goals",
                cause=f"{place} of the goal before",
            )


def _goal_in(message: Request | Response) -> dict[str, Any]:
    """Return the goal in a message; empty where it has none that can be read."""
    try:
        found = read(message.media_type, message.body, GOAL.schema)
    except UnreadableError:
        return {}
    named = isinstance(found, dict) and isinstance(found.get("goal_id", {}), dict)
    return found if named else {}


def _target(goal: dict[str, Any]) -> Any:
    """Return the pose of a goal with its frame; None where it is not complete."""
    try:
        target = goal["goal"]["target_pose"]
        return (
            target if isinstance(target["header"]["frame_id"], str) and not GOAL_POSE.problem(target["pose"]) else None
        )
    except (KeyError, TypeError):
        return None


def _whole(place: str) -> str:
    """Return the field's place, or that of the whole stamp for a part of a stamp."""
    parent = place.rpartition(".")[0]
    return parent if parent.endswith("stamp") else place
