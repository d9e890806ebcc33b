"""Check that no page of a site loads anything from another host: no fonts, no scripts, no counters."""

import re
from html.parser import HTMLParser
from pathlib import Path

_LOADED = {"script": "src", "img": "src", "link": "href", "iframe": "src", "source": "src", "audio": "src"}
_ELSEWHERE = re.compile(r"(?:https?:)?//")
_IN_CSS = re.compile(r"(?:url\(|@import)\s*[\"']?\s*((?:https?:)?//[^\"')\s]+)")


class _Loads(HTMLParser):
    """Collects what a page loads when it is shown."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Collect the address of a script, image, style sheet or frame."""
        given = dict(attrs)
        if address := given.get(_LOADED.get(tag, "")):
            self.found.append(address)
        self.found += _IN_CSS.findall(given.get("style") or "")


def loaded_from_elsewhere(site: Path) -> list[str]:
    """Return a sentence for each page or style sheet that loads something from another host."""
    problems = []
    for path in sorted((*site.rglob("*.html"), *site.rglob("*.css"))):
        text = path.read_text(encoding="utf-8")
        reader = _Loads()
        if path.suffix == ".html":
            reader.feed(text)
        addresses = [*reader.found, *_IN_CSS.findall(text)]
        problems += [f"{path.relative_to(site)} loads {address}" for address in addresses if _ELSEWHERE.match(address)]
    return problems
