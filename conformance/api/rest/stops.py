"""Stop a device at the end of a run, and report if it may still move. No other module sends a run's last stop.

The contract pack (``leave_at_rest``), the motion map or the description (x-roaas-stop) says how a device is stopped.
The stop is tried again and again, over new connections, for as long as a lost device is waited for: ``--wait``, 20 s by
default.
"""

import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from functools import partial
from http import HTTPStatus
from typing import Any, Final

from conformance.api.call_rules import words_of
from conformance.api.rest.applicable import allows
from conformance.api.rest.inputs import Inputs, request_of, usual_inputs
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.statuses import REFUSALS
from conformance.api.rest.values import Values
from conformance.documents.json_text import read_json
from conformance.documents.openapi import Operation, is_json, operations_of
from conformance.documents.representation import flattened
from conformance.transport.client import HttpClient, is_drafting
from conformance.transport.exchange import Exchange, Listener, NoAnswerError, NotPermittedError
from conformance.transport.pace import Hangs
from conformance.transport.passage import Heard

#: First words of the note on a device that may still move.
UNDELIVERED: Final = "the stop could not be delivered; the robot may still move"
# Pause between two tries, s.
_AGAIN_S: Final = 0.3
_DEADLINE_S: Final = 2.0  # deadline of a stop request, s
_ANSWERS: Final = 4  # a slow device gets this many of its usual response times instead
# Longest time for one round of the stops that the description marks, s.
_LONGEST_S: Final = 5.0
_READS: Final = 8  # most operations that are read to see whether the device moves
_MOVING: Final = frozenset({"moving", "driving"})  # names of members that show whether the device moves
_PLACES: Final = frozenset(
    {
        "position",
        "pose",
        "x",
        "y",
        "z",
        "yaw",
        "theta",
        "heading",
        "angle",
        "angles",
        "odometer",
        "distance",
        "travelled",
    }
)
_Way = Callable[[], str]
# Statuses of a GET of the stopped thing after it has ended.
_OVER: Final = frozenset({HTTPStatus.NOT_FOUND, HTTPStatus.GONE})


def stop_device(api: RestInterface, tell: Callable[[str], None] = lambda _: None) -> str:
    """Stop the device if the run may have moved it; return why it may still move, or an empty text.

    ``run.stop_undelivered`` says the same, from before the first request on: a run that ends meanwhile has it too.
    Takes a few seconds more than the stop is tried; raises no exception but KeyboardInterrupt.

    Args:
        api: the device's REST interface.
        tell: reports that the stop is tried again.
    """
    run = api.run
    if not (run.allow_motion or api.call_rules.allow):
        return ""
    run.stop_undelivered = f"{UNDELIVERED}: the run ended before it was seen to stop"
    until = time.monotonic() + run.tries_stop_s
    open_ = stop_once(api)
    # A signal from here on leaves the stop to the guard process, which goes on.
    signals = run.signals
    if open_:
        why = "; ".join(open_.values())
        tell(f"the device was not stopped: {why}. The stop is tried for {run.tries_stop_s:g} s; Ctrl-C waits no longer")
    while open_ and time.monotonic() < until and run.signals == signals:
        time.sleep(_AGAIN_S)
        with _unheard(api.client) as refusals:
            open_ = _still_open(open_)
            if open_ and refusals.seen:
                # The token of the login may have expired, or the device has forgotten it.
                with suppress(Exception):
                    api.client.connection.log_in_again()
    run.stop_undelivered = f"{UNDELIVERED}: {'; '.join(open_.values())}" if open_ else ""
    return run.stop_undelivered


def stop_once(api: RestInterface) -> dict[_Way, str]:
    """Stop the device by each way that it has; return those that did not stop it, with the reasons."""
    by_map = api.stop_device or (lambda: "")
    return _still_open([lambda: api.device.leave_at_rest(api), by_map, partial(_stop_as_marked, api)])


def _still_open(ways: Iterable[_Way]) -> dict[_Way, str]:
    """Stop the device by each way; return those that did not, with the reasons."""
    found = {}
    for way in ways:
        try:
            problem = way()
        except Exception as error:  # noqa: BLE001 - whatever breaks, the device is stopped by the other ways, and again
            problem = str(error) or type(error).__name__
        if problem:
            found[way] = problem
    return found


class _Refusals(Listener):
    """Notices that the device refuses the run's credentials."""

    seen = False

    def on_response(self, exchange: Exchange) -> None:
        """Look at the status of a response."""
        self.seen = self.seen or exchange.response.status in REFUSALS


@contextmanager
def _unheard(client: HttpClient) -> Iterator[_Refusals]:
    """Give the connection the settings of a stop: new, not judged or counted, and not delayed by earlier hangs."""
    connection = client.connection
    deadline_s = max(_DEADLINE_S, _ANSWERS * connection.pace.usual_s)
    changed = {
        "listeners": [refusals := _Refusals()],
        "heard": Heard.NEVER,
        "recent": deque(maxlen=1),
        "is_away": lambda _exchange: False,
        "request_rate": None,
        "timeout_s": min(connection.timeout_s, deadline_s),
        "hangs": Hangs(),
    }
    kept = {name: getattr(connection, name) for name in changed}
    for name, value in changed.items():
        setattr(connection, name, value)
    client.close()
    try:
        yield refusals
    finally:
        for name, value in kept.items():
            setattr(connection, name, value)


def _stop_as_marked(api: RestInterface) -> str:
    """Send the operations marked as a stop (x-roaas-stop); return why one was not accepted, or an empty text."""
    if not (api.call_rules.allow or api.run.statement.motion_map):
        return ""
    marked = (operation for operation in operations_of(api.run.contract) if operation.stop)
    problem = "; ".join(filter(None, (_send(api, operation) for operation in marked)))
    if api.driven is None or is_drafting():
        return problem
    if not problem:
        api.driven.moves = api.driven.refused = 0
    # Without a move since the last stop, none is needed: many devices answer a needless stop with 404 or 409.
    return problem if api.driven.moves or (problem and api.driven.refused and _is_moving(api)) else ""


def _is_moving(api: RestInterface) -> bool:
    """Return whether reads show that the device moves: by a member such as "moving", or by a changing position."""
    reads = [one for one in operations_of(api.run.contract) if one.method == "GET" and not one.parameter("path")]
    seen: list[dict[str, Any]] = []
    for turn in range(2):
        time.sleep(turn * _AGAIN_S)
        seen.append({})
        for operation in [one for one in reads if allows(api, one) and one.label not in api.streams][:_READS]:
            request = request_of(operation, usual_inputs(operation, api.values or Values())[0])
            with suppress(NoAnswerError, NotPermittedError):
                answer = api.client.send("GET", request.target, headers=request.headers, timeout_s=_DEADLINE_S).response
                value = read_json(answer.body).value if answer.ok and is_json(answer.media_type) else None
                seen[-1] |= {f"{operation.label} {place}": one for place, one in flattened(value).items()}
    first, last = seen
    words = {place: words_of(place.rpartition(" ")[2]) for place in last}
    is_said = any(words[place] & _MOVING and one is True for place, one in last.items())
    return is_said or any(
        words[place] & _PLACES and isinstance(one, int | float) and first.get(place, one) != one
        for place, one in last.items()
    )


def _naming(inputs: Inputs, values: Iterable[tuple[str, str, Any]]) -> Inputs:
    """Return inputs in which some values are replaced, each given with its place and name."""
    for where, name, value in values:
        if where != "body":
            inputs = inputs.having(where, name, value)
        elif isinstance(inputs.body, dict):
            inputs = replace(inputs, body={**inputs.body, name: value})
    return inputs


def _send(api: RestInterface, operation: Operation) -> str:
    """Send a stop with each value that the run knows for it: of all that it may have moved, and the newest ids.

    Returns:
        Why none was accepted, or why something that the run may have moved was not stopped, or an empty text.
    """
    until = time.monotonic() + _LONGEST_S
    problem, accepted, open_ = f"no request to {operation.label} could be made", False, ""
    names_one = operation.method == "DELETE" or bool(operation.parameters)
    usual = usual_inputs(operation, api.values or Values())
    driven, refused = (
        [_naming(usual[0], values) for values in api.driven.named_by(operation, refused=which)] if api.driven else []
        for which in (False, True)
    )
    known = [*driven, *(one for one in usual if one not in driven)]
    for inputs in [*known, *(one for one in refused if one not in known)]:
        if time.monotonic() > until:
            break
        moved = inputs in driven
        request = request_of(operation, inputs)
        try:
            exchange = api.client.send(
                request.method, request.target, headers=request.headers, body=request.body, timeout_s=_DEADLINE_S
            )
        except NotPermittedError:
            return ""  # the user's --never forbids it
        except NoAnswerError as none:
            problem = f"{operation.label}: {none}"
            open_ = open_ or (problem if moved else "")
            continue
        until += exchange.response.elapsed_ms / 1000  # a device that responds gets the time for every stop
        if inputs not in known:
            continue  # 404 from a good device: it has no part of that name
        accepted |= exchange.response.ok or (names_one and exchange.response.status in _OVER)
        problem = f"{operation.label} got {exchange.came}"
        status = exchange.response.status
        if moved and (status >= HTTPStatus.INTERNAL_SERVER_ERROR or status in REFUSALS):
            open_ = open_ or problem
    return open_ if accepted else problem
