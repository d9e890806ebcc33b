"""Sphinx's configuration of the documentation site, which docs/site/build.py builds."""

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
