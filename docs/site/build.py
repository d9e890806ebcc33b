"""``make docs``: build the documentation site from docs/*.md and from the code, and check that it needs no network.

The pages of docs/ are copied to a folder beside the site, where the generated ones (requirements, commands, statement,
result files) join them. Sphinx fails on each warning, missing anchors included.
"""

import argparse
import re
import shutil
import sys
from pathlib import Path

from sphinx.cmd.build import main as sphinx

SITE = Path(__file__).parent
DOCS, ROOT = SITE.parent, SITE.parents[1]
sys.path[:0] = [str(ROOT), str(SITE)]

import commands  # noqa: E402 - of this folder
import offline  # noqa: E402
import requirement_pages  # noqa: E402
import schemas  # noqa: E402
import statement_keys  # noqa: E402

# Files of the repository that are pages as well.
_ELSEWHERE = {
    "README.md": "index.md",
    "CHANGELOG.md": "changes.md",
    "CONTRIBUTING.md": "contributing.md",
    "conformance/packs/table1/contract.md": "contract.md",
    "deploy/kubernetes/README.md": "kubernetes.md",
}
_LINK = re.compile(r"\]\(([^)#:\s]+)(#[^)]*)?\)")
# What these pages say is on others, which a search should find.
_UNSEARCHED = dict.fromkeys(("coverage.md", "changes.md", "contributing.md"), "nosearch: true")
# Words that readers search by and a page does not use.
_KEYWORDS = {
    f"{page}.md": f"myst: {{html_meta: {{keywords: '{', '.join(words.split())}'}}}}"
    for page, words in {
        "baseline": "allow ignore suppress waiver expected flaky exception xfail skip regressions",
        "certificates": "customer proof trust signature key share publish send",
        "ci": "pipeline jenkins github gitlab docker image workflow badge annotations",
        "fleet": "many robots parallel website dashboard",
        "install": "setup pip without ros windows macos tab autocomplete bash zsh fish upgrade python version",
        "load": "latency performance benchmark slow slower faster regression release percentile p99 throughput",
        "motion": "move speed limits axis stop emergency watchdog",
        "own-robot": "openapi swagger wsdl soap harm safe read-only dangerous move moving api key password login auth",
        "packs": "custom contract rules plugin extend write checks",
        "paper-robot": "quick start demo simulation simulator example getting started",
        "security": "nginx gateway prefix reverse proxy self signed certificate private ca https tls token",
        "verdicts": "exit code return status result meaning duration time effort quick deep skipped",
    }.items()
}
# A link that shows a file's name is given the page's title.
_UNTITLED = re.compile(r"\[`?[\w./-]+\.md`?\]\((?=[^)]+\.md)")


def main() -> int:
    """Build the site; return 0 if there were no warnings and no page loads anything from elsewhere."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=ROOT / "build" / "site", help="folder of the site [build/site]")
    out = parser.parse_args().out
    source = out.with_name(f"{out.name}-source")
    shutil.rmtree(out, ignore_errors=True)
    shutil.rmtree(source, ignore_errors=True)
    _gather(source)
    code = sphinx(["-b", "html", "-n", "-W", "--keep-going", "-q", "-j", "2", "-c", str(SITE), str(source), str(out)])
    shutil.rmtree(out / ".doctrees", ignore_errors=True)
    problems = offline.loaded_from_elsewhere(out)
    for problem in problems:
        print(problem, file=sys.stderr)
    if not code and not problems:
        print(f"wrote {out / 'index.html'}: {len(list(out.rglob('*.html')))} pages")
    return code or bool(problems)


def _gather(source: Path) -> None:
    """Copy the written pages, and write the generated ones beside them."""
    source.mkdir(parents=True)
    pages = {path: path.name for path in DOCS.glob("*.md")}
    pages |= {ROOT / name: page for name, page in _ELSEWHERE.items() if name != "README.md"}
    for path, page in pages.items():
        (source / page).write_text(_moved(path, source), encoding="utf-8")
    for folder in DOCS.iterdir():  # pictures of the pages
        if folder.is_dir() and folder != SITE:
            shutil.copytree(folder, source / folder.name)
    for name, heading in {**_UNSEARCHED, **_KEYWORDS}.items():
        page = source / name
        page.write_text(f"---\n{heading}\n---\n{page.read_text(encoding='utf-8')}", encoding="utf-8")
    (source / "cli.md").write_text(
        commands.completed((source / "cli.md").read_text(encoding="utf-8")), encoding="utf-8"
    )
    generated = {**requirement_pages.pages(), "statement.md": statement_keys.page(), "results.md": schemas.page()}
    for name, text in generated.items():
        page = source / name
        page.parent.mkdir(parents=True, exist_ok=True)
        page.write_text(text, encoding="utf-8")


def _moved(path: Path, source: Path) -> str:
    """Return a page whose links lead to pages of the site, and to copies of other files of the repository."""

    def link(found: re.Match[str]) -> str:
        target = (path.parent / found[1]).resolve()
        anchor = found[2] or ""
        if not target.is_relative_to(ROOT) or not target.exists():
            return found[0]  # broken, or to a generated page; Sphinx says which
        if target.is_relative_to(DOCS):
            return f"]({target.relative_to(DOCS)}{anchor})"
        name = target.relative_to(ROOT).as_posix()
        if name in _ELSEWHERE or target.suffix == ".md":
            return f"]({_ELSEWHERE.get(name, target.name)}{anchor})"
        copy = source / "files" / name
        copy.parent.mkdir(parents=True, exist_ok=True)
        if target.is_file():
            shutil.copyfile(target, copy)
        return f"](files/{name})"

    text = path.read_text(encoding="utf-8")
    return "".join(part if fenced else _LINK.sub(link, _UNTITLED.sub("[](", part)) for fenced, part in _parts(text))


def _parts(text: str) -> list[tuple[bool, str]]:
    """Return a page in parts, each with whether it is a fenced block."""
    parts = re.split(r"(^```.*?^```$)", text, flags=re.MULTILINE | re.DOTALL)
    return [(index % 2 == 1, part) for index, part in enumerate(parts)]


if __name__ == "__main__":
    sys.exit(main())
