"""Bodies that touch and are not loaded: the answer is zero, at once."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

from benchmarks.graph_partition import graph_partition
from fenics_contact import Body, ContactPair, Coulomb, Pressure, Scene, Support, Surface, solve_scene
from fenics_contact._pairing.search import without_rounding
from fenics_contact.gallery import block
from fenics_contact.materials import IsotropicElasticity
from fenics_contact.qp import FaceNewton, Smalse

STEEL = IsotropicElasticity(2.1e5, 0.3)


def stack(seed: int, friction: Coulomb | None, discretisation: str, *, held: bool = True) -> Scene:
    """A block on another one, of sizes and at a place that are not exact in binary."""
    random = np.random.default_rng(seed)
    size, (x, y) = random.uniform(0.5, 3.0), random.uniform(-0.3, 0.3, 2)
    lower = block((0.0, 0.0, 0.0), (size, size, size), (3, 3, 3))
    upper = block((x, y, size), (x + 0.8 * size, y + 0.8 * size, size + 0.3), (4, 3, 2))
    below = (0.0, 0.0, 0.0) if held else (None, None, 0.0)
    return Scene(
        {"lower": Body(lower, STEEL), "upper": Body(upper, STEEL)},
        [Support("lower", "z0", below)],
        contacts=[ContactPair(Surface("upper", "z0"), Surface("lower", "z1"), friction, discretisation)],
    )


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("discretisation", ["node", "mortar"])
@pytest.mark.parametrize("friction", [None, Coulomb(0.5)])
@pytest.mark.parametrize("held", [True, False])
def test_nothing_happens_at_once(
    seed: int, discretisation: str, friction: Coulomb | None, held: bool
) -> None:
    scene = stack(seed, friction, discretisation, held=held)
    parts = {name: graph_partition(body.mesh, 3) for name, body in scene.bodies.items()}

    for partition in (None, parts):
        state = solve_scene(scene, MPI.COMM_SELF, partitions=partition)

        assert state.solution.products == 0
        assert [step.method for step in state.solution.history] == ["start"]
        assert not state.contact.normal_force.any()
        assert not any(state.gather_displacement(name).any() for name in scene.bodies)


@pytest.mark.parametrize("solver", [FaceNewton(), Smalse()])
def test_every_solver_takes_a_start_that_is_the_answer(solver: FaceNewton | Smalse) -> None:
    scene = stack(1, None, "mortar")

    state = solve_scene(scene, MPI.COMM_SELF, solver=solver)

    assert (state.solution.products, state.solution.residuals.worst) == (0, 0.0)


def test_unloading_ends_without_any_force() -> None:
    loaded = stack(2, Coulomb(0.5), "node")
    pressed = Scene(loaded.bodies, loaded.supports, [Pressure("upper", "z1", 3.0)], loaded.contacts)

    assert solve_scene(pressed, MPI.COMM_SELF).contact.normal_force.sum() > 1.0
    assert not solve_scene(loaded, MPI.COMM_SELF).contact.normal_force.any()


def test_gaps_of_rounding_are_none_in_any_unit_and_anywhere() -> None:
    for unit in (1e-6, 1.0, 1e6):
        places = unit * np.array([[0.3, 0.7, 1.1], [1.3, 0.2, 1.1]])
        for far in (0.0, 1e5 * unit):
            rounding = np.finfo(float).eps * (places + far).max()
            gap = np.array([0.0, 3.0, -9.0, 300.0, -300.0]) * rounding

            found = without_rounding(gap, places + far)

            np.testing.assert_array_equal(found, [0.0, 0.0, 0.0, gap[3], gap[4]])
