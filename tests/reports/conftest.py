"""Example results, each test with a copy of its own to change."""

import copy
import json
from pathlib import Path
from typing import Any

import pytest

DATA = Path(__file__).parent / "data"
_RESULT = json.loads((DATA / "result-example.json").read_text(encoding="utf-8"))
_FLEET = json.loads((DATA / "fleet-example.json").read_text(encoding="utf-8"))
_LATENCY = json.loads((DATA / "latency-example.json").read_text(encoding="utf-8"))


@pytest.fixture
def result() -> dict[str, Any]:
    """Return a conformance result with every kind of verdict in it."""
    return copy.deepcopy(_RESULT)


@pytest.fixture
def fleet() -> dict[str, Any]:
    """Return a fleet: one robot conforms, one fails with an accepted failure, one is given up, one is not reached."""
    return copy.deepcopy(_FLEET)


@pytest.fixture
def latency() -> dict[str, Any]:
    """Return a latency result with every part that the schema knows."""
    return copy.deepcopy(_LATENCY)


HOSTILE = (
    "</pre></script><script>alert(1)</script><img src=x onerror=alert(2)>"
    "\"'`{{7*7}}{% raw %}]]>-->&amp;\x00\x1b[2J\x7f\u202e\u2066\u200b\ufeff\ufffe\ud800|\r\n@octocat #1"
)


@pytest.fixture
def hostile_text() -> str:
    """Return text that attacks whoever shows it."""
    return HOSTILE


@pytest.fixture
def hostile(result: dict[str, Any]) -> dict[str, Any]:
    """Return a conformance result in which every text that a robot or its vendor controls attacks the reader."""
    result["statement"]["robot"] = {"name": HOSTILE, "vendor": HOSTILE, "version": HOSTILE}
    result["target"]["rest"] = HOSTILE
    result["notes"] = [HOSTILE]
    result["command"] = HOSTILE
    for requirement in result["requirements"]:
        requirement["reason"] = HOSTILE
        for failure in requirement["failures"]:
            failure["message"] = failure["expected"] = HOSTILE
            failure["request"].update(
                method=HOSTILE, url=HOSTILE, headers={HOSTILE: HOSTILE}, body=HOSTILE, curl=HOSTILE
            )
            failure["response"].update(status=200, headers={HOSTILE: [HOSTILE] * 2}, body=HOSTILE)
    return result
