"""Equations by MathJax: the copy that comes with Debian's FEniCSx where it is, else from the network."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

#: Debian's FEniCSx depends on PETSc's development files, and these on ``libjs-mathjax``, MathJax 2.
DEBIAN = Path("/usr/share/javascript/mathjax")
NETWORK = "https://cdn.jsdelivr.net/npm/mathjax@3/es5/tex-mml-chtml.js"
#: The part of the copy that pages need: TeX in, HTML with web fonts out.
PARTS = (
    "MathJax.js",
    "config/TeX-AMS_CHTML.js",
    "extensions/*.js",
    "extensions/TeX/*.js",
    "extensions/HTML-CSS/*.js",
    "fonts/HTML-CSS/TeX/woff/*",
    "jax/element/**/*.js",
    "jax/input/TeX/*.js",
    "jax/output/CommonHTML/**/*.js",
)
#: Only what Sphinx marks as an equation is one: a dollar sign in a listing is not.
CLASSES = {"ignore": ".*", "process": "math|output_area"}


def static_folder(root: Path) -> list[str]:
    """Gather Debian's MathJax in a folder for ``html_static_path``; return none where it is not installed."""
    if not (DEBIAN / "MathJax.js").is_file():
        return []
    folder = root / "output" / "docs-mathjax"
    for pattern in PARTS:
        for source in DEBIAN.glob(pattern):
            target = folder / "mathjax" / source.relative_to(DEBIAN)
            if source.is_file() and not target.exists():
                target.parent.mkdir(parents=True, exist_ok=True)
                temporary = target.with_suffix(f".{os.getpid()}")
                temporary.write_bytes(source.read_bytes())
                temporary.replace(target)
    return [str(folder)]


def configuration() -> tuple[str, dict[str, Any] | None, dict[str, Any] | None]:
    """Return Sphinx's ``mathjax_path``, ``mathjax2_config`` and ``mathjax3_config``."""
    if not (DEBIAN / "MathJax.js").is_file():
        options = {"ignoreHtmlClass": CLASSES["ignore"], "processHtmlClass": CLASSES["process"]}
        return NETWORK, None, {"options": options}
    two = {
        "config": ["TeX-AMS_CHTML.js"],
        "tex2jax": {
            "inlineMath": [["\\(", "\\)"]],
            "displayMath": [["\\[", "\\]"]],
            "ignoreClass": CLASSES["ignore"],
            "processClass": CLASSES["process"],
        },
        "CommonHTML": {"linebreaks": {"automatic": True}},
        "showMathMenu": False,
        "messageStyle": "none",
    }
    return "mathjax/MathJax.js", two, None
