"""What all figures share: size, colours, axes, and the way from a matplotlib figure to SVG inside a page.

Figures are small panels of one subject each, so that their text stays readable when a phone shows them at its
width; a page sets them side by side where it has room. Colours are Okabe and Ito's, which survive the common
kinds of colour blindness; nothing is told by colour alone. Drawing the same data gives the same octets.
"""

import io
import math
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import matplotlib as mpl
from lxml import etree
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter

INK, SOFT, LINE = "#16202a", "#55616d", "#d9dfe5"
COLOUR = {"rest": "#0072B2", "soap": "#D55E00", "rosbridge": "#009E73"}
MARK = {"rest": "o", "soap": "^", "rosbridge": "s"}
"""A sign for each interface beside its colour: the colours are one grey on a black and white printer."""
SPAN_COLOUR = {"build": "#E69F00", "wire": "#56B4E9", "server": "#009E73", "parse": "#CC79A7"}
SPAN_HATCH = {"build": "", "wire": "//", "server": "", "parse": "\\\\"}
PAPER_COLOUR = "#7a4d8f"
_WHOLE_MS = 10
"""Milliseconds from which a tick is a whole number."""
_DECADES_WITH_STEPS = 2
"""Decades up to which ticks stand at 1, 2 and 5; on a longer axis their labels would touch."""

_WIDTH, _HEIGHT, _DPI = 4.8, 3.4, 100
_STYLE: Any = {
    "svg.fonttype": "none",  # text stays text: it can be searched, copied and read aloud
    "svg.hashsalt": "roaas",
    "font.family": "sans-serif",
    "font.size": 9.75,  # 13 px at 4.8 inches for 480 px
    "axes.titlesize": 10.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.titlepad": 10,
    "axes.edgecolor": SOFT,
    "axes.labelcolor": SOFT,
    "axes.linewidth": 0.8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": LINE,
    "grid.linewidth": 0.7,
    "axes.axisbelow": True,
    "text.color": INK,
    "xtick.color": SOFT,
    "ytick.color": SOFT,
    "xtick.minor.size": 0,
    "ytick.minor.size": 0,
    "xtick.major.size": 3,
    "ytick.major.size": 0,
    "legend.frameon": False,
    "legend.handlelength": 1.8,
    "legend.borderaxespad": 0.2,
    "lines.linewidth": 1.9,
    "hatch.linewidth": 0.6,
}


@dataclass(frozen=True, slots=True)
class Picture:
    """One figure of a page: panels with a caption.

    Attributes:
        name: unique on its page; becomes the id.
        caption: what it shows and how to read it, a sentence or two.
        panels: the drawings as SVG.
    """

    name: str
    caption: str
    panels: tuple[Markup, ...]


class Panel:
    """One drawing that is being made: its axes, and how to hand it out."""

    def __init__(self, title: str, alt: str, height: float = _HEIGHT) -> None:
        self._figure = Figure(figsize=(_WIDTH, height), dpi=_DPI, layout="constrained")
        self._alt = alt
        self.axes: Axes = self._figure.add_subplot()
        self.axes.set_title(title)

    def legend(self, columns: int = 2) -> None:
        """Put the legend below the axes, where it hides nothing."""
        handles, labels = self.axes.get_legend_handles_labels()
        if handles:
            self._figure.legend(handles, labels, loc="outside lower left", ncols=columns)

    def svg(self, name: str) -> Markup:
        """The drawing as an SVG element whose ids all begin with `name`."""
        buffer = io.BytesIO()
        self._figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None})
        return Markup(_inline(buffer.getvalue(), name, self._alt))  # noqa: S704 - drawn here, its text escaped by lxml


@contextmanager
def drawing() -> Iterator[None]:
    """The style that every panel is made in."""
    with mpl.rc_context(_STYLE):
        yield


def _inline(document: bytes, name: str, alt: str) -> str:
    """Make an SVG document an element of a page: no ids that could clash, no size of its own, an alternative text."""
    root = etree.fromstring(document, etree.XMLParser(resolve_entities=False, no_network=True))
    svg = "{http://www.w3.org/2000/svg}"
    for element in [*root.iter(f"{svg}metadata"), *root.iter(f"{svg}style")]:
        parent = element.getparent()
        if parent is not None:
            parent.remove(element)
    for element in root.iter():
        for key, value in list(element.attrib.items()):
            text = str(value)
            if key == "id":
                element.set(key, f"{name}-{text}")
            elif key == "{http://www.w3.org/1999/xlink}href":
                del element.attrib[key]
                element.set("href", text.replace("#", f"#{name}-", 1))
            elif "url(#" in text:
                element.set(key, text.replace("url(#", f"url(#{name}-"))
    for key in ("width", "height", "version"):
        root.attrib.pop(key, "")
    root.set("role", "img")
    root.set("aria-label", alt)
    root.set("id", name)
    etree.cleanup_namespaces(root)
    text = etree.tostring(root, encoding="unicode")
    return re.sub(r"\n\s*", "\n", text)


def milliseconds(value: float) -> str:
    """A tick's label: 0.05, 1, 20, 1,000."""
    return f"{value:,.0f}" if value >= _WHOLE_MS else f"{value:g}"


def log_time_axis(axes: Axes, which: str, label: str) -> None:
    """Make an axis logarithmic, with milliseconds as plain numbers."""
    axis = axes.xaxis if which == "x" else axes.yaxis
    (axes.set_xscale if which == "x" else axes.set_yscale)("log")
    low, high = axes.get_xlim() if which == "x" else axes.get_ylim()
    decades = _decades(low, high)
    steps = (1.0, 2.0, 5.0) if decades <= _DECADES_WITH_STEPS else (1.0,)
    axis.set_major_locator(mpl.ticker.LogLocator(subs=steps, numticks=12))
    axis.set_major_formatter(FuncFormatter(lambda value, _: milliseconds(value)))
    axis.set_minor_formatter(NullFormatter())
    (axes.set_xlabel if which == "x" else axes.set_ylabel)(label)


def _decades(low: float, high: float) -> float:
    return math.log10(high / low) if low > 0 else 3.0


def gather(name: str, caption: str, panels: Sequence[Panel]) -> Picture | None:
    """Make a picture of its panels; None where there is nothing to draw."""
    if not panels:
        return None
    return Picture(name, caption, tuple(panel.svg(f"{name}-{number}") for number, panel in enumerate(panels)))
