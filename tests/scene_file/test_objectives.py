"""Objectives of scene files are those of Python, and mistakes in them are named."""

from __future__ import annotations

import tomllib
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact.scene_file import SceneFile, SceneFileError, read_scene_file
from fenics_contact.shape import (
    ContactArea,
    FrictionWork,
    Largest,
    LargestPressure,
    LargestStress,
    Movement,
    Objective,
    PressureNorm,
    PressureUnevenness,
    StrainEnergy,
    TotalPotential,
)
from tests.scene_file.texts import GOOD

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
    ({"kind": "pressure_unevenness", "pair": 0}, PressureUnevenness(0), "pressure_unevenness"),
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
        Largest((STRESS, 2 * LargestPressure())),
        "largest",
    ),
]


@pytest.mark.parametrize(("given", "expected", "words"), IN_FILES, ids=[words for *_, words in IN_FILES])
def test_an_objective_of_a_file_is_that_of_python(given: Any, expected: Objective, words: str) -> None:
    file = with_objective(given)
    assert file.document.design is not None
    assert file.document.design.objective_in_words == words
    assert file.shape_task().problem.objective == expected


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
