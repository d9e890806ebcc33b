"""The pictures in docs/motion.md show what the rules judge today."""

from pathlib import Path

import pytest
from pictures import WRONG, drawn

DOCS = Path(__file__).parents[3] / "docs"


@pytest.mark.parametrize("requirement", WRONG)
def test_a_picture_is_as_its_moves_are_recorded(requirement):
    name = f"motion/{requirement}.svg"
    assert (DOCS / name).read_text(encoding="utf-8") == drawn(requirement), "see pictures.py for how to draw it again"
    assert f"({name})" in (DOCS / "motion.md").read_text(encoding="utf-8")
