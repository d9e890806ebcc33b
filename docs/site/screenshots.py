"""Take the pictures of docs/images from real results: ``python docs/site/screenshots.py out`` after ``make demo``.

It needs Chromium. Each picture shows the top of a page, as a reader on a desktop sees it.
"""

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

IMAGES = Path(__file__).parents[1] / "images"
MOST_OCTETS = 150_000
# The page, the picture, and how much of the page it shows, in pixels.
_PICTURES = (("certificate.html", "certificate.png", (1000, 880)), ("latency.html", "latency.png", (1000, 1000)))
_DEADLINE_S = 60


def main() -> int:
    """Take each picture; return 0 unless one is missing or too large."""
    if len(sys.argv) != 2:  # noqa: PLR2004 - the folder
        print(__doc__, file=sys.stderr)
        return 2
    chromium = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    if chromium is None:
        print("missing: chromium", file=sys.stderr)
        return 2
    IMAGES.mkdir(exist_ok=True)
    problems = 0
    for page, picture, size in _PICTURES:
        source, target = Path(sys.argv[1], page).resolve(), IMAGES / picture
        if not source.is_file():
            print(f"{source} is not there; `make demo` writes it", file=sys.stderr)
            return 2
        take(chromium, source.as_uri(), target, size)
        octets = target.stat().st_size
        print(f"wrote {target}: {octets:,} bytes")
        problems += octets > MOST_OCTETS
    return problems and 1


def take(chromium: str, address: str, target: Path, size: tuple[int, int], *options: str) -> None:
    """Write a picture of the top of a page.

    Raises:
        subprocess.SubprocessError: Chromium failed, or did not end in time.
    """
    with tempfile.TemporaryDirectory() as profile:
        subprocess.run(
            [chromium, "--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", f"--user-data-dir={profile}",
             f"--window-size={size[0]},{size[1]}", f"--screenshot={target.resolve()}", *options, address],
            check=True, capture_output=True, timeout=_DEADLINE_S,
        )  # fmt: skip


if __name__ == "__main__":
    sys.exit(main())
