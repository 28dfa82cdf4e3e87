"""What is stored of the notebooks belongs to their sources, is complete, and can be shown to anybody."""

from __future__ import annotations

import base64
import re
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from tests.conftest import ROOT
from tests.notebooks.stored import FOLDER, NAMES, asserted_numbers, program, source, stored

MOST_BYTES, MOST_LINES = 1_500_000, 15


def code_cells(notebook: Any) -> list[Any]:
    return [cell for cell in notebook.cells if cell.cell_type == "code"]


def test_there_are_seven_notebooks() -> None:
    assert [name[:2] for name in NAMES] == ["01", "02", "03", "04", "05", "06", "07"]
    assert sorted(path.stem for path in FOLDER.glob("*.ipynb")) == NAMES


@pytest.mark.parametrize("name", NAMES)
def test_a_stored_notebook_is_that_of_its_source(name: str) -> None:
    found, wanted = stored(name), source(name)
    assert len(wanted.cells) > 10
    for cell, expected in zip(found.cells, wanted.cells, strict=True):
        assert (cell.cell_type, cell.source, cell.id) == (expected.cell_type, expected.source, expected.id)
    assert found.metadata == wanted.metadata
    assert found.metadata.kernelspec.name == "python3"


@pytest.mark.parametrize("name", NAMES)
def test_a_stored_notebook_was_run_from_top_to_bottom(name: str) -> None:
    notebook = stored(name)
    program().nbformat.validate(notebook)
    cells = code_cells(notebook)
    assert [cell.execution_count for cell in cells] == list(range(1, len(cells) + 1))
    shows = [
        cell for cell in cells if "print(" in cell.source or cell.source.splitlines()[-1].startswith("plot_")
    ]
    assert len(shows) >= 5
    assert all(cell.outputs for cell in shows)
    assert len(asserted_numbers(notebook)) >= 2


@pytest.mark.parametrize("name", NAMES)
def test_a_stored_notebook_shows_no_warning_and_no_place_on_a_machine(name: str) -> None:
    assert program().complaints(stored(name)) == []
    text = (FOLDER / f"{name}.ipynb").read_text()
    assert len(text.encode()) < MOST_BYTES
    assert "it/s]" not in text, "a progress bar"
    assert str(Path.home()) + "/" not in text


@pytest.mark.parametrize("name", NAMES)
def test_cells_are_short_and_each_has_its_reason_before_it(name: str) -> None:
    notebook = source(name)
    for before, cell in zip([None, *notebook.cells], notebook.cells, strict=False):
        if cell.cell_type == "code":
            code = re.sub(r"import \([^)]*\)", "import ...", cell.source)
            assert len([line for line in code.splitlines() if line.strip()]) <= MOST_LINES, cell.source
            after_imports = before is not None and before.cell_type == "code" and "import" in before.source
            assert after_imports or (before is not None and before.cell_type == "markdown"), cell.source
    words = "\n".join(cell.source for cell in notebook.cells if cell.cell_type == "markdown")
    assert words.startswith("# ")
    assert "## What to try next" in words
    assert "$$" in words or "$" in words, "equations"


@pytest.mark.parametrize("name", NAMES)
def test_the_picture_on_top_is_one_that_the_notebook_draws(name: str) -> None:
    notebook = stored(name)
    place = f"docs/pictures/notebooks/{name}.png"
    assert f"](../{place})" in notebook.cells[0].source
    drawn = [
        base64.b64decode(output.data["image/png"])
        for cell in code_cells(notebook)
        for output in cell.outputs
        if "image/png" in output.get("data", {})
    ]
    assert (ROOT / place).read_bytes() in drawn


@pytest.mark.parametrize("name", NAMES)
def test_every_picture_has_a_caption_below_it_which_is_its_description_too(name: str) -> None:
    cells, pictures = stored(name).cells, 0
    for cell, after in pairwise(cells):
        for output in cell.get("outputs", ()):
            if "image/png" in output.get("data", {}):
                pictures += 1
                assert after.cell_type == "markdown", cell.source
                assert after.source.startswith("*"), cell.source
                assert len(output.metadata["image/png"]["alt"]) > 20, cell.source
    assert pictures >= 2


@pytest.mark.parametrize("name", NAMES)
def test_formulas_in_a_line_do_not_run_over_its_end(name: str) -> None:
    """A line of Markdown that goes on with a minus begins a list."""
    formulas = 0
    for cell in source(name).cells:
        if cell.cell_type == "markdown":
            for number, part in enumerate(cell.source.split("$$")):
                if number % 2 == 0:
                    assert all(line.count("$") % 2 == 0 for line in part.splitlines()), part
                formulas += part.count("$") // 2
    assert formulas >= 2


@pytest.mark.parametrize("name", NAMES)
def test_links_between_notebooks_lead_somewhere(name: str) -> None:
    import re

    words = "\n".join(cell.source for cell in source(name).cells if cell.cell_type == "markdown")
    for target in re.findall(r"\]\(([^)]+\.ipynb)\)", words):
        assert (FOLDER / target).exists(), target


def a_notebook(*cells: str) -> Any:
    made = program().nbformat.v4
    notebook = made.new_notebook()
    notebook.cells = [made.new_code_cell(cell) for cell in cells]
    return notebook


def test_a_cell_that_fails_stops_the_run_and_names_itself(tmp_path: Path) -> None:
    with pytest.raises(program().CellExecutionError, match="ZeroDivisionError"):
        program().execute(a_notebook("1 / 0", "print('never')"), tmp_path)


def test_warnings_and_places_are_found(tmp_path: Path) -> None:
    cells = "import warnings; warnings.warn('careful')", f"print('{ROOT}/output')", "print('fine')"
    ran = program().execute(a_notebook(*cells), tmp_path)
    first, *_, last = program().complaints(ran)
    assert first.startswith("cell 0 wrote to stderr")
    assert last.startswith("cell 1 names a place on this machine")


def test_a_notebook_that_is_not_there_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        program().main(["17"])
    assert "no notebook begins with ['17']: there are ['01_first_contact'" in capsys.readouterr().err
