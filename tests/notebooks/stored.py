"""The notebooks of the project: sources, what is stored beside them, and the program that runs them."""

from __future__ import annotations

import importlib.util
import re
import sys
import warnings
from types import ModuleType
from typing import Any

import numpy as np

from tests.conftest import ROOT

FOLDER = ROOT / "notebooks"
NAMES = sorted(path.stem for path in FOLDER.glob("[0-9][0-9]_*.py"))
#: What a number looks like in printed text.
NUMBER = re.compile(r"[-+−]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")
#: Numbers below this are what rounding left of a zero.
ZERO = 1e-6


def program() -> ModuleType:
    """Import ``notebooks/execute.py``."""
    if "execute_notebooks" not in sys.modules:
        spec = importlib.util.spec_from_file_location("execute_notebooks", FOLDER / "execute.py")
        assert spec is not None
        assert spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # Jupyter's libraries warn while they are imported
            spec.loader.exec_module(module)
        sys.modules[spec.name] = module
    return sys.modules["execute_notebooks"]


def source(name: str) -> Any:
    """Return the notebook of a text source, without results."""
    return program().read_source(FOLDER / f"{name}.py")


def stored(name: str) -> Any:
    """Return the notebook with the results that are stored in the repository."""
    return program().nbformat.read(FOLDER / f"{name}.ipynb", as_version=4)


def asserted_numbers(notebook: Any) -> dict[int, np.ndarray]:
    """Return the numbers that each cell with an assertion prints, rounded zeros as zeros."""
    found = {}
    for number, cell in enumerate(notebook.cells):
        if cell.cell_type == "code" and "assert " in cell.source:
            printed = "".join(output.get("text", "") for output in cell.outputs)
            values = np.array([float(text.replace("−", "-")) for text in NUMBER.findall(printed)])
            found[number] = np.where(np.abs(values) < ZERO, 0.0, values)
    return found
