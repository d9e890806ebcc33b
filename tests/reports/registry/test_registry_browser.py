"""The pages of who may do what in a browser, from files alone: wide and narrow, filtered, and read years later."""

import re

from vendors import Door, requirement

from reports.certificate.difference import difference
from reports.certificate.difference_page import difference_html
from reports.fleet import fleet_html

WIDTHS = (1280, 390)
MEASURE = """(page, view) => {
  const all = (what) => Array.from(page.querySelectorAll(what));
  const shown = () => all("tr[data-found]").filter((row) => row.getClientRects().length).length;
  const seen = {
    width: page.documentElement.scrollWidth,
    right: Math.max(0, ...all("td.mark").map((cell) => cell.getBoundingClientRect().right)),
    rows: shown(),
    green: all(".good").filter((one) => !one.closest(".small.tally")).length,
    loaded: view.performance.getEntriesByType("resource").length,
  };
  const radio = page.getElementById("may-0");
  if (radio) { radio.click(); seen.filtered = shown(); }
  const box = page.querySelector("input[type=search]");
  if (box) {
    page.getElementById("may-all").click();
    box.value = "courier 7";
    box.dispatchEvent(new Event("input"));
    seen.searched = shown();
  }
  return seen;
}"""


def test_the_pages_fit_a_desk_and_a_phone_and_can_be_filtered(host, fleet, browse):
    classes = dict.fromkeys(fleet["class_titles"], "pass")
    broken = [requirement("pass", "SHOULD", f"http/a-rather-long-name-{number}") for number in range(3)]
    each = [requirement("pass", "MAY", f"{name}/x") for name in classes]
    host.result["statement"]["claims"] = list(classes)

    class Wide(Door):
        """An installation whose ledger has these requirements."""

        @staticmethod
        def known(_pack=None):
            ledger = {one["id"]: {"level": one["level"], "classes": [one["class"]]} for one in (*broken, *each)}
            return Door.known() | {"ledger": ledger}

    both = {"classes": classes, "requirements": broken + each}
    host.sign("old", days_ago=3, statement__robot__version="2.3", **both)
    host.sign("new", classes=classes, requirements=[{**item, "verdict": "warn"} for item in broken] + each)
    most = {**classes, "rest-resources": "not-claimed"}
    host.sign("other", statement__robot__name="Kiosk", **(both | {"classes": most}))
    host.sign("foreign", vendor="stranger")
    assert host.build(door=Wide).exit_code == 1
    index = (host.site / "index.html").read_text()
    (robot,) = (host.site / "robots").glob("courier-7-*.html")
    both = difference({**host.result, "seed": 1}, host.result)
    pages = {"index": index, "robot": robot.read_text(), "fleet": fleet_html(fleet)}
    pages |= {
        f"{name} later": re.sub(r'data-until="[^"]+"', 'data-until="2026-01-01T00:00:00Z"', pages[name])
        for name in ("index", "robot")
    }
    pages["diff"] = difference_html(both, ("old", "new"))
    seen = browse(host.site, pages, MEASURE)
    for page, found in seen.items():
        assert found["width"] <= int(page.split()[-1]), f"{page} hangs over the edge"
        assert found["right"] <= int(page.split()[-1]), f"{page}: classes are out of sight"
        assert found["loaded"] == 0, page
    for width in WIDTHS:
        at = {name: seen[f"{name} {width}"] for name in pages}
        assert (at["index"]["rows"], at["index"]["filtered"], at["index"]["searched"]) == (2, 1, 1)
        assert (at["fleet"]["rows"], at["fleet"]["filtered"]) == (4, 1)
        assert at["index"]["green"] > 0
        assert at["robot"]["green"] > 0
        assert at["index later"]["green"] == at["robot later"]["green"] == 0, "what expired since is not green any more"
        assert at["index later"]["filtered"] == 0
