"""Faults that only HTTP shows, and the picture of a fault on the certificate."""

import mutants
from arm import LIMITS, Arm
from body import Body
from judged_devices import MOVES, of_arm


def test_an_incomplete_request_that_moves_the_arm_is_found(tmp_path):
    done, judged = of_arm(Arm(fault="incomplete-moves"), tmp_path, MOVES, ["incomplete-still"])
    assert judged["motion/incomplete-still"] == "fail", done.stdout


def test_clients_that_are_mixed_up_are_found_and_the_certificate_draws_the_stop_that_is_ignored_first(tmp_path):
    # A busy machine may see no stop under way; then it is tried once more.
    for folder in (tmp_path / "first", tmp_path / "again"):
        folder.mkdir()
        body = Body(LIMITS)
        mutants.of_arm()["stop-ignored"](body)
        done, judged = of_arm(Arm(body, fault="mixes"), folder)
        if judged["motion/stop"] == "fail":
            break
    assert (judged["motion/stop"], judged["motion/one-client"]) == ("fail", "fail"), done.stdout
    page = (folder / "out" / "certificate.html").read_text(encoding="utf-8")
    first = page.index('<figure class="move')
    assert "A stop of pan under way" in page[first : page.index("</figcaption>", first)]
    assert page.count('<polyline class="way"') > 10
