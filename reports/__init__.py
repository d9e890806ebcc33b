"""Turns result files into what people read.

`render(directory)` writes everything that belongs to the result files of a directory; `reports.errors` names
what can be wrong with them.
"""

from reports.rendering import render

__all__ = ["render"]
