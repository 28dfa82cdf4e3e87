"""Objectives and design steps of scene files."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import read_scene_file
from fenics_contact.__main__ import main
from fenics_contact._scene_file.reading import SceneFile
from fenics_contact._scene_file.source import SceneFileError
from fenics_contact.design import (
    ContactArea,
    FrictionWork,
    LargestPressure,
    LargestStress,
    LoadPath,
    Maximum,
    Movement,
    NonlinearConstraint,
    Objective,
    PressureNonuniformity,
    PressureNorm,
    StrainEnergy,
    TotalPotential,
)
from fenics_contact.output import read_result
from tests.scene_file.texts import GOOD, STEPS

SURFACES = [{"body": "upper", "surface": "z0", "net": [2, 2], "lower": -0.01, "upper": 0.01}]


def with_objective(given: Any) -> SceneFile:
    design = {"objective": given, "surfaces": SURFACES}
    return read_scene_file({**tomllib.loads(GOOD), "design": design}, MPI.COMM_SELF)


STRESS, PUSH = LargestStress("upper", p=12.0), Movement("upper", "z1", (0.0, 0.0, -1.0))
IN_FILES: list[tuple[Any, Objective, str]] = [
    ("total_potential", TotalPotential(), "total_potential"),
    ("strain_energy", StrainEnergy(), "strain_energy"),
    ("largest_pressure", LargestPressure(), "largest_pressure"),
    ("friction_work", FrictionWork(), "friction_work"),
    ({"kind": "pressure_norm", "pair": 0, "p": 20}, PressureNorm(pair=0, p=20.0), "pressure_norm"),
    ({"kind": "pressure_unevenness", "pair": 0}, PressureNonuniformity(0), "pressure_unevenness"),
    ({"kind": "contact_area", "weight": -1}, -ContactArea(), "-1 contact_area"),
    ({"kind": "largest_stress", "body": "upper", "p": 12}, STRESS, "largest_stress"),
    ({"kind": "movement", "body": "upper", "at": "z1", "direction": [0, 0, -1]}, PUSH, "movement"),
    (
        [{"kind": "strain_energy"}, {"kind": "pressure_norm", "weight": 0.5}],
        StrainEnergy() + 0.5 * PressureNorm(),
        "strain_energy + 0.5 pressure_norm",
    ),
    (
        {
            "kind": "largest",
            "objectives": [
                {"kind": "largest_stress", "body": "upper", "p": 12},
                {"kind": "largest_pressure", "weight": 2},
            ],
        },
        Maximum((STRESS, 2 * LargestPressure())),
        "largest",
    ),
]


@pytest.mark.parametrize(("given", "expected", "words"), IN_FILES, ids=[words for *_, words in IN_FILES])
def test_an_objective_of_a_file_is_that_of_python(given: Any, expected: Objective, words: str) -> None:
    file = with_objective(given)
    assert file.document.design is not None
    assert file.document.design.objective_in_words == words
    assert file.shape_task().problem.objective == expected


def constrained(*constraints: dict[str, Any], **more: Any) -> SceneFile:
    design = {"surfaces": SURFACES, "constraints": list(constraints), **more}
    return read_scene_file({**tomllib.loads(GOOD), "design": design}, MPI.COMM_SELF)


def test_an_objective_may_be_limited() -> None:
    stress = {"kind": "largest_stress", "body": "upper", "p": 12}
    limited = {"kind": "objective", "objective": stress, "at_most": 1000, "at_least": 1, "name": "stress"}
    kept = {"kind": "volume", "at_least": 0.9}
    task = constrained(limited, kept, restore=True).shape_task()
    constraint, volume = task.constraints
    assert isinstance(constraint, NonlinearConstraint)
    assert isinstance(volume, NonlinearConstraint)
    assert (volume.name, volume.upper) == ("volume", np.inf)
    assert (constraint.name, constraint.lower, constraint.upper) == ("stress", 1.0, 1000.0)
    start = np.zeros(4)
    value, gradient = constraint.fun(start)
    task.problem.objective = STRESS
    point = task.problem.evaluate(start)
    assert value == pytest.approx(point.value, rel=1e-6)
    np.testing.assert_allclose(gradient, point.gradient, rtol=1e-3, atol=1e-6 * np.abs(gradient).max())
    assert task.restore


def test_a_run_keeps_the_limit_of_an_objective() -> None:
    start = float(constrained().shape_task().problem(np.zeros(4))[0])
    push = {"kind": "movement", "body": "upper", "at": "z1", "direction": [0, 0, -1]}
    free = constrained(max_iterations=5).shape_task()
    moved = free.problem.function(PUSH)
    limit = 0.5 * (moved(np.zeros(4))[0] + moved(free.minimize().x)[0])
    limited = constrained({"kind": "objective", "objective": push, "at_most": limit}, max_iterations=20)
    result = limited.shape_task().minimize()
    assert result.value < start
    (met,) = result.constraints
    assert (met.name, met.active) == ("movement", True)
    assert met.value == pytest.approx(limit, rel=1e-5)


@pytest.mark.parametrize(
    ("constraint", "said"),
    [
        ({"kind": "objective", "objective": "strain_energy"}, "a finite upper or lower is needed"),
        (
            {"kind": "objective", "objective": "strain_energy", "at_least": 2, "at_most": 1},
            "lower must not exceed upper, got 2.0 and 1.0",
        ),
        (
            {"kind": "objective", "objective": {"kind": "largest_stress", "body": "uper"}, "at_most": 1},
            "design.constraints.0.objective.body must be a body",
        ),
    ],
)
def test_a_mistake_in_a_limit_is_named(constraint: dict[str, Any], said: str) -> None:
    with pytest.raises(SceneFileError, match=said):
        constrained(constraint).shape_task()


def test_python_in_a_limit_is_refused_where_it_may_not_run() -> None:
    limited = {"kind": "objective", "objective": "own.py:J", "at_most": 1}
    design = {"surfaces": SURFACES, "constraints": [limited]}
    with pytest.raises(SceneFileError, match=r"design.constraints.0.objective must not be Python code"):
        read_scene_file({**tomllib.loads(GOOD), "design": design}, MPI.COMM_SELF, python=False)


def test_a_gradient_by_a_file_is_that_by_python() -> None:
    problem = with_objective({"kind": "largest_stress", "body": "upper"}).shape_task().problem
    value, gradient = problem(np.zeros(4))
    assert value > 100.0
    problem.objective = LargestStress("upper")
    np.testing.assert_allclose(problem(np.zeros(4))[1], gradient, rtol=1e-3)
    assert np.abs(gradient).max() > 0.0


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ("largest_presure", "objective must be one of .*, got \"largest_presure\": did you mean 'largest_pr"),
        (3, "design.objective must be one of 'total_potential', .*, got 3"),
        ([], "design.objective must be at least 1 entry"),
        ({"p": 3}, "design.objective must have 'kind', one of 'total_potential', "),
        ({"kind": "stress"}, "design.objective.kind must be one of .*, got \"stress\""),
        ({"kind": "pressure_norm", "p": 1.5}, "design.objective.p must be a number of at least 2, got 1.5"),
        ({"kind": "pressure_norm", "p": 101}, "design.objective.p must be a number of at most 100, got 101"),
        ({"kind": "largest_stress"}, "design.objective must have 'body', got only kind: name of the body"),
        ([{"kind": "largest_stress", "body": "uper"}], "design.objective.0.body must be a body, one of .*"),
        ({"kind": "friction_work", "pair": 1}, "design.objective.pair must be the number of a contact "),
        ({"kind": "strain_energy", "pair": 0}, "design.objective.pair is not known: .* are .*weight.*kind"),
        ({"kind": "movement", "body": "upper", "at": 1.5, "direction": [1, 0, 0]}, "at must be the n"),
        ({"kind": "largest", "objectives": []}, "design.objective.objectives must be at least 1 entry"),
    ],
)  # fmt: skip
def test_a_mistake_in_an_objective_is_named(given: Any, said: str) -> None:
    with pytest.raises(SceneFileError, match=said):
        with_objective(given)


# Designs of scene files with load steps: which steps count, and what is limited after which.
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
        (GOOD, {"over_steps": ["push"]}, "name load steps, the file has none"),
        (STEPS, {"over_steps": ["push"]}, r"those of steps \['pressed'"),
        (STEPS, {"over_steps": ["pressed"]}, "the last step needs an objective"),
        (STEPS, {"adaptive": True}, "states of one tolerance"),
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
    main(["optimize", str(path), "-o", str(tmp_path), "--no-pictures"])
    told = read_result(tmp_path)["optimisation"]
    assert told["objective"]["type"] == "LoadPath"
    assert "'shifted 2/2': FrictionWork" in told["objective"]["definition"]
    assert told["objective"]["final"] < told["objective"]["initial"]
    assert (tmp_path / "design.csv").exists()
    assert "objective friction_work" in capsys.readouterr().out
