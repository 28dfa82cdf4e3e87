"""Cost of accuracy in time: runs of one scene with different meshes, tolerances and discretisations.

`run_study` measures, `write_report` evaluates; ``python -m fenics_contact accuracy SCENE`` does both. A scene
of your own is a Python file that defines ``study``, a `StudyScene`.
"""

from typing import TYPE_CHECKING

from fenics_contact._base.late_names import late_names

if TYPE_CHECKING:
    from fenics_contact.study import figures
    from fenics_contact.study.report import accuracy_table, cost_table, write_report
    from fenics_contact.study.results import Errors, Results, Run, read_study
    from fenics_contact.study.runner import Settings, run_study
    from fenics_contact.study.study import BALANCED, Parameters, Problem, Quantity, StudyScene, Sweep

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

__getattr__, __dir__ = late_names(__name__)
