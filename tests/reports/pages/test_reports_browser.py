"""The pages in a browser: everything is drawn, nothing is loaded, nothing hangs over the edge.

Debian's Chromium shows the pages, as they are, in frames of a wrapper page, whose script measures them.
"""

import json
import re
from pathlib import Path

import pytest

from reports.certificate.page import certificate_html
from reports.latency.comparison import compare
from reports.latency.comparison_page import comparison_html
from reports.latency.page import latency_html
from reports.pages.page import TEMPLATE_DIR

DATA = Path(__file__).parents[1] / "data"
WIDTHS = (1280, 390)
PAGES = ("certificate", "described", "latency", "compare")
MEASURE = """(page, view) => {
  const box = (node) => { const b = node.getBoundingClientRect(); return [b.left, b.top, b.width, b.height]; };
  return {
    width: page.documentElement.scrollWidth,
    text: page.body.innerText.length,
    verdict: box(page.querySelector("#verdict")),
    drawings: Array.from(page.querySelectorAll("figure svg"), (svg) => ({
      name: svg.id, box: box(svg),
      marks: svg.querySelectorAll("path, use").length,
      words: Array.from(svg.querySelectorAll("text"), (node) => box(node)),
      within: Array.from(svg.querySelectorAll("text"), (node) => {
        const inner = node.getBoundingClientRect(), outer = svg.getBoundingClientRect();
        return inner.left >= outer.left - 2 && inner.right <= outer.right + 2 && inner.bottom <= outer.bottom + 2;
      }),
    })),
    figures: page.querySelectorAll("figure").length,
    height: page.documentElement.scrollHeight,
    hidden: Array.from(page.querySelectorAll(".scroll"), (box) => box.scrollWidth - box.clientWidth),
    buttons: page.querySelectorAll("button").length,
    loaded: view.performance.getEntriesByType("resource").map((entry) => entry.name),
  };
}"""


@pytest.fixture(scope="module")
def seen(tmp_path_factory, browse):
    """Show every page at every width, once, and return what was measured."""
    result = json.loads((DATA / "result-example.json").read_text(encoding="utf-8"))
    described = json.loads((DATA / "described-example.json").read_text(encoding="utf-8"))
    latency = json.loads((DATA / "latency-example.json").read_text(encoding="utf-8"))
    both = compare(latency, latency, ("old", "new"), 0.05)
    certificates = certificate_html(result), certificate_html(described)
    pages = *certificates, latency_html(latency), comparison_html(both, ("old", "new"))
    return browse(tmp_path_factory.mktemp("pages"), dict(zip(PAGES, pages, strict=True)), MEASURE)


EACH = pytest.mark.parametrize("page", [f"{name} {width}" for name in PAGES for width in WIDTHS])


@EACH
def test_every_figure_is_drawn(seen, page):
    found = seen[page]
    assert found["figures"] == {"certificate": 0, "described": 0, "latency": 6, "compare": 2}[page.split()[0]]
    assert len(found["drawings"]) == {"certificate": 0, "described": 0, "latency": 18, "compare": 9}[page.split()[0]]
    for drawing in found["drawings"]:
        assert drawing["box"][2] > 250, drawing["name"]
        assert drawing["box"][3] > 100, drawing["name"]
        assert drawing["marks"] > 10, drawing["name"]
        assert len(drawing["words"]) > 5, drawing["name"]


@EACH
def test_no_word_is_cut_off(seen, page):
    for drawing in seen[page]["drawings"]:
        assert all(drawing["within"]), drawing["name"]


@EACH
def test_words_in_figures_are_readable(seen, page):
    # Height of a line of text on the screen, in CSS pixels, upright ones only.
    for drawing in seen[page]["drawings"]:
        heights = [height for _, _, width, height in drawing["words"] if width > height]
        assert min(heights) > 9, drawing["name"]


@EACH
def test_nothing_hangs_over_the_edge(seen, page):
    assert seen[page]["width"] <= int(page.split()[1])


@EACH
def test_a_certificate_is_short_and_no_table_hides_a_column_on_a_phone(seen, page):
    name, width = page.split()
    if name in {"certificate", "described"}:
        assert seen[page]["height"] < {"1280": 6_000, "390": 12_000}[width]
    if width == "390":
        assert max(seen[page]["hidden"], default=0) <= 1


def _contrast(one, other):
    def luminance(colour):
        parts = [int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)]
        red, green, blue = (c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in parts)
        return 0.2126 * red + 0.7152 * green + 0.0722 * blue

    light, dark = sorted((luminance(one), luminance(other)), reverse=True)
    return (light + 0.05) / (dark + 0.05)


@pytest.mark.parametrize("mode", [0, 1], ids=["light", "dark"])
def test_words_are_readable_in_light_and_in_the_dark(mode):
    # WCAG 2.1, 1.4.3.
    style = (TEMPLATE_DIR / "page.css").read_text(encoding="utf-8")
    blocks = [block for block in re.findall(r":root \{(.*?)\}", style, re.DOTALL) if "--ink" in block]
    assert len(blocks) == 2
    colours = dict(re.findall(r"--([\w-]+): (#\w+)", blocks[mode]))
    colours["paper"] = colours["paper"].replace("#fff", "#ffffff")[:7]
    for name in ("good", "bad", "warn", "quiet"):
        assert _contrast(colours[name], colours[f"{name}-wash"]) >= 4.5, name
        assert _contrast(colours["ink"], colours[f"{name}-wash"]) >= 4.5, name
    for name in ("ink", "soft", "link", "good", "bad", "warn"):
        assert _contrast(colours[name], colours["paper"]) >= 4.5, name


@EACH
def test_verdict_is_on_the_first_screen(seen, page):
    _, top, width, height = seen[page]["verdict"]
    assert top + height < 700
    assert width > 300


@EACH
def test_page_works_and_loads_nothing(seen, page):
    assert seen[page]["text"] > 1000
    assert seen[page]["buttons"] > 1, "the page's script did not run: is its digest in the policy?"
    assert seen[page]["loaded"] == []
