"""The notebooks run from their sources and find what is stored, in a kernel and as plain scripts."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tests.conftest import ROOT
from tests.notebooks.stored import FOLDER, NAMES, asserted_numbers, program, source, stored

#: Relative, for numbers of nonsmooth iterations too; and how many of a cell's numbers may be off, such as
#: counts of products, which other versions of libraries change by one or two.
TOLERANCE, MOST_OFF = 1e-2, 0.2
SECONDS = 120


def compare(name: str) -> float:
    """Run a notebook, compare what its asserting cells print with what is stored; return the seconds."""
    begin = time.perf_counter()
    ran = program().execute(source(name), ROOT)
    seconds = time.perf_counter() - begin
    assert program().complaints(ran) == []
    found, known = asserted_numbers(ran), asserted_numbers(stored(name))
    assert found.keys() == known.keys()
    assert sum(len(values) for values in known.values()) >= 5, "hardly any numbers: nothing was compared"
    for cell, values in known.items():
        assert len(found[cell]) == len(values), f"cell {cell} prints other lines"
        off = ~np.isclose(found[cell], values, rtol=TOLERANCE, atol=2e-6)
        assert off.mean() <= MOST_OFF if len(values) else True, (cell, found[cell][off], values[off])
    return seconds


def test_the_first_notebook_finds_what_is_stored() -> None:
    compare(NAMES[0])


@pytest.mark.slow
@pytest.mark.claim
@pytest.mark.parametrize("name", NAMES[1:])
def test_a_notebook_finds_what_is_stored_in_two_minutes(name: str) -> None:
    assert compare(name) < SECONDS


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_a_notebook_is_a_script_too(
    name: str, mpirun: Callable[..., str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(ROOT if name.startswith("05") else tmp_path)
    printed = mpirun(FOLDER / f"{name}.py", 1, timeout=300.0, fresh=True)
    wanted = [
        output.text.splitlines()[0]
        for cell in stored(name).cells
        for output in cell.get("outputs", ())
        if output.output_type == "stream"
    ]
    assert len(wanted) >= 5
    words = [line.split("  ")[0].split(":")[0] for line in wanted]
    assert all(word[:12] in printed for word in words if not any(c.isdigit() for c in word[:12]))
