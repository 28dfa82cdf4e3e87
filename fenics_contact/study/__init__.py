"""Cost of accuracy in time: runs of one scene with different meshes, tolerances and discretisations.

`run_study` measures, `write_report` evaluates; ``python -m fenics_contact accuracy SCENE`` does both. A scene
of your own is a Python file that defines ``study``, a `StudyScene`.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from fenics_contact.study.report import accuracy_table, cost_table, write_report
from fenics_contact.study.results import Errors, Results, Run, read_study
from fenics_contact.study.runner import Settings, run_study
from fenics_contact.study.study import BALANCED, Parameters, Problem, Quantity, StudyScene, Sweep

if TYPE_CHECKING:
    from fenics_contact.study import figures

__all__ = [
    "BALANCED",
    "Errors",
    "Parameters",
    "Problem",
    "Quantity",
    "Results",
    "Run",
    "Settings",
    "StudyScene",
    "Sweep",
    "accuracy_table",
    "cost_table",
    "figures",
    "read_study",
    "run_study",
    "write_report",
]


def __getattr__(name: str) -> Any:
    """Load the figures on first use: they need matplotlib."""
    if name == "figures":
        return import_module(f"{__name__}.figures")
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
