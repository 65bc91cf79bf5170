"""Configuration of the documentation site; `make docs` builds it."""

import os
import sys
from pathlib import Path

import numba

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "docs")]
numba.config.DISABLE_JIT = 1            # kernels are then functions with docstrings and signatures

from extensions.sources import linkcode_resolve  # noqa: E402, F401

from mpm_ref import __version__  # noqa: E402

project = "mpm_ref"
author = "The mpm_ref authors"
copyright = "The mpm_ref authors, MIT licence"
version = release = __version__
language = "en"
smartquotes = False                     # options keep their two hyphens

extensions = [
    "myst_nb", "sphinx.ext.autodoc", "sphinx.ext.linkcode",
    "extensions.generate", "extensions.docstrings", "extensions.sources", "extensions.formulas",
    "extensions.cross_links",
]
exclude_patterns = ["_build", "results/generated", "extensions"]
nitpicky = True
nitpick_ignore_regex = [("py:.*", ".*")]        # types of other projects: nothing is fetched
suppress_warnings = ["config.cache"]

# API
autodoc_member_order = "bysource"
autodoc_mock_imports = ["torch", "vtk", "trimesh"]
autodoc_default_options = {"ignore-module-all": True}
autodoc_preserve_defaults = True
add_module_names = False
maximum_signature_line_length = 88

# Markdown and notebooks
myst_enable_extensions = ["dollarmath", "amsmath", "deflist"]
myst_dmath_double_inline = True
myst_heading_anchors = 3
myst_update_mathjax = False
nb_execution_mode = os.environ.get("MPM_REF_NOTEBOOKS", "cache")    # or "off"
nb_execution_cache_path = str(ROOT / "docs/_build/notebooks")
nb_execution_timeout = 600
nb_execution_raise_on_error = True
nb_ipywidgets_js = {}
nb_merge_streams = True

# HTML
html_theme = "pydata_sphinx_theme"
html_math_renderer = "mathml"
html_title = "mpm_ref documentation"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_copy_source = False
html_show_sourcelink = False
html_show_sphinx = False
html_theme_options = {
    "logo": {"text": "mpm_ref"},
    "show_toc_level": 2,
    "show_nav_level": 1,
    "navigation_depth": 3,
    "collapse_navigation": True,
    "navigation_with_keys": False,
    "navbar_align": "left",
    "secondary_sidebar_items": ["page-toc"],
    "footer_start": ["copyright"],
    "footer_end": [],
    "show_prev_next": True,
}
