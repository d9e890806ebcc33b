"""Make pages from Jinja templates: self-contained files that load nothing and send nothing.

Each page includes its style and its script, and a Content-Security-Policy that allows nothing else. The policy names
the script by its digest (CSP Level 3, section 2.3.1), so that text from a robot could not run as a script even if its
escaping were forgotten. Every page works without its script, which only adds copy buttons and a search box, and unfolds
everything for printing.
"""

import base64
import hashlib
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from secrets import token_hex
from typing import Any

from jinja2 import Environment, FileSystemBytecodeCache, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from reports.errors import ResultUnreadableError
from reports.pages.untrusted import beginning, code_block, code_span, coded, excerpt, plain, visible

TEMPLATE_DIR = Path(__file__).parent / "templates"


def html_page(template: str, **values: Any) -> str:
    """Return an HTML page: the named template filled with the values, which are escaped unless they are `Markup`."""
    script = _asset("page.js")
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    policy = (
        f"default-src 'none'; style-src 'unsafe-inline'; script-src 'sha256-{digest}'; "
        "base-uri 'none'; form-action 'none'"
    )
    return (
        _environment(html=True)
        .get_template(template)
        .render(
            policy=policy,
            # These two are our own files and contain nothing from a result.
            script=Markup(script),  # noqa: S704 - our own file
            style=Markup(_asset("page.css")),  # noqa: S704 - our own file
            generator_name=f"RoAAS {suite_version()}",
            **values,
        )
    )


def markdown_page(template: str, **values: Any) -> str:
    """Return Markdown: the named template filled with the values; the templates escape external text by filters."""
    return _environment(html=False).get_template(template).render(generator_name=f"RoAAS {suite_version()}", **values)


def write_pages(directory: Path, pages: dict[str, str]) -> list[Path]:
    """Write pages, given by file name, into a directory, and return their paths.

    Each is written to a temporary file first, so that an interrupted run leaves the old page or the new one.

    Raises:
        ResultUnreadableError: the directory cannot be made or written to.
    """
    try:
        directory.mkdir(parents=True, exist_ok=True)
        for name, text in pages.items():
            # An unpredictable name, opened as a new file: a link with a known name could lead elsewhere.
            draft = directory / f".{name}.{token_hex(4)}.part"
            try:
                with draft.open("x", encoding="utf-8") as file:
                    file.write(text)
                draft.replace(directory / name)
            finally:
                draft.unlink(missing_ok=True)
    except OSError as error:
        raise ResultUnreadableError(f"{directory}: cannot write there: {error.strerror or error}") from error
    return [directory / name for name in pages]


def suite_version() -> str:
    """Return the version of the installed `roaas` distribution, or "unknown" if it is not installed."""
    try:
        return version("roaas")
    except PackageNotFoundError:
        return "unknown"


@cache
def _environment(*, html: bool) -> Environment:
    environment = Environment(
        loader=FileSystemLoader(TEMPLATE_DIR),
        bytecode_cache=_template_cache(),
        autoescape=html,  # noqa: S701 - off for Markdown alone, where HTML entities would be shown as such
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        finalize=_finalize,
    )
    environment.filters.update(
        beginning=beginning,
        code_span=code_span,
        coded=coded,
        code_block=code_block,
        counted=counted,
        excerpt=excerpt,
        grouped=grouped,
        opened=opened,
        plain=plain,
    )
    return environment


def _template_cache() -> FileSystemBytecodeCache | None:
    """Return Jinja's folder for compiled templates, which is the user's own, or None where there is none."""
    try:
        return FileSystemBytecodeCache()
    except (OSError, RuntimeError):  # no temporary folder, or one that belongs to somebody else
        return None


def _finalize(value: Any) -> Any:
    """Escape unprintable characters in a template's `{{ … }}` text; return `Markup` unchanged."""
    if isinstance(value, str) and not isinstance(value, Markup):
        return visible(value)
    return value


def opened(text: str) -> str:
    """Return the text with its first letter in upper case."""
    return text[:1].upper() + text[1:]


def counted(number: int, noun: str, ending: str = "s") -> str:
    """Return a number with its noun: 1 request, 2,000 requests."""
    return f"{number:,} {noun}{'' if number == 1 else ending}"


def grouped(number: float) -> str:
    """Return a number with commas between thousands: 12,345."""
    return f"{number:,}"


@cache
def _asset(name: str) -> str:
    return (TEMPLATE_DIR / name).read_text(encoding="utf-8")
