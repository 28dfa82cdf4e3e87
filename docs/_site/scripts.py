"""Demos and notebooks as pages: read as they are, never run."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import jupytext
import nbformat
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from _site.thumbnails import write_thumbnail

#: The order of the gallery: what to read first. Others follow in the order of the alphabet.
DEMOS = (
    "hertz_sphere punch_2d cattaneo_mindlin patch_test sheared_block shrink_fit press_fit_edge "
    "bolted_joint bolted_stack five_links orthotropic tooth_flank chain_links snap_fit rubber_seal "
    "ball_imprint shallow_ironing lip_seal worn_bush power_module"
).split()
#: Endings of pictures that show bodies, the best thumbnails first.
BODIES = ("stress", "temperature", "status")


def not_pages(root: Path) -> list[str]:
    """Return scripts of notebooks whose executed notebook lies beside them: that one is the page."""
    executed = sorted((root / "notebooks").glob("*.ipynb"))
    return [str(path.with_suffix(".py").relative_to(root)) for path in executed] + ["notebooks/*.html"]


def read(text: str) -> nbformat.NotebookNode:
    """Read a script, in the light format or with percent signs, as a notebook without results."""
    notebook = jupytext.reads(text, fmt="py")
    notebook.cells = joined(notebook.cells)
    notebook.metadata["language_info"] = {"name": "python", "pygments_lexer": "python"}
    return notebook


def joined(cells: list[nbformat.NotebookNode]) -> list[nbformat.NotebookNode]:
    """Join code that only an empty line divides: it is one thought."""
    kept: list[nbformat.NotebookNode] = []
    for cell in cells:
        if kept and cell.cell_type == kept[-1].cell_type == "code":
            kept[-1].source += f"\n\n{cell.source}"
        else:
            kept.append(cell)
    return kept


def demos(root: Path) -> list[Path]:
    """Return the demos in the order of the gallery."""
    order = {name: number for number, name in enumerate(DEMOS)}
    return sorted(
        (root / "demos").glob("demo_*.py"),
        key=lambda path: (order.get(path.stem.removeprefix("demo_"), len(order)), path.stem),
    )


def notebooks(root: Path) -> list[Path]:
    """Return the notebooks, executed ones where there are."""
    patterns = ("[0-9]*.py", "[0-9]*.ipynb")
    found = {path.stem: path for pattern in patterns for path in (root / "notebooks").glob(pattern)}
    return [found[name] for name in sorted(found)]


def prose(path: Path) -> str:
    """Return the Markdown of a demo or notebook in one piece."""
    cells = nbformat.read(path, 4).cells if path.suffix == ".ipynb" else read(path.read_text()).cells
    return "\n\n".join(cell.source for cell in cells if cell.cell_type == "markdown")


def title(path: Path) -> str:
    """Return the first heading."""
    found = re.search(r"^# (.+)$", prose(path), re.MULTILINE)
    if found is None:
        raise ValueError(f"{path} needs a title, a first heading such as '# # A bolted joint'")
    return found[1]


def thumbnail(path: Path, root: Path) -> Path | None:
    """Return the picture of a card: of those in the text bodies before curves."""
    links = re.findall(r"!\[[^\]]*\]\(([^)]+\.png)\)", prose(path))
    name = path.stem.removeprefix("demo_")
    bodies = [root / "docs" / "pictures" / f"{name}_{kind}.png" for kind in BODIES]
    shown = [
        *filter(Path.exists, bodies),
        *filter(Path.exists, ((path.parent / link).resolve() for link in links)),
    ]
    return shown[0] if shown else None


def cards(paths: list[Path], root: Path) -> str:
    """Write a grid of cards, each with title and first picture, that lead to the pages."""
    grid = ["::::{grid} 1 2 2 3", ":gutter: 3", ":class-container: gallery", ""]
    for path in paths:
        picture = thumbnail(path, root)
        name, _, what = title(path).partition(": ")
        page = "/" + str(path.relative_to(root).with_suffix(""))
        grid += [f":::{{grid-item-card}} {name}", f":link: {page}", ":link-type: doc"]
        if picture:
            small = write_thumbnail(picture, root / "docs").relative_to(root)
            grid += [f":img-top: /{small}", f":img-alt: {name}"]
        grid += ["", what[:1].upper() + what[1:], ":::", ""]
    return "\n".join([*grid, "::::", ""])


def hidden_contents(paths: list[Path], root: Path) -> str:
    """Write the table of contents that puts the pages into the sidebar."""
    rows = [f"/{path.relative_to(root).with_suffix('')}" for path in paths]
    return "\n".join(["```{toctree}", ":hidden:", ":maxdepth: 1", "", *rows, "```", ""])


class Cards(SphinxDirective):
    """``{demo-cards}`` and ``{notebook-cards}``: cards for all of them, and their places in the sidebar."""

    def run(self) -> list[Any]:
        """Make the nodes."""
        root = Path(self.env.srcdir)
        paths = demos(root) if self.name == "demo-cards" else notebooks(root)
        self.env.note_reread()  # one may be new, or have another title
        return self.parse_text_to_nodes(cards(paths, root) + "\n" + hidden_contents(paths, root))


def add_download(app: Sphinx, name: str, source: list[str]) -> None:
    """Say below the title of a demo where its script is, and how to run it."""
    if not name.startswith("demos/"):
        return
    script = Path(name).name
    line = (
        f"# {{download}}`Download the script <{script}.py>` · `make demo DEMO={script.removeprefix('demo_')}`"
    )
    first, _, rest = source[0].partition("\n")
    source[0] = f"{first}\n#\n{line}\n{rest}"


def setup(app: Sphinx) -> dict[str, Any]:
    """Connect to Sphinx."""
    app.add_directive("demo-cards", Cards)
    app.add_directive("notebook-cards", Cards)
    app.connect("source-read", add_download)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
