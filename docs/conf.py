"""How the guide is built: ``sphinx-build -W -b html docs docs/_build``; warnings are errors."""

import sys
from importlib.metadata import version as version_of
from pathlib import Path

from docutils import nodes
from latex2mathml.converter import convert

sys.path[:0] = [str(Path(__file__).resolve().parent), str(Path(__file__).resolve().parents[1])]

from write_notebooks import write_notebooks  # noqa: E402

project = "sindyjoint"
author = "The sindyjoint authors"
copyright = author
release = version = version_of("sindyjoint")
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
myst_enable_extensions = ["dollarmath", "amsmath", "deflist"]
# Headings down to the third level can be linked to.
myst_heading_anchors = 3
autodoc_member_order = "bysource"
autodoc_typehints = "none"
napoleon_google_docstring = False
napoleon_use_ivar = True
exclude_patterns = ["_build", "_templates", "notebooks"]
html_theme = "furo"
html_static_path = ["_static"]
html_css_files = ["guide.css"]
templates_path = ["_templates"]
html_show_sphinx = False
# MathML is typeset by the browser: the guide asks nothing of the net.
html_math_renderer = "mathml"
html_title = f"sindyjoint {release}"


def inline_math(translator, node):
    """Write a formula within a line."""
    translator.body.append(convert(node.astext()))
    raise nodes.SkipNode


def display_math(translator, node):
    """Write a formula on lines of its own."""
    translator.body.append(f"<div class='math'>{convert(node.astext(), display='block')}</div>")
    raise nodes.SkipNode


def setup(app):
    """Tell Sphinx how formulas are written, and write the examples as notebooks."""
    write_notebooks()
    app.add_html_math_renderer("mathml", (inline_math, None), (display_math, None))
    return {"parallel_read_safe": True}
