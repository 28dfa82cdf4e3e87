"""Designs of scene files with load steps: which steps count, and what is limited after which."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import _cli as cli
from fenics_contact import read_scene_file
from fenics_contact._scene_file.reading import SceneFile
from fenics_contact._scene_file.source import SceneFileError
from fenics_contact.design import FrictionWork, LoadPath, NonlinearConstraint, PressureNorm
from fenics_contact.output import read_result
from tests.scene_file.texts import GOOD, STEPS

SURFACE = {"body": "block", "surface": "z0", "net": [2, 2], "lower": -0.02, "upper": 0.02}
NAMES = ["pressed", "shifted 1/2", "shifted 2/2"]


def designed(text: str = STEPS, **more: Any) -> SceneFile:
    surface = SURFACE if text == STEPS else {**SURFACE, "body": "upper"}
    design = {"objective": "friction_work", "surfaces": [surface], **more}
    return read_scene_file({**tomllib.loads(text), "design": design}, MPI.COMM_SELF)


def path_of(file: SceneFile) -> LoadPath:
    path = file.shape_task().problem
    assert isinstance(path, LoadPath)
    return path


def test_the_objective_is_added_over_all_steps() -> None:
    file = designed()
    path = path_of(file)
    assert path.objectives == dict.fromkeys(NAMES, FrictionWork())
    sequence = file.sequence()
    states = [sequence.advance(step) for step in file.steps]
    works = [FrictionWork().value(state, path.forms) for state in states]
    assert path.values_of(np.zeros(4)) == pytest.approx(dict(zip(NAMES, works, strict=True)), abs=1e-9)
    assert works[2] > 0.0


def test_some_steps_count_and_another_objective_is_limited_after_one() -> None:
    limited = {"kind": "objective", "objective": "pressure_norm", "at_most": 9.0, "step": "pressed"}
    last = {"kind": "objective", "objective": "pressure_norm", "at_most": 9.0}
    task = designed(over_steps=[NAMES[2]], constraints=[limited, last]).shape_task()
    path, alpha = task.problem, np.zeros(4)
    assert isinstance(path, LoadPath)
    assert path.objectives == {NAMES[2]: FrictionWork()}
    states = path.states_of(alpha)
    for constraint, step in zip(task.constraints, (NAMES[0], NAMES[2]), strict=True):
        assert isinstance(constraint, NonlinearConstraint)
        assert (constraint.name, constraint.upper) == ("pressure_norm", 9.0)
        expected = PressureNorm().value(states[step], path.forms)
        assert constraint.fun(alpha)[0] == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize(
    ("text", "more", "said"),
    [
        (GOOD, {"over_steps": ["push"]}, "names of load steps, but the file has none"),
        (STEPS, {"over_steps": ["push"]}, r"those of some of the steps \['pressed'"),
        (STEPS, {"over_steps": ["pressed"]}, "the last step needs an objective"),
        (STEPS, {"adaptive": True}, "all solved to one tolerance"),
        (
            STEPS,
            {
                "constraints": [
                    {"kind": "objective", "objective": "contact_area", "at_least": 1, "step": "pushed"}
                ]
            },
            r"got those of \['pushed'\]",
        ),
    ],
)
def test_a_mistake_in_steps_of_a_design_is_named(text: str, more: dict[str, Any], said: str) -> None:
    with pytest.raises(SceneFileError, match=said):
        designed(text, **more).shape_task()


def test_the_command_line_minimises_the_work_of_all_steps(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    design = """
[design]
objective = "friction_work"
max_iterations = 2
[[design.surfaces]]
body = "block"
surface = "z0"
net = [2, 2]
lower = -0.02
upper = 0.02
"""
    path = tmp_path / "shifted.toml"
    path.write_text(STEPS + design)
    cli.main(MPI.COMM_SELF, ["optimize", str(path), "-o", str(tmp_path), "--no-pictures"])
    told = read_result(tmp_path)["optimisation"]
    assert told["objective"]["type"] == "LoadPath"
    assert "'shifted 2/2': FrictionWork" in told["objective"]["definition"]
    assert told["objective"]["final"] < told["objective"]["initial"]
    assert (tmp_path / "design.csv").exists()
    assert "objective friction_work" in capsys.readouterr().out
