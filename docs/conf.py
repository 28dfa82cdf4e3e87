"""Sphinx builds the documentation with this: `make docs`.

The source folder is the root of the project, not `docs/`: demos, notebooks, benchmarks and the changelog are
pages where they are, so that one relative link serves both here and where the files are read as they are.
Nothing is executed, and nothing is fetched.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
sys.path[:0] = [str(ROOT), str(HERE)]

from _site import equations, reference, scripts  # noqa: E402

import fenics_contact  # noqa: E402

project = "fenics_contact"
author = "The fenics_contact developers"
release = fenics_contact.__version__
language = "en"
html_title = "fenics_contact"

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.mathjax",
    "sphinx.ext.napoleon",
    "sphinx.ext.viewcode",
    "sphinx_copybutton",
    "sphinx_design",
    "_site.links",
    "_site.reference",
    "_site.scripts",
]

# What is a page.
root_doc = "docs/index"
reference.write_pages(HERE / "reference")
include_patterns = [
    "docs/**",
    "benchmarks/*.md",
    "demos/demo_*.py",
    "notebooks/[0-9]*",
    "CHANGELOG.md",
    "CODE_OF_CONDUCT.md",
    "CONTRIBUTING.md",
    "SECURITY.md",
]
exclude_patterns = [
    *(f"docs/{name}" for name in ("conf.py", "_site", "_static")),
    *scripts.not_pages(ROOT),
    "**/.ipynb_checkpoints",
    "**/_*",
]

# Markdown and notebooks.
nb_execution_mode = "off"
nb_custom_formats = {".py": ["_site.scripts.read", {}]}
nb_merge_streams = True
myst_enable_extensions = ["amsmath", "attrs_inline", "colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 4
myst_dmath_double_inline = True

# Reference.
default_role = "py:obj"
autodoc_default_options = {"members": True, "exclude-members": "model_config"}
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_typehints_format = "short"
autodoc_preserve_defaults = True
autosummary_generate = False
napoleon_google_docstring = True
napoleon_numpy_docstring = False
napoleon_attr_annotations = False
napoleon_use_rtype = False
add_module_names = False
python_maximum_signature_line_length = 80
python_use_unqualified_type_names = True
toc_object_entries_show_parents = "hide"
nitpicky = True
nitpick_ignore_regex = reference.OUTSIDE

# The look.
html_theme = "furo"
html_static_path = ["_static", *equations.static_folder(ROOT)]
html_css_files = ["site.css"]
html_extra_path = ["_site/root"]
html_copy_source = False
html_show_copyright = False
html_show_sphinx = False
html_theme_options = {"navigation_with_keys": True}
pygments_style = "friendly"
pygments_dark_style = "github-dark"
copybutton_prompt_text = r">>> |\.\.\. |\$ "
copybutton_prompt_is_regexp = True
mathjax_path, mathjax2_config, mathjax3_config = equations.configuration()
myst_update_mathjax = False


def setup(app: Any) -> None:
    """Return where the sources of types are."""
    app.connect("viewcode-follow-imported", reference.source_of)
