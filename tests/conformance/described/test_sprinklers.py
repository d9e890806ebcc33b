"""A device of zones: no right style is blamed, and faults that show between two exchanges are found at quick."""

import pytest
from small_device import certified, small_device
from sprinkler_faults import FAULTS, RIGHT
from sprinklers import sprinklers

# What some of the faults bring about beside what they break: what is refused and done is no longer as it was written.
_FOLLOWS = {
    f"description/{name}" for name in ("created-is-there", "written-is-read", "refused-keeps", "digest", "list-filter")
}

# Faults for which the whole class is judged: nothing else may be blamed. Some of these faults show only after the
# requests of other requirements.
_WHOLE_CLASS = (3, 4, 7)
# What the other styles do in their own way is judged by these classes.
_CLASSES = ("--class=description", "--class=http")


def _blamed(style, faults, tmp_path, *more):
    with small_device(*sprinklers(RIGHT[style], faults)) as url:
        done = certified(f"{url}/openapi.json", tmp_path / "out", "--call=*", *more)
    said = [failure["expected"] for one in done.result["requirements"] for failure in one.get("failures", ())]
    return done.blamed, f"{done.text}{said}"


@pytest.mark.parametrize(
    "style", [*RIGHT][:1] + [pytest.param(one, marks=pytest.mark.side_by_side) for one in [*RIGHT][1:]]
)
def test_a_right_style_is_not_blamed(style, tmp_path):
    blamed, text = _blamed(style, (), tmp_path, *(() if style == "as described" else _CLASSES))
    assert not blamed, text


@pytest.mark.side_by_side
@pytest.mark.parametrize("number", range(len(FAULTS)))
def test_faults_are_found(number, tmp_path):
    style, faults = FAULTS[number]
    expected = [(one, "") if isinstance(one, str) else one for one in faults.values()]
    selected = _CLASSES[:1] if number in _WHOLE_CLASS else (f"--select={id_}" for id_, _ in expected)
    blamed, text = _blamed(style, faults, tmp_path, *selected)
    assert [pair for pair in expected if pair[0] not in blamed or pair[1] not in text] == [], text
    assert blamed.keys() <= {*(id_ for id_, _ in expected), *_FOLLOWS}, text
