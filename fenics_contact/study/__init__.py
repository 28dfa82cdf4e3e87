"""Cost of accuracy in time: runs of one scene with different meshes, tolerances and discretisations.

`run_study` measures, `write_report` evaluates; ``python -m fenics_contact accuracy SCENE`` does both. A scene
of your own is a Python file that defines ``study``, a `StudyScene`.
"""

from __future__ import annotations

from fenics_contact.study.errors import Errors
from fenics_contact.study.parameters import BALANCED, DISCRETISATIONS, Parameters, RunTolerance, Sweep
from fenics_contact.study.protocol import Outcome, Problem, Quantity, StudyScene
from fenics_contact.study.report import write_overview, write_report
from fenics_contact.study.results import Results, Run, read_study
from fenics_contact.study.running import Settings, StudyPlan, prepare, run_study
from fenics_contact.study.scenes import BUILT_IN, find_study
from fenics_contact.study.tables import accuracy_table, cost_table

__all__ = [
    "BALANCED",
    "BUILT_IN",
    "DISCRETISATIONS",
    "Errors",
    "Outcome",
    "Parameters",
    "Problem",
    "Quantity",
    "Results",
    "Run",
    "RunTolerance",
    "Settings",
    "StudyPlan",
    "StudyScene",
    "Sweep",
    "accuracy_table",
    "cost_table",
    "find_study",
    "prepare",
    "read_study",
    "run_study",
    "write_overview",
    "write_report",
]
