"""The objective of a cycle: its gradient, what it bounds, and the same on all ranks."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import ContactProblem, ShapeProblem
from fenics_contact.design import FrictionWork, LoadPath
from fenics_contact.fatigue import FatigueNorm, Findley, find_critical_planes
from fenics_contact.fatigue.criteria import OnPlanes
from tests.design.chains import SOLVER
from tests.design.load_paths import SCENES, PathLine, line_of, loaded, moved
from tests.design.quotients import Patch
from tests.fatigue.pushed import CRITERIA, CYCLE, line, path_of
from tests.scenes import partitions

CLAIM = [pytest.mark.slow, pytest.mark.claim]


@cache
def cached(name: str) -> PathLine:
    return replace(line(CRITERIA[name]), step=2e-6)


@pytest.mark.parametrize("name", ["Findley", *(pytest.param(name, marks=CLAIM) for name in [*CRITERIA][1:])])
def test_the_gradient_by_the_shape_of_the_contact_is_that_of_differences(name: str) -> None:
    here = cached(name)
    value, gradient = here.problem(here.alpha)
    assert value == here.problem.value_of(here.alpha) > 0.0
    assert here.slope() == pytest.approx(here.quotient(), rel=1e-6)
    assert abs(here.slope()) > 0.1 * np.linalg.norm(gradient)


@pytest.mark.slow
@pytest.mark.claim
@pytest.mark.parametrize("name", ["mortar", "space, mortar"])
def test_so_is_that_between_bodies_by_mortar_and_in_space(name: str) -> None:
    scene = SCENES[name]()
    body, upwards = ("block", "y") if scene.dim == 2 else ("upper", "z")
    loads = [(name, (push, *[0.1] * (scene.dim - 2), -2.0)) for name, push in TURNS]
    contact = ContactProblem(scene, MPI.COMM_SELF, partitions=partitions(scene), solver=SOLVER)
    norm = FatigueNorm(body, f"{upwards}0", CRITERIA["Fatemi, Socie"], CYCLE, opening=0.5)
    whole = ShapeProblem(contact, moved(scene), FrictionWork())
    here = replace(line_of(LoadPath(whole, loaded(body, f"{upwards}1", loads, scene), norm)), step=1e-6)
    # On longer ways planes change the state of their largest normal stress, of two that are nearly the same.
    assert here.slope() == pytest.approx(here.quotient(), rel=1e-6)
    assert abs(here.slope()) > 0.01 * np.linalg.norm(here.problem(here.alpha)[1])


#: Pushes of load steps, pressed first.
TURNS = (("press", 0.0), ("push", 0.3), ("pull", -0.3), ("push again", 0.3))


@pytest.mark.slow
@pytest.mark.claim
@pytest.mark.parametrize("name", ["Findley", "Smith, Watson, Topper"])
def test_every_part_of_the_derivative_counts(name: str, monkeypatch: Patch) -> None:
    whole, here = OnPlanes.pulled_back, cached(name)
    for part in range(2 if CRITERIA[name].of_strain else 1):

        def without(on: Any, weights: np.ndarray, part: int = part) -> np.ndarray:
            found = whole(on, weights)
            found[part] *= 0.9
            return found

        monkeypatch.setattr(OnPlanes, "pulled_back", without)
        slope = path_of(CRITERIA[name])(here.alpha)[1] @ here.direction
        assert abs(slope / here.quotient() - 1.0) > 1e-3


def test_it_bounds_the_largest_parameter_from_below_the_closer_the_larger_the_exponents() -> None:
    path = cached("Findley").problem
    alpha = np.zeros(path.size)
    states = [path.states_of(alpha)[name] for name in CYCLE]
    mesh = states[0].scene.bodies["block"].mesh
    below = np.isin(mesh.cells, mesh.surfaces["y0"]).any(axis=1)
    stress = np.stack([state.gather_stress("block")[below] for state in states])
    largest = find_critical_planes(Findley(0.3), stress).parameter.max()
    values = [
        path.function(FatigueNorm("block", "y0", Findley(0.3), CYCLE, p, p, opening=0.1)).value_of(alpha)
        for p in (4.0, 16.0, 64.0)
    ]
    assert values[0] < values[1] < values[2] < largest
    assert values[2] > 0.85 * largest
    deeper = FatigueNorm("block", "y0", Findley(0.3), CYCLE, layers=4, opening=0.1)
    assert abs(path.function(deeper).value_of(alpha) / path.value_of(alpha) - 1.0) > 0.1


@pytest.mark.slow
@pytest.mark.claim
def test_a_step_may_recur_and_other_functions_of_the_path_use_its_states() -> None:
    path, alpha = cached("Findley").problem, cached("Findley").alpha
    twice = path.function(FatigueNorm("block", "y0", Findley(0.3), ("push", "pull", "push")))
    assert twice(alpha)[0] == pytest.approx(path(alpha)[0], rel=0.1)
    again = replace(cached("Findley"), problem=twice)
    assert again.slope() == pytest.approx(again.quotient(), rel=1e-6)
    work = path.function({"pull": FrictionWork()})
    assert list(work.values_of(alpha)) == ["pull"]
    assert list(path.values_of(alpha)) == list(CYCLE)
    assert path.values_of(alpha)["push"] == 0.0


@pytest.mark.slow
@pytest.mark.claim
def test_two_ranks_find_the_same(mpirun: Any) -> None:
    script = Path(__file__).with_name("pushed.py")
    alone, *both = (np.array(row.split(), float) for n in (1, 2) for row in mpirun(script, n).splitlines())
    assert np.array_equal(*both)
    np.testing.assert_allclose(both[0], alone, rtol=1e-6)
