"""Wait for a device that stopped responding, restart it, and find the request, and its part, that caused it."""

import json
import shlex
import subprocess
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

from conformance.engine.resending import send_again
from conformance.transport.client import Connection
from conformance.transport.credentials import is_shown
from conformance.transport.exchange import (
    OF_GATEWAY,
    SAFE_METHODS,
    Attempt,
    NoAnswer,
    NotPermittedError,
    Request,
    Sending,
    Unanswered,
)
from conformance.verdict.finding import Sent, Showing
from conformance.verdict.run import Run

# Headers that every request needs or that the client adds.
_KEPT: Final = frozenset({"host", "accept", "content-type", "content-length", "connection"})
# A text longer than this is also tried at half its length.
_LONG: Final = 64


def smaller(request: Request) -> Iterator[Request]:
    """Yield requests that lack one part of this one, the largest parts first."""
    if request.raw is not None:
        return
    if request.body:
        yield replace(request, body=b"", headers=_without(request, "content-type"))
    place, mark, query = request.url.partition("?")
    pairs = query.split("&") if mark else []
    if pairs:
        yield replace(request, url=place)
    for index in range(len(pairs)) if len(pairs) > 1 else ():
        yield replace(request, url=f"{place}?{'&'.join(pairs[:index] + pairs[index + 1 :])}")
    for index, pair in enumerate(pairs):
        if len(pair) > _LONG:
            # Do not cut a percent-escape in two: that would be another fault.
            half = pair[: len(pair) // 2].rstrip("%") if "%" not in pair[len(pair) // 2 - 2 :] else ""
            yield replace(request, url=f"{place}?{'&'.join([*pairs[:index], half, *pairs[index + 1 :]])}")
    for name in dict.fromkeys(name.lower() for name, value in request.headers if not is_shown(value)):
        if name not in _KEPT:
            yield replace(request, headers=_without(request, name))
    for body in _smaller_bodies(request.body):
        yield replace(request, body=body)


def _without(request: Request, name: str) -> tuple[tuple[str, str], ...]:
    return tuple(pair for pair in request.headers if pair[0].lower() != name)


def _smaller_bodies(body: bytes) -> Iterator[bytes]:
    try:
        value = json.loads(body)
    except (ValueError, RecursionError):
        if len(body) > 1:
            yield body[: len(body) // 2]
        return
    for one in _smaller_values(value):
        yield json.dumps(one, ensure_ascii=False).encode("utf-8", "surrogatepass")


def _smaller_values(value: Any) -> Iterator[Any]:
    """Yield JSON values that lack one member or item, or the second half of a long text; outer ones first."""
    if isinstance(value, str) and len(value) > _LONG:
        yield value[: len(value) // 2]
    if isinstance(value, list) and len(value) > _LONG:
        yield value[: len(value) // 2]
        return
    keys = range(len(value)) if isinstance(value, list) else list(value) if isinstance(value, dict) else ()
    for key in keys:
        lacking = value.copy()
        del lacking[key]
        yield lacking
    for key in keys:
        for inner in _smaller_values(value[key]):
            changed = value.copy()
            changed[key] = inner
            yield changed


_CRASH: Final = "robustness/no-crash"
_HANG: Final = "robustness/no-hang"
_SOAP: Final = "soap/answered"
# Default wait for a lost device, s: _RETURN_S if a supervisor may restart it, _RESTART_S if a command does.
_RETURN_S: Final = 20.0
_RESTART_S: Final = 60.0
_SENDS: Final = 30  # requests that are sent to find the smallest fatal sequence
_LOOKING_S: Final = 120.0  # time for the search, s
_BEFORE: Final = (1, 3, 7)  # numbers of earlier requests that are sent before the last one
# A device may crash this long after it has answered its last request, s.
_DYING_S: Final = 0.3
# A device that is lost more often than this is not awaited again.
_MOST_LOSSES: Final = 5
_NAMED: Final = 5  # requests before the last that the finding names
_HANGS: Final = frozenset({NoAnswer.TIMEOUT, NoAnswer.GATEWAY_TIMEOUT})  # outcomes that mean a hang
# Outcomes of a request that may have crashed the device: it was sent.
_SUSPECT: Final = frozenset({NoAnswer.CLOSED, NoAnswer.TIMEOUT, *OF_GATEWAY.values()})


@dataclass(frozen=True)
class _Found:
    """The requests that make the device stop responding, as few and small as they were found.

    Attributes:
        requests: the last one does it.
        sure: whether they did it again when they were sent once more.
        alone: whether the last request before the loss did it again without those before it.
    """

    requests: tuple[Request, ...]
    sure: bool = False
    alone: bool = False


class LostDevice:
    """Waits for a device that no longer responds, and finds the request that did it.

    Args:
        run: the data of the run.
        connection: the settings of the run's clients.
        responds: returns whether the device responds within so many seconds.
        operation_of: returns the label of the operation that a request is for, or an empty text.
        tell: reports progress.
        stop: stops the device.
    """

    def __init__(
        self,
        run: Run,
        connection: Connection,
        responds: Callable[[float], bool],
        operation_of: Callable[[Request], str],
        tell: Callable[[str], None],
        stop: Callable[[], None] = lambda: None,
    ) -> None:
        self._run, self._connection, self._responds = run, connection, responds
        self._operation_of, self._tell, self._stop = operation_of, tell, stop
        self._sends, self._until, self._is_back = 0, 0.0, True

    def handle(self, recent: Sequence[Sending]) -> bool:
        """Record a finding with the request after which the device was lost; return whether the run can go on.

        Args:
            recent: the last requests, newest last.
        """
        run = self._run
        sent, kind = _suspects(recent)
        requirement = self._requirement(kind) if sent else ""
        if sent:
            self._tell(f"the device stopped responding after {_request_text(sent[-1])}; waiting for it to come back")
        self._is_back = self._comes_back()
        if self._is_back:
            # The device may continue what it did when it was lost.
            self._stop()
        if not requirement:
            if not self._is_back:
                run.aborted = "the robot stopped responding"
            return self._is_back
        run.losses += 1
        found = self._find(sent)
        if kind in OF_GATEWAY.values() and not found.sure and (self._is_back or kind is NoAnswer.UNAVAILABLE):
            seen = f"a gateway responded {kind} to {_request_text(sent[-1])} and to requests after it"
            why = f"cannot tell: {seen}. {self._what_is_known(sent, found)}"
            run.judge.skip(requirement, why)
            run.aborted = "" if self._is_back else why
            return self._is_back
        self._record(requirement, kind, sent, found)
        if self._is_back and run.losses < _MOST_LOSSES:
            self._tell("the device responds again; the run goes on")
            return True
        again = f", the {run.losses}th time" if self._is_back else ""
        run.aborted = f"the device stopped responding after {_request_text(found.requests[-1])}{again}"
        return False

    def _requirement(self, kind: NoAnswer | None) -> str:
        """Return the requirement that the loss breaks; empty if the contract has none on that."""
        run, ledger = self._run, self._run.contract.ledger
        id_ = _HANG if kind in _HANGS else _CRASH
        id_ = id_ if id_ in ledger else _SOAP
        if id_ not in ledger:
            return ""
        if run.claims and not ledger[id_].binds(run.claims):
            # Whatever classes the user selected, a loss counts: nothing else can be judged.
            ledger[id_] = replace(ledger[id_], also=(*ledger[id_].also, run.claims[0]))
        return id_

    def _comes_back(self) -> bool:
        """Restart the device by the user's command, if there is one; return whether it responds again."""
        command = self._run.restart_command
        if not command:
            return self._responds(self._return_s)
        quiet = subprocess.DEVNULL
        try:
            # The user's own command, which may become the device's process.
            subprocess.Popen(  # noqa: S603 - as above
                shlex.split(command), stdin=quiet, stdout=quiet, stderr=quiet, start_new_session=True
            )
        except (OSError, ValueError) as error:
            self._tell(f"--restart-command could not be started: {error}")
            return self._responds(self._return_s)
        # A device that hangs still listens until the command ends it.
        time.sleep(_DYING_S)
        return self._responds(self._return_s)

    @property
    def _return_s(self) -> float:
        """How long the device is waited for, s."""
        return self._run.wait_s or (_RESTART_S if self._run.restart_command else _RETURN_S)

    def _find(self, sent: Sequence[Request]) -> _Found:
        """Return the smallest sequence of requests after which the device is lost again."""
        last = sent[-1]
        self._sends, self._until = _SENDS, time.monotonic() + _LOOKING_S
        if not all(map(self._may_repeat, sent[-1:])) or not self._is_back:
            return _Found((last,))
        if self._does(last):
            return _Found((self._smallest(last),), sure=True, alone=True)
        for count in _BEFORE:
            before = [request for request in sent[-count - 1 : -1] if self._may_repeat(request)]
            if len(before) == count and self._does(*before, last):
                pairs = ((one, last) for one in reversed(before) if count > 1)
                pair = next((pair for pair in pairs if self._does(*pair)), None)
                return _Found(pair or (*before, last), sure=True)
        return _Found((last,))

    def _smallest(self, request: Request) -> Request:
        """Return the smallest request that has the same effect."""
        tried: set[Request] = set()
        while True:
            for one in smaller(request):
                if one not in tried and self._does(one):
                    request = one
                    break
                tried.add(one)
            else:
                return request

    def _may_repeat(self, request: Request) -> bool:
        """Return whether a request may be sent again: one that moves a device may move it elsewhere now."""
        harmless = not (self._run.contract.is_claimed or self._run.statement.motion_map)
        return request.method in SAFE_METHODS or (harmless and request.raw is None)

    def _does(self, *requests: Request) -> bool:
        """Send requests, and return whether the device is lost after them; wait until it is back."""
        if not self._is_back or len(requests) > self._sends or time.monotonic() > self._until:
            return False
        self._sends -= len(requests)
        silent = self._connection.unheard(recent=deque(), sent=0)
        came: Attempt | None = None
        try:
            for request in requests:
                came = send_again(request, silent)
        except NotPermittedError:
            return False
        finally:
            self._connection.sent += silent.sent
        closed = isinstance(came, Unanswered) and came.kind in {NoAnswer.CLOSED, NoAnswer.REFUSED, *OF_GATEWAY.values()}
        if not closed:
            time.sleep(_DYING_S)
        if not closed and self._responds(0.0):
            return False
        self._is_back = self._comes_back()
        if self._is_back:
            # The device may continue what it did when it was lost.
            self._stop()
        return True

    def _record(self, requirement: str, kind: NoAnswer | None, sent: Sequence[Request], found: _Found) -> None:
        """Record the finding that keeps the remaining requirements from being tested."""
        judge, last = self._run.judge, found.requests[-1]
        problems: dict[NoAnswer | None, str] = {
            NoAnswer.TIMEOUT: f"no response within {self._connection.timeout_s:g} s",
            None: "no connection after the response to this request",
            **{
                no_answer: f"a gateway responded {no_answer} in the device's place" for no_answer in OF_GATEWAY.values()
            },
        }
        problem = problems.get(kind, "the server closed the connection without a response")
        operation = self._operation_of(last)
        judge.check(
            requirement,
            False,  # noqa: FBT003 - the condition of check()
            Unanswered(last, problem, kind or NoAnswer.CLOSED),
            "a response, and a device that responds afterwards",
            found=f"{problem}, and no response to any request since. {self._what_is_known(sent, found)}",
            cause=f"{operation or last.endpoint} {'hang' if kind in _HANGS else 'closed'}",
            subject=operation,
            operations=[Showing(operation, 1, last)] if operation else [],
        )
        finding = judge.met[-1]
        if found.sure:
            finding.sequence = tuple(Sent(0.0, request) for request in found.requests)
        judge.ended_by = finding

    def _what_is_known(self, sent: Sequence[Request], found: _Found) -> str:
        """Return, in sentences, what is known about the requests that the device did not survive."""
        before = [_request_text(request) for request in reversed(sent[:-1])][:_NAMED]
        newest = f" The requests before it, newest first: {', '.join(before)}" if before else ""
        if found.alone:
            return "The same request, sent alone after the device had come back, did it again"
        if found.sure:
            named = ", ".join(map(_request_text, found.requests[:-1]))
            return f"It does so after {named}, and did it again when these requests were repeated"
        if not self._is_back:
            return f"The device did not come back within {self._return_s:g} s, so nothing more was sent.{newest}"
        return f"The device came back, and did not do it again for the same request.{newest}"


def _suspects(recent: Sequence[Sending]) -> tuple[list[Request], NoAnswer | None]:
    """Return the requests up to the one after which the device was lost, and why that got no response.

    That is the first of the unanswered ones at the end; if all of them were refused, the answered one before them.
    """
    first = len(recent)
    while first and recent[first - 1].kind is not None:
        first -= 1
    unanswered = [index for index in range(first, len(recent)) if recent[index].kind in _SUSPECT]
    end = unanswered[0] if unanswered else first - 1
    if end < 0:
        return [], None
    return [sending.request for sending in recent[: end + 1]], recent[end].kind


def _request_text(request: Request) -> str:
    return f"`{request.method} {request.target[:120]}`"
