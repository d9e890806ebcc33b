"""What a mutant does later is done, and ends quietly when there is no robot any more."""

import threading

import pytest

from proof.mutation.wire import IncompleteMessageError
from proof.table1.mutants.crowd import later


def test_it_is_done_with_its_arguments():
    done, given = threading.Event(), []
    later(0.01, lambda *arguments: (given.extend(arguments), done.set()), 1, "b")
    assert done.wait(30)
    assert given == [1, "b"]


@pytest.mark.parametrize("error", [ConnectionRefusedError, IncompleteMessageError])
def test_a_run_that_is_over_is_nobodys_business(error, monkeypatch):
    told, raised = [], threading.Event()
    monkeypatch.setattr(threading, "excepthook", told.append)

    def act():
        raised.set()
        raise error

    before = set(threading.enumerate())
    later(0, act)
    assert raised.wait(30)
    for thread in set(threading.enumerate()) - before:
        thread.join(5)
    assert told == []
