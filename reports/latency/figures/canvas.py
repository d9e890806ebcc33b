"""Define what all figures share: size, colours, axes, and the conversion of a matplotlib figure to inline SVG.

A figure consists of small panels, so that its text stays readable on a phone; a page sets them side by side where it
has room. The colours are Okabe and Ito's, which people with the common kinds of colour blindness can tell apart. No
meaning depends on colour alone. The same data gives the same SVG, byte for byte.
"""

import io
import math
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import wraps
from textwrap import fill
from typing import Any, ParamSpec

import matplotlib as mpl
from lxml import etree
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter

from reports.pages.untrusted import visible

P = ParamSpec("P")
INK, SOFT, LINE = "#16202a", "#55616d", "#d9dfe5"
COLOUR = {"rest": "#0072B2", "soap": "#D55E00", "rosbridge": "#009E73", "both": "#7a4d8f"}
MARK = {"rest": "o", "soap": "^", "rosbridge": "s", "both": "D"}
"""A marker for each interface beside its colour, because a black and white printer shows one grey."""
SPAN_COLOUR = {"build": "#E69F00", "wire": "#56B4E9", "server": "#009E73", "parse": "#CC79A7"}
SPAN_HATCH = {"build": "", "wire": "//", "server": "", "parse": "\\\\"}
PAPER_COLOUR = "#7a4d8f"
_WHOLE_MS = 10
"""Milliseconds from which a tick label is a whole number."""
_TITLE, LABEL = 48, 26
"""Characters of a title, and of the label of a row, that fit on one line: names of operations may be longer."""
_DECADES_WITH_STEPS = 2
"""Up to this many decades there are ticks at 1, 2 and 5; on a longer axis their labels would touch."""

_WIDTH, _HEIGHT, _DPI = 4.8, 3.4, 100
_STYLE: Any = {
    "svg.fonttype": "none",  # text stays text: it can be searched, copied and read aloud
    "svg.hashsalt": "roaas",
    "text.parse_math": False,  # a $ in the path of an operation is no formula
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
    "legend.handlelength": 3.0,
    "legend.borderaxespad": 0.2,
    "lines.linewidth": 1.9,
    "hatch.linewidth": 0.6,
}


@dataclass(frozen=True, slots=True)
class Picture:
    """A figure of a page: panels with a caption.

    Attributes:
        name: unique on its page; it becomes the HTML id.
        caption: text that says what the figure shows and how to read it.
        panels: the drawings as SVG.
    """

    name: str
    caption: str
    panels: tuple[Markup, ...]


class Panel:
    """A drawing: a matplotlib figure with one pair of axes."""

    def __init__(self, title: str, alt: str, height: float = _HEIGHT) -> None:
        self._figure = Figure(figsize=(_WIDTH, height), dpi=_DPI, layout="constrained")
        self._alt = alt
        self.axes: Axes = self._figure.add_subplot()
        self.axes.set_title(fill(title, _TITLE))

    def legend(self, columns: int = 2) -> None:
        """Put the legend below the axes, where it covers nothing."""
        handles, labels = self.axes.get_legend_handles_labels()
        if handles:
            self._figure.legend(handles, labels, loc="outside lower left", ncols=columns)

    def svg(self, name: str) -> Markup:
        """Return the drawing as an SVG element in which every id begins with `name`."""
        buffer = io.BytesIO()
        self._figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None})
        drawn = visible(buffer.getvalue().decode()).encode()  # XML allows no control characters
        return Markup(_inline(drawn, name, self._alt))  # noqa: S704 - drawn here, its text escaped by lxml


def picture(name: str, caption: str) -> Callable[[Callable[P, Iterator[Panel]]], Callable[P, Picture | None]]:
    """Decorate a function that yields panels so that it returns their `Picture`, or None if it yields none."""

    def decorate(panels: Callable[P, Iterator[Panel]]) -> Callable[P, Picture | None]:
        @wraps(panels)
        def draw(*args: P.args, **kwargs: P.kwargs) -> Picture | None:
            with mpl.rc_context(_STYLE):
                drawn = [panel.svg(f"{name}-{number}") for number, panel in enumerate(panels(*args, **kwargs))]
            return Picture(name, caption, tuple(drawn)) if drawn else None

        return draw

    return decorate


def _inline(document: bytes, name: str, alt: str) -> str:
    """Return an SVG document as an element for an HTML page.

    Its ids are prefixed with `name`, `alt` becomes its alternative text, and its fixed size is removed.
    """
    root = etree.fromstring(document, etree.XMLParser(resolve_entities=False, no_network=True))
    etree.strip_elements(root, "{http://www.w3.org/2000/svg}metadata", "{http://www.w3.org/2000/svg}style")
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
    root.set("aria-label", visible(alt))
    root.set("id", name)
    etree.cleanup_namespaces(root)
    return re.sub(r"\n\s*", "\n", etree.tostring(root, encoding="unicode"))


def milliseconds(value: float) -> str:
    """Return the label of an axis tick in milliseconds: 0.05, 1, 20, 1,000."""
    return f"{value:,.0f}" if value >= _WHOLE_MS else f"{value:g}"


def log_time_axis(axes: Axes, label: str) -> None:
    """Make the y axis logarithmic, with milliseconds as plain numbers, and set its label."""
    axes.set_yscale("log")
    low, high = axes.get_ylim()
    decades = math.log10(high / low) if low > 0 else 3.0
    steps = (1.0, 2.0, 5.0) if decades <= _DECADES_WITH_STEPS else (1.0,)
    axes.yaxis.set_major_locator(mpl.ticker.LogLocator(subs=steps, numticks=12))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: milliseconds(value)))
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.set_ylabel(label)
