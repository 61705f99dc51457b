"""The documentation: Markdown pages whose code is executed, and an API page out of the docstrings."""

import os
import sys
from importlib.metadata import version as installed_version
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))
import datasets

project = "locbounds"
copyright = "the locbounds authors"
version = release = installed_version("locbounds")

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.mathjax",
    "numpydoc",
    "sphinxcontrib.bibtex",
    "sphinx-mathjax-offline",
]
exclude_patterns = ["_build"]
templates_path = ["_templates"]
html_theme = "alabaster"
html_theme_options = {"description": "Accuracy bounds for localization over LOS/NLOS links"}

# Pages: formulas in dollars, every code cell executed anew, an error in a cell fails the build.
myst_enable_extensions = ["amsmath", "colon_fence", "deflist", "dollarmath"]
nb_execution_mode = "force"
nb_execution_raise_on_error = False  # a warning, which fails the build and, unlike the exception, shows the traceback
nb_execution_timeout = 300
nb_execution_show_tb = True
nb_merge_streams = True
nb_render_markdown_format = "gfm"  # tables that a cell makes
os.environ.setdefault("LOCBOUNDS_DATA", str(datasets.folder()))  # the kernels that execute the pages inherit it
needs = {  # shown without output where one is missing
    "range-log.md": ("wifi_rtt_walks",),
    "burst-log.md": ("uwb_outdoor",),
    "error-laws.md": ("wifi_rtt_grid", "wifi_rtt_walks"),
}
nb_execution_excludepatterns = [page for page, sets in needs.items() if None in map(datasets.find, sets)]

# API: one page per public name, from its NumPy-style docstring.
autosummary_generate = True
autosummary_ignore_module_all = False
autosummary_imported_members = True
autodoc_typehints = "none"
numpydoc_show_class_members = False

bibtex_bibfiles = ["references.bib"]
bibtex_default_style = "alpha"
bibtex_reference_style = "author_year"
