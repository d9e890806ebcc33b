"""Search for a device's axes under a guard, which stops the device however the search ends."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from conformance.api.rest.guard import Guard
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.stops import stop_device
from conformance.commandline.help_pages import inert
from conformance.engine.finding import Finder
from conformance.engine.progress import note_signals
from conformance.scenarios.scenario import NotPossibleError
from conformance.transport.exchange import NoAnswerError

_Finder = TypeVar("_Finder", bound=Finder)


def find_guarded(finder: _Finder, api: RestInterface, say: Callable[[str], None]) -> _Finder:
    """Let a finder drive the device, and return the finder.

    Args:
        finder: drives it.
        api: its web API.
        say: takes each message for the user.

    Raises:
        NotPossibleError: no map could be found; the message names the reason.
        KeyboardInterrupt: a signal came, which is told to the user with the state of the device.
    """
    run, guard, api.stop_device = api.run, Guard(api), finder.halt
    api.client.connection.before_sending = guard.before_sending
    with note_signals(run) as interruption:
        try:
            return finder.find()
        except (KeyboardInterrupt, NoAnswerError, NotPossibleError) as ended:
            interruption.only_record()
            if run.interrupted or isinstance(ended, NoAnswerError):
                problem = stop_device(api, say)
                say(f"WARNING: {inert(problem)}" if problem else "The device was stopped.")
            if run.interrupted:
                say(f"Interrupted by {run.ended_by}: no map was found, and nothing is judged.")
                raise KeyboardInterrupt from ended
            raise NotPossibleError(str(ended)) from ended
        finally:
            guard.release(stopped=not run.stop_undelivered)
