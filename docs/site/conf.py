"""Sphinx's configuration of the documentation site, which docs/site/build.py builds."""

from pathlib import Path

from sphinx.search import languages
from sphinx.search.en import SearchEnglish

_FILLERS = (
    "about after all am an any because can cannot do does doing don each every from get give had has have how i "
    "its just know let like make me mean means much my need one our should so some still tell than them "
    "thing us use want way we were what when where which while who why without would you your"
)


class _Questions(SearchEnglish):
    """English, and people who type a whole question: a page need not have these words to be found."""

    stopwords = SearchEnglish.stopwords | frozenset(_FILLERS.split())


languages["en"] = _Questions
html_search_scorer = str(Path(__file__).with_name("scorer.js"))
project = "RoAAS"
copyright = "the RoAAS authors. Apache-2.0"  # noqa: A001 - Sphinx's name
html_title = "RoAAS"
extensions = ["myst_parser", "sphinx_copybutton"]
myst_heading_anchors = 6  # the anchors that GitHub gives headings
myst_enable_extensions = ["deflist", "attrs_block"]
nitpicky = True
html_theme = "furo"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_show_sphinx = False
html_copy_source = False
html_domain_indices = False
html_use_index = False
html_permalinks_icon = "#"
copybutton_prompt_text = "$ "
pygments_style = "tango"
pygments_dark_style = "monokai"
html_theme_options = {"navigation_with_keys": True}
