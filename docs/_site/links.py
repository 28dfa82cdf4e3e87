"""Links between files of the project, where the pages need others."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from sphinx.application import Sphinx

_PICTURE = re.compile(r"!\[[^\]]*\]\(([^)\s]+\.png)\)")
_NOTEBOOK = re.compile(r"\]\((\w+\.ipynb)\)")
_SCRIPT = re.compile(r"(?<!!)\[([^\]]+)\]\(([^)\s:]+\.py)\)")


def rewrite(app: Sphinx, name: str, source: list[str]) -> None:
    """Rewrite the links of a page before it is read."""
    folder = (Path(app.srcdir) / name).parent
    if name.startswith("notebooks/"):
        source[0] = not_run_yet(source[0], folder)
    elif not name.startswith("demos/"):
        source[0] = scripts_to_download(source[0], folder, app)


def not_run_yet(text: str, folder: Path) -> str:
    """Lead to the script of a notebook that was not run; leave out pictures that it would draw."""

    def link(found: re.Match[str]) -> str:
        return found[0] if (folder / found[1]).exists() else found[0].replace(".ipynb", ".py")

    def picture(found: re.Match[str]) -> str:
        return found[0] if (folder / found[1]).exists() else ""

    return _PICTURE.sub(picture, _NOTEBOOK.sub(link, text))


def scripts_to_download(text: str, folder: Path, app: Sphinx) -> str:
    """Offer scripts that are no pages, such as tests, to be downloaded."""

    def link(found: re.Match[str]) -> str:
        target = (folder / found[2]).resolve()
        if not target.is_file() or app.env.path2doc(target) in app.env.found_docs:
            return found[0]
        words = found[1].replace("`", "")
        return f"{{download}}`{words} <{found[2]}>`"

    return _SCRIPT.sub(link, text)


def setup(app: Sphinx) -> dict[str, Any]:
    """Connect to Sphinx."""
    app.connect("source-read", rewrite)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
