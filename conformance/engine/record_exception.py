"""Turn an exception in a check into evidence: the robot failed, the robot is gone, or the suite could not judge."""

import traceback
from collections.abc import Callable

from conformance.scenarios.scenario import NoOccasionError, NotDeclaredError, NotPossibleError, NotSeenError
from conformance.transport.exchange import NoAnswerError, NotPermittedError
from conformance.verdict.evidence import HarnessError, RefutedError
from conformance.verdict.finding import Finding
from conformance.verdict.run import Run
from conformance.verdict.time_limit import TimeIsOverError


def record_exception(
    run: Run, alive: Callable[[], bool], ids: tuple[str, ...], judged: dict[str, int], error: Exception
) -> None:
    """Record what an exception that ended a check means for the check's requirements.

    ``alive`` checks whether the robot still responds; ``judged`` is each requirement's number of cases before the
    check.
    """
    if isinstance(error, RefutedError):
        return
    if isinstance(error, TimeIsOverError):
        for id_ in ids:
            run.out_of_time(id_)
        return
    # A description may be such that the suite can make no valid request.
    unmade = isinstance(error, HarnessError) and not run.contract.is_claimed
    if isinstance(error, NotPossibleError | NotPermittedError) or unmade:
        # A note becomes the reason for a skip if nothing was judged; it changes nothing otherwise.
        tell = run.judge.note if isinstance(error, NoOccasionError) else run.judge.skip
        tell = run.judge.note_unclaimed if isinstance(error, NotDeclaredError) else tell
        tell = run.judge.not_seen if isinstance(error, NotSeenError) else tell
        for id_ in ids:
            tell(id_, str(error))
        return
    known = [id_ for id_ in ids if run.judge.of(id_) is not None]
    now = run.judge.counts(known)
    # Requirements that the check had not judged yet. If it had judged all, all of them: each may have lacked a case.
    open_ids = [id_ for id_ in known if now[id_] == judged[id_]] or known
    if isinstance(error, NoAnswerError):
        _no_answer(run, alive, known, open_ids, error)
        return
    where = traceback.extract_tb(error.__traceback__)[-1]
    run.judge.fault(f"in the check {run.judge.check_name}", error, open_ids)
    for id_ in open_ids:
        run.judge.error(
            id_, f"the suite could not judge this: {type(error).__name__}: {error} ({where.name}, line {where.lineno})"
        )


def _no_answer(
    run: Run, alive: Callable[[], bool], known: list[str], open_ids: list[str], error: NoAnswerError
) -> None:
    losses = run.losses
    goes_on = alive()
    if run.losses > losses or (run.aborted and run.judge.ended_by):
        # The loss of the device is reported as a finding of its own, or blamed on a gateway.
        for id_ in open_ids:
            if run.aborted or run.judge.ended_by:
                run.judge.note_stopped(id_, run.aborted)
            else:
                run.judge.skip(id_, str(error))
    elif goes_on:
        for id_ in dict.fromkeys(run.contract.ids_by_alias.get(id_, id_) for id_ in open_ids):
            run.judge.check(id_, False, error.unanswered, "a response")  # noqa: FBT003 - the condition of check()
        run.judge.silent(error.unanswered)
        for finding in run.judge.met:
            # An earlier finding may come from a check that judged this requirement itself.
            if finding.exchange is error.unanswered and finding.seen == 1:
                finding.among = len(open_ids)
    else:
        _record_gone(run, known, open_ids, error)


def _record_gone(run: Run, known: list[str], open_ids: list[str], error: NoAnswerError) -> None:
    """Record that the robot is gone, where the contract has no requirement on that itself."""
    request = error.unanswered.request
    risked = [id_ for id_ in known if id_ in run.judge.at_risk]
    for id_ in risked:
        run.judge.check(
            id_,
            False,  # noqa: FBT003 - the condition of check()
            error.unanswered,
            "a robot that still responds after this request",
            found=f"{error.unanswered.problem}, and no response to any request since",
        )
    risks = {run.contract.ids_by_alias.get(id_, id_) for id_ in risked}
    met = (finding for finding in run.judge.met if finding.requirement in risks)
    ended = [finding for finding in met if finding.exchange is error.unanswered]
    for finding in ended:
        finding.alone = True
    run.judge.ended_by = next((finding for finding in ended if _is_claimed(run, finding)), None)
    run.aborted = f"the robot stopped responding ({error.unanswered.problem}, at {request.method} {request.url[:200]})"
    for id_ in open_ids:
        if id_ not in risked:
            run.judge.note_stopped(id_, run.aborted)


def _is_claimed(run: Run, finding: Finding) -> bool:
    return finding.requirement in run.contract.ledger and run.contract.ledger[finding.requirement].binds(run.claims)
