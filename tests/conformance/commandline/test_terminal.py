"""Text from a device or a file: what controls a terminal or a CI job is shown, and does nothing."""

import pytest

from conformance.commandline.guard import inert_lines
from conformance.commandline.help_pages import inert
from reports.pages.untrusted import on_a_line


@pytest.mark.parametrize("safe", [inert, on_a_line])
@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("GET /a is 404", "GET /a is 404"),
        ("connect to ::1 or [::]", "connect to ::1 or [::]"),
        ("## a heading", "## a heading"),
        ("\x1b[2J", "\\x1b[2J"),
        ("\u202egood", "\\u202egood"),
        ("::error::a", "\\::error::a"),
        ("  ::error::a", "::error::a"),
        ("##[error]a", "#\\#[error]a"),
        ("a ##vso[task.complete]", "a #\\#vso[task.complete]"),
    ],
)
def test_a_text_acts_on_nothing(safe, text, shown):
    done = safe(text)
    assert shown in done
    assert not done.lstrip().startswith("::")


def test_lines_stay_lines():
    assert inert_lines("a\n::error::b\x07") == "a\n\\::error::b\\x07"
