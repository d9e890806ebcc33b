"""Steps before and after motion: acquiring and renewing a lease, and commands such as enable and home."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, Final, Protocol
from urllib.parse import quote

from conformance.observe.clock import Clock
from conformance.scenarios.motion.binding import Binding
from conformance.scenarios.motion.templates import NoValueError, at, fill
from conformance.scenarios.scenario import NotPossibleError
from conformance.statement.motion_map import Lease, Step
from conformance.transport.client import is_drafting
from conformance.transport.exchange import Exchange, Outgoing

# Share of the time between two renewals after which a lease is renewed.
_SOON: Final = 0.5
_LOOKS_S: Final = 0.05
#: Statuses by which a device says that it wants a lease: Conflict, Locked, Precondition Required.
WANTS_LEASE: Final = frozenset({409, 423, 428})


class Wanted(Protocol):
    """What a device wants before it moves, and after that: a motion map, or what was found of one."""

    @property
    def lease(self) -> Lease | None:
        """What a client must hold."""

    @property
    def before(self) -> tuple[Step, ...]:
        """What is sent before the device can move, in order."""

    @property
    def after(self) -> tuple[Step, ...]:
        """What is sent last, in order."""


class Preparation:
    """Keeps a device ready to move: begins, keeps, and ends.

    Args:
        motion: what the device wants.
        binding: how calls become requests.
        send: sends a request and returns the exchange.
        clock: the run's.

    Attributes:
        motion: what the device wants; may grow while it is found.
        lease: its value; "held" where it has none; empty if there is no lease now.
    """

    def __init__(self, motion: Wanted, binding: Binding, send: Callable[[Outgoing], Exchange], clock: Clock) -> None:
        self.motion, self._binding, self._send, self._clock = motion, binding, send, clock
        self._busy = False
        self._is_ready = not (motion.lease or motion.before)
        self._kept_s = 0.0
        self.lease = ""
        self._is_silent = False

    def keep(self) -> None:
        """Make the device ready if it is not, and renew the lease if it is time for that.

        Raises:
            NotPossibleError: the device refuses it.
            NoAnswerError: there is no response.
        """
        if self._busy or self._is_silent or is_drafting():
            return
        self._busy = True
        try:
            lease = self.motion.lease
            if lease and self.lease and lease.renew and self._clock.now() >= self._kept_s + _SOON * lease.every_s:
                exchange = self._call(lease.renew, lease.renew_body)
                self._kept_s = self._clock.now()
                if not exchange.response.ok:
                    # The lease ends if nothing is sent for a while.
                    self.lease = ""
            if lease and not self.lease:
                self._acquire()
            if not self._is_ready:
                self._is_ready = True
                self._steps(self.motion.before)
        finally:
            self._busy = False

    def fall_silent(self) -> None:
        """Renew nothing from now on, as a client that has vanished."""
        self._is_silent = True

    def speak(self) -> None:
        """Renew the lease again."""
        self._is_silent = False

    def lost_lease(self, exchange: Exchange) -> bool:
        """Return whether a response shows that the lease has ended, which a silent client cannot have renewed."""
        lease = self.motion.lease
        wants = exchange.response.status in WANTS_LEASE and not self._busy
        if not (lease and wants and self._clock.now() > self._kept_s + lease.every_s):
            return False
        self.lease = ""
        return True

    def with_lease(self, made: Outgoing) -> Outgoing:
        """Return a request with the lease, where it goes into a header."""
        lease = self.motion.lease
        if not (lease and self.lease and lease.header):
            return made
        others = (pair for pair in made.headers if pair[0] != lease.header)
        return Outgoing(made.method, made.target, (*others, (lease.header, self.lease)), made.body)

    def end(self) -> None:
        """Send the last commands, and release the lease.

        Raises:
            NotPossibleError: the device refuses it.
            NoAnswerError: there is no response.
        """
        if self._busy:
            return
        if is_drafting():
            self._draft_end()
            return
        self._busy = True
        try:
            self._steps(self.motion.after)
            if self.motion.lease and self.lease and self.motion.lease.release:
                self._call(self.motion.lease.release, self.motion.lease.release_body)
        finally:
            self._busy, self.lease = False, ""
            self._is_ready = not self.motion.before

    def _draft_end(self) -> None:
        """Draft the requests that end the use of the device, for the guard process to send if this one is killed."""
        lease = self.motion.lease
        if not lease or self.lease:
            for step in self.motion.after:
                self._call(step.send, step.body)
            if lease and lease.release:
                self._call(lease.release, lease.release_body)

    def _acquire(self) -> None:
        lease = self.motion.lease
        if lease is None:
            return
        exchange = self._call(lease.acquire, lease.body)
        if not exchange.response.ok:
            raise NotPossibleError(f"[motion.lease] {lease.acquire} got {exchange.came}")
        self.hold(lease, exchange)

    def hold(self, lease: Lease, exchange: Exchange) -> None:
        """Hold a lease that a response gave.

        Raises:
            NotPossibleError: the response has no token where it must be.
        """
        self._kept_s, self.lease = self._clock.now(), "held"
        if lease.token:
            try:
                self.lease = str(at(self._binding.content(exchange.response.body), lease.token))
            except NoValueError as error:
                raise NotPossibleError(f"[motion.lease] token: {error}") from error

    def _steps(self, steps: Iterable[Step]) -> None:
        for step in steps:
            exchange = self._call(step.send, step.body)
            if not exchange.response.ok:
                raise NotPossibleError(f"[motion] {step.send} got {exchange.came}")
            until = self._clock.now() + step.within_s
            while step.read and self._read_step(step) != step.shows:
                if self._clock.now() > until:
                    raise NotPossibleError(f"[motion] {step.read} does not show {step.shows!r} after {step.send}")
                self._clock.sleep(_LOOKS_S)

    def _read_step(self, step: Step) -> Any:
        exchange = self._call(step.read, None)
        try:
            return at(self._binding.content(exchange.response.body), step.at)
        except NoValueError:
            return None

    def _call(self, call: str, body: Any) -> Exchange:
        values = {"lease": self.lease}
        path = fill(call, {"lease": quote(self.lease, safe="")})
        return self._send(self.with_lease(self._binding.make(path, fill(body, values))))
