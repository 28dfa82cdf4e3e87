"""What is no cycle, no plane and no constant is refused in words."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import Body, Scene, State, Support, Traction, solve_scene
from fenics_contact.design import LoadPath
from fenics_contact.errors import InvalidInputError
from fenics_contact.fatigue import (
    FatemiSocie,
    FatigueNorm,
    Findley,
    LifeCurve,
    SmithWatsonTopper,
    assess_cycle,
    find_critical_planes,
    ruiz_parameters,
)
from fenics_contact.gallery import rectangle
from fenics_contact.materials import OrthotropicPlaneStress, PlaneStrain
from tests.fatigue.pushed import CYCLE, path_of, steps

FINDLEY, STRESS = Findley(0.3), np.zeros((3, 2, 3, 3))


@cache
def pulled(load: float, cells: int = 2, material: Any = PlaneStrain(100.0, 0.3)) -> State:
    mesh = rectangle((0.0, 0.0), (1.0, 1.0), (cells, 2))
    held = [Support("bar", "x0", (0.0, 0.0))]
    return solve_scene(
        Scene({"bar": Body(mesh, material)}, held, [Traction("bar", "x1", (load, 0.0))]), MPI.COMM_SELF
    )


def closed(*loads: float) -> list[State]:
    return [pulled(load) for load in loads]


BAD: dict[str, tuple[Callable[[], Any], str]] = {
    "k": (lambda: Findley(-0.1), "Findley.k must be .*-0.1"),
    "yield": (lambda: FatemiSocie(0.3, 0.0), "FatemiSocie.yield_stress must be .*0.0"),
    "k of strain": (lambda: FatemiSocie(np.nan, 1.0), "FatemiSocie.k must be .*nan"),
    "life": (lambda: LifeCurve([(10.0, 0.1)]), "pairs of A > 0 and b < 0, got .*: try"),
    "no life": (lambda: LifeCurve([]), "pairs of A > 0 and b < 0"),
    "planes": (lambda: find_critical_planes(FINDLEY, STRESS, spacing=30.0), "angle is up to 21.2 deg"),
    "planes of a norm": (
        lambda: FatigueNorm("a", "b", FINDLEY, CYCLE, spacing=45.0), "from 0.5 to 15 degrees, got 45.0"
    ),
    "layers": (lambda: FatigueNorm("a", "b", FINDLEY, CYCLE, layers=0), "layers must be an integer of at"),
    "exponent": (lambda: FatigueNorm("a", "b", FINDLEY, CYCLE, p=1.0), "FatigueNorm.p must be from 2 to 100"),
    "strain": (
        lambda: find_critical_planes(SmithWatsonTopper(), STRESS), "SmithWatsonTopper needs strains, got"
    ),
    "other strain": (
        lambda: find_critical_planes(FINDLEY, STRESS, STRESS[:, :1]), r"got \(3, 2, 3, 3\) and \(3, 1, 3, 3\)"
    ),
    "two stresses": (lambda: find_critical_planes(FINDLEY, STRESS[:2]), r"at least three states, got \(2, 2"),
    "infinite": (lambda: find_critical_planes(FINDLEY, STRESS / 0.0), "needs finite stresses"),
    "one state": (lambda: assess_cycle(closed(1.0), FINDLEY), "at least three states, got 1: it ends where"),
    "open": (lambda: assess_cycle(closed(1.0, -1.0, 0.0), FINDLEY), "end 50.0% of their .* 2.0%: add"),
    "meshes": (
        lambda: assess_cycle([pulled(1.0), pulled(1.0, 3), pulled(1.0)], FINDLEY), "another in state 1"
    ),
    "bodies": (lambda: assess_cycle(closed(1.0, -1.0, 1.0), FINDLEY, ["rod"]), r"bar'\], got \['rod'\]"),
    "nowhere": (
        lambda: assess_cycle(closed(1.0, -1.0, 1.0), FINDLEY, where=lambda x: x[:, 0] > 9.0), "9,., 0 true"
    ),
    "pairs": (lambda: ruiz_parameters(closed(1.0, -1.0, 1.0)), "the scene has no pair"),
    "nothing": (lambda: assess_cycle([], FINDLEY), "assess_cycle"),
}  # fmt: skip


@pytest.mark.filterwarnings("ignore:invalid value")
@pytest.mark.parametrize("name", BAD)
def test_it_is_refused(name: str) -> None:
    call, words = BAD[name]
    with pytest.raises(InvalidInputError, match=words):
        call()


def test_strains_of_other_materials_are_refused_and_stresses_are_not() -> None:
    ply = OrthotropicPlaneStress((200.0, 100.0), 0.1, 50.0)
    cycle = [pulled(load, 2, ply) for load in (1.0, -1.0, 1.0)]
    assert assess_cycle(cycle, FINDLEY).largest > 0.5
    with pytest.raises(
        InvalidInputError, match="linear, isotropic materials, got OrthotropicPlaneStress: give"
    ):
        assess_cycle(cycle, SmithWatsonTopper())


def test_paths_refuse_cycles_that_do_not_fit() -> None:
    path = path_of(FINDLEY)
    alpha, norm = np.zeros(path.size), FatigueNorm("block", "y0", FINDLEY, CYCLE)
    wrong = {
        "those of .*got those of .'pull', 'twist'": replace(norm, steps=("pull", "twist")),
        "FatigueNorm.body must name a body": replace(norm, body="rod"),
        "FatigueNorm.surface must be one of .*'y0'.* got 'rim'": replace(norm, surface="rim"),
        "at least three states, got 2": replace(norm, steps=("push", "pull")),
        "a cycle must end where it begins": replace(norm, steps=("push", "push again", "pull")),
    }
    for words, objective in wrong.items():
        with pytest.raises(InvalidInputError, match=words):
            path.function(objective).value_of(alpha)
    early = replace(norm, steps=("press", "push", "press"))
    with pytest.raises(InvalidInputError, match=r"the last step needs an objective, got those of .'press'"):
        LoadPath(path.problems["press"], steps(), early)
