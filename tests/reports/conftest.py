"""Example results, each test with a copy of its own to change."""

import copy
import json
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from processes import ended

DATA = Path(__file__).parent / "data"
_RESULT = json.loads((DATA / "result-example.json").read_text(encoding="utf-8"))
_DESCRIBED = json.loads((DATA / "described-example.json").read_text(encoding="utf-8"))
_FLEET = json.loads((DATA / "fleet-example.json").read_text(encoding="utf-8"))
_LATENCY = json.loads((DATA / "latency-example.json").read_text(encoding="utf-8"))


@pytest.fixture
def result() -> dict[str, Any]:
    """Return a conformance result of a real run, with fewer requirements and with the addresses of an example."""
    return copy.deepcopy(_RESULT)


@pytest.fixture
def described_result() -> dict[str, Any]:
    """Return the result of a real run by a device's own description, with fewer operations and requirements."""
    return copy.deepcopy(_DESCRIBED)


@pytest.fixture
def older(result: dict[str, Any]) -> dict[str, Any]:
    """Return the result as a suite before version 1.2 wrote it: a failure's message is only what the suite got."""
    del result["pack"], result["causes"]
    for requirement in result["requirements"]:
        requirement.pop("because_of", None)
        for failure in requirement["failures"]:
            failure["message"] = failure.pop("observed")
            for key in ("number", "subject", "cause"):
                del failure[key]
    return result


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
            failure["message"] = failure["expected"] = failure["subject"] = HOSTILE
            failure["request"].update(
                method=HOSTILE, url=HOSTILE, headers={HOSTILE: HOSTILE}, body=HOSTILE, curl=HOSTILE
            )
            failure["response"].update(status=200, headers={HOSTILE: [HOSTILE] * 2}, body=HOSTILE)
    return result


# Pages of one folder may look into each other's files: that is how a wrapper page measures.
_BROWSER_OPTIONS = (
    "--headless --no-sandbox --disable-gpu --disable-quic --no-first-run --disable-background-networking "
    "--disable-component-update --disable-sync --allow-file-access-from-files --window-size=1400,1000 "
    "--virtual-time-budget=20000 --dump-dom"
)
_WIDTHS = (1280, 390)
_WRAPPER = """<!doctype html><meta charset="utf-8"><title>wrapper</title><body><pre id="out"></pre><script>
"use strict";
const measure = MEASURE;
const found = {};
for (const frame of FRAMES) {
  const element = document.createElement("iframe");
  element.style = `border: 0; height: 900px; width: ${frame.width}px`;
  element.src = frame.url;
  element.addEventListener("load", () => {
    found[`${frame.name} ${frame.width}`] = measure(element.contentDocument, element.contentWindow);
    if (Object.keys(found).length === FRAMES.length) document.getElementById("out").textContent = JSON.stringify(found);
  });
  document.body.append(element);
}
</script>"""


@pytest.fixture(scope="session")
def browse() -> Callable[[Path, dict[str, str], str], dict[str, Any]]:
    """Return what shows pages, by name, in a folder, each on a desk's and a phone's width.

    A function of JavaScript that takes a page and its window measures; what it returns is at `NAME WIDTH`.
    """
    browser = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    if browser is None:
        pytest.fail("this test needs a browser: install Debian's package `chromium` (apt-get install chromium)")

    def show(folder: Path, pages: dict[str, str], measure: str) -> dict[str, Any]:
        frames = []
        for name, text in pages.items():
            page = folder / f"{name}.html"
            page.write_text(text, encoding="utf-8")
            frames += [{"name": name, "width": width, "url": page.as_uri()} for width in _WIDTHS]
        wrapper = folder / "wrapper.html"
        wrapper.write_text(_WRAPPER.replace("FRAMES", json.dumps(frames)).replace("MEASURE", measure), encoding="utf-8")
        profile = f"--user-data-dir={folder / 'profile'}"
        done = ended(browser, *_BROWSER_OPTIONS.split(), profile, wrapper.as_uri(), check=True)
        out = re.search(r'<pre id="out">(\{.*?\})</pre>', done.stdout, re.DOTALL)
        assert out, f"the pages did not load: {done.stderr[-2000:]}"
        return json.loads(out.group(1).replace("&amp;", "&").replace("&lt;", "<").replace("&gt;", ">"))

    return show
