"""Run the notebooks from top to bottom and keep what they show.

    python notebooks/execute.py              all of them
    python notebooks/execute.py 01 04        some
    python notebooks/execute.py --no-html    without the pages

A notebook is written in the text file ``NN_name.py`` (jupytext, percent format). This program runs it in a
kernel of its own, with the Python that runs the program, and writes ``NN_name.ipynb`` with all results beside
it, a page ``output/notebooks/NN_name.html``, and the picture of the cell tagged "cover", which stands on top
of the notebook, to ``docs/pictures/notebooks/NN_name.png``. It stops at the first cell that fails or warns;
every file is written whole or not at all.
"""

from __future__ import annotations

import argparse
import base64
import os
import re
import sys
import tempfile
import time
from itertools import pairwise
from pathlib import Path

import jupytext
import nbformat
from jupyter_client import AsyncKernelManager
from jupyter_client.kernelspec import KernelSpecManager
from nbclient import NotebookClient
from nbclient.exceptions import CellExecutionError
from nbconvert import HTMLExporter
from nbformat import NotebookNode

from fenics_contact.output.files import replacing

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
PAGES = ROOT / "output" / "notebooks"
COVERS = ROOT / "docs" / "pictures" / "notebooks"
#: Seconds that one cell may take.
PATIENCE = 600
#: The same whichever Python runs the notebooks.
LANGUAGE = {"name": "python", "pygments_lexer": "ipython3"}


def sources(wanted: list[str] | None = None) -> list[Path]:
    """Return the text sources, all or those whose names begin with one of the words."""
    found = sorted(HERE.glob("[0-9][0-9]_*.py"))
    return [path for path in found if not wanted or path.name.startswith(tuple(wanted))]


def read_source(path: Path) -> NotebookNode:
    """Return the notebook of a text source, without results; the same bytes give the same notebook."""
    text = jupytext.read(path)
    notebook = nbformat.v4.new_notebook(metadata={"kernelspec": dict(text.metadata["kernelspec"])})
    notebook.metadata["language_info"] = LANGUAGE
    for number, cell in enumerate(text.cells):
        new = nbformat.v4.new_code_cell if cell.cell_type == "code" else nbformat.v4.new_markdown_cell
        tags = {key: value for key, value in cell.metadata.items() if key == "tags"}
        notebook.cells.append(new(cell.source, metadata=tags, id=f"cell-{number:02d}"))
    return notebook


def execute(notebook: NotebookNode, folder: Path = ROOT) -> NotebookNode:
    """Run all cells in the folder, in a new kernel of this very Python; the results go into the notebook.

    Raises:
        CellExecutionError: If a cell fails.
    """
    with tempfile.TemporaryDirectory() as private:  # sockets, and nobody's start-up files
        # Of all kernels called python3 on this machine the one of this Python: no folder is searched.
        manager = AsyncKernelManager(
            kernel_name="python3",
            kernel_spec_manager=KernelSpecManager(kernel_dirs=[]),
            transport="ipc",
            ip=str(Path(private) / "kernel"),
        )
        client = NotebookClient(
            notebook,
            km=manager,
            timeout=PATIENCE,
            resources={"metadata": {"path": str(folder)}},
            record_timing=False,
            coalesce_streams=True,
        )
        client.execute(env={**os.environ, "IPYTHONDIR": private}, cleanup_kc=True)
    notebook.metadata["language_info"] = LANGUAGE
    describe(notebook)
    return notebook


def complaints(notebook: NotebookNode) -> list[str]:
    """List what no stored notebook may show: warnings, and places on one machine."""
    found = []
    for number, cell in enumerate(notebook.cells):
        for output in cell.get("outputs", ()):
            if output.output_type == "error" or output.get("name") == "stderr":
                found.append(f"cell {number} wrote to stderr: {output.get('text', output.get('evalue'))}")
            for text in texts(output):
                found += [
                    f"cell {number} names a place on this machine: {line}"
                    for line in text.splitlines()
                    if any(place in line for place in (str(ROOT), str(Path.home()) + "/", "/tmp/"))
                ]
    return found


def texts(output: NotebookNode) -> list[str]:
    """Return the words of one result of a cell."""
    data = output.get("data", {})
    return [output.get("text", ""), data.get("text/plain", ""), data.get("text/html", "")]


def cover(notebook: NotebookNode) -> bytes | None:
    """Return the picture (PNG) of the cell tagged "cover", None where no cell is."""
    for cell in notebook.cells:
        if "cover" in cell.metadata.get("tags", ()):
            shown = [output.get("data", {}) for output in cell.outputs]
            return base64.b64decode([data["image/png"] for data in shown if "image/png" in data][-1])
    return None


def keep(notebook: NotebookNode, source: Path) -> Path:
    """Write the notebook with its results beside its source, and the picture that stands on top of it."""
    picture = cover(notebook)
    if picture is not None:
        with replacing(COVERS / f"{source.stem}.png") as (hidden,):
            hidden.write_bytes(picture)
    target = source.with_suffix(".ipynb")
    with replacing(target) as (hidden,):
        hidden.write_text(nbformat.writes(notebook) + "\n", encoding="utf-8")
    return target


def describe(notebook: NotebookNode) -> None:
    """Give each picture the words of its caption, for those who cannot see it.

    A caption is the first paragraph, in italics, of the cell of text that follows the picture.
    """
    for cell, after in pairwise(notebook.cells):
        first = after.source.split("\n\n")[0]
        for output in cell.get("outputs", ()):
            if "image/png" in output.get("data", {}) and first.startswith("*") and first.endswith("*"):
                words = " ".join(first.strip("*").split()).replace("*", "").replace("$", "")
                output.metadata.setdefault("image/png", {})["alt"] = words


def write_page(stored: Path) -> Path:
    """Write a stored notebook as one HTML file with its pictures in it; links lead to the other pages."""
    notebook = nbformat.read(stored, as_version=4)
    for cell in notebook.cells:
        if cell.cell_type == "markdown":
            cell.source = cell.source.replace("](../", "](")  # pictures are looked for below one folder
            cell.source = re.sub(r"(\]\(\d\d_\w+)\.ipynb\)", r"\1.html)", cell.source)
    place = {"metadata": {"path": str(ROOT), "name": stored.stem}}
    page, _ = HTMLExporter(embed_images=True).from_notebook_node(notebook, place)
    target = PAGES / f"{stored.stem}.html"
    with replacing(target) as (hidden,):
        hidden.write_text(page, encoding="utf-8")
    return target


def main(arguments: list[str] | None = None) -> int:
    """Run the notebooks asked for; return the exit code."""
    parser = argparse.ArgumentParser(description="Run the notebooks and keep what they show.")
    parser.add_argument("numbers", nargs="*", help="beginnings of names, such as 01; all by default")
    parser.add_argument("--no-html", action="store_true", help="write no pages")
    options = parser.parse_args(arguments)
    chosen = sources(options.numbers)
    if not chosen:
        parser.error(f"no notebook begins with {options.numbers}: there are {[p.stem for p in sources()]}")
    for source in chosen:
        begin = time.perf_counter()
        try:
            notebook = execute(read_source(source))
        except CellExecutionError as error:
            print(f"{source.name}: a cell failed\n{error}", file=sys.stderr)
            return 1
        seconds = time.perf_counter() - begin
        wrong = complaints(notebook)
        if wrong:
            print("\n".join(f"{source.name}: {line}" for line in wrong), file=sys.stderr)
            return 1
        stored = keep(notebook, source)
        page = "" if options.no_html else f", page {write_page(stored).relative_to(ROOT)}"
        size = stored.stat().st_size / 1e6
        print(f"{stored.relative_to(ROOT)}: {seconds:.0f} s, {size:.2f} MB{page}", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
