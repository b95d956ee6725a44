"""How the documentation is built: ``make docs``. Nothing is fetched, then or when a page is read."""

import os
import sys
from importlib.metadata import version as version_of
from pathlib import Path

os.environ["GAPWALK_PROGRESS"] = "off"  # lines that vanish would leave empty outputs
os.environ.pop("MPLBACKEND", None)  # with a backend of the user's, notebooks would show no pictures
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)  # each of 49 notebooks would compile gapwalk again, for two seconds
sys.path.insert(0, str(Path(__file__).parent / "_ext"))
sys.path.insert(0, str(Path(__file__).parents[1]))

from docs._ext.api_links import enumerations, members_left_out

sys.dont_write_bytecode = False
project = "gapwalk"
author = "the gapwalk developers"
version = release = version_of("gapwalk")
copyright = f"{author}. gapwalk {version}, MIT licence; CITATION.cff says how to cite it"

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.napoleon",
    "mathml",
    "file_reference",
    "api_links",
    "docstrings",
    "notebooks",
]
root_doc = "index"
exclude_patterns = ["_ext", "_templates"]
templates_path = ["_templates"]
default_role = "py:obj"  # single backticks in docstrings link what has a page

myst_enable_extensions = ["colon_fence", "dollarmath", "deflist"]
myst_heading_anchors = 3

# The code of the pages is run when they are built: what they show is what it gives.
nb_execution_mode = "cache"
nb_execution_raise_on_error = True
nb_execution_timeout = 600
nb_merge_streams = True

autosummary_generate = True
autosummary_context = {"enumerations": enumerations(), "left_out": members_left_out()}
autodoc_typehints = "none"  # `docstrings` writes types next to the names, with shapes and units
autodoc_preserve_defaults = True
autodoc_use_type_comments = False
napoleon_google_docstring = False
napoleon_use_rtype = False
napoleon_use_ivar = True

html_theme = "furo"
html_title = "gapwalk"
html_static_path = ["_static"]
html_css_files = ["gapwalk.css"]
html_search_scorer = str(Path(__file__).parent / "_ext" / "scorer.js")
html_show_copyright = False
html_use_index = False  # the search finds names
html_domain_indices = False
html_math_renderer = "mathml"
html_copy_source = False
html_show_sphinx = False
html_theme_options = {
    "light_css_variables": {"color-brand-primary": "#0b5c8c", "color-brand-content": "#0b5c8c"},
    "dark_css_variables": {"color-brand-primary": "#7cc4f0", "color-brand-content": "#7cc4f0"},
}


def around(app, page, template, context, doctree):
    """Show beside a page the part of the contents that is around it: all of them would cost a minute and 8 MB."""
    if whole := context.get("toctree"):
        context["toctree"] = lambda **options: whole(**{**options, "collapse": True})


def setup(app):
    """Do so before the theme asks for the contents."""
    app.connect("html-page-context", around, priority=100)
