"""Faults that only HTTP shows, and the picture of a fault on the certificate."""

import mutants
import pytest
from arm import LIMITS, Arm
from body import Body
from judged_devices import of_arm


@pytest.mark.parametrize(("fault", "requirement"), [("mixes", "one-client"), ("incomplete-moves", "incomplete-still")])
def test_a_fault_of_the_arm_is_found(fault, requirement, tmp_path):
    done, judged = of_arm(Arm(fault=fault), tmp_path)
    assert judged[f"motion/{requirement}"] == "fail", done.stdout


def test_the_certificate_draws_how_it_moved(tmp_path):
    """A stop that is ignored: its picture stands first."""
    body = Body(LIMITS)
    mutants.of_arm()["stop-ignored"](body)
    done, judged = of_arm(Arm(body), tmp_path)
    assert judged["motion/stop"] == "fail", done.stdout
    page = (tmp_path / "out" / "certificate.html").read_text(encoding="utf-8")
    first = page.index('<figure class="move')
    assert "A stop of pan under way" in page[first : page.index("</figcaption>", first)]
    assert page.count('<polyline class="way"') > 10
