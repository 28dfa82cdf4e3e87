"""Scenes with materials that have a history: torn bodies, load steps, contact, stresses."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    Checkpoint,
    ContactPair,
    ContactProblem,
    Coulomb,
    DeformedState,
    LoadSequence,
    LoadStep,
    Scene,
    Support,
    Surface,
    Traction,
    box_partition,
    solve_scene,
    solve_steps,
)
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import block
from fenics_contact.materials import (
    FinitePlasticity,
    HistoryMaterial,
    IsotropicElasticity,
    J2Plasticity,
    MaterialResponse,
)
from tests.materials.bodies import in_halves
from tests.scene.material_points import in_tension

BAR = block((0, 0, 0), (4, 1, 1), (4, 2, 2))
SMALL = J2Plasticity(200.0, 0.3, 0.2, 2.0, 10.0)
LARGE = FinitePlasticity(200.0, 0.3, 0.2, 2.0)


def pulled(material: HistoryMaterial, stretch: float) -> Scene:
    sides = [Support("bar", "y0", (None, 0, None)), Support("bar", "z0", (None, None, 0))]
    ends = [Support("bar", "x0", (0, None, None)), Support("bar", "x1", (4 * stretch, None, None))]
    return Scene({"bar": Body(BAR, material)}, [*sides, *ends])


@pytest.mark.parametrize(("material", "size"), [(SMALL, 0.01), (LARGE, 0.1)], ids=["small", "large"])
def test_a_torn_bar_remembers_from_step_to_step(material: HistoryMaterial, size: float) -> None:
    path = size * np.array([1.0, 0.99, 0.5])
    problem = ContactProblem(
        pulled(material, 0.0), MPI.COMM_SELF, partitions={"bar": box_partition(BAR, (2, 1, 1))}
    )
    expected, _ = in_tension(material, path)
    for stretch, nominal in zip(path, expected, strict=True):
        state = problem.solve(pulled(material, stretch), before=problem.state)
        assert isinstance(state, DeformedState)
        lateral = 1 + state.gather_displacement("bar")[:, 1].min()
        true = nominal / lateral**2 if material.finite else nominal
        stress, size_of_it = state.gather_stress("bar"), abs(true)
        np.testing.assert_allclose(stress[:, 0, 0], true, rtol=1e-6)
        stress[:, 0, 0] = 0.0
        assert np.abs(stress).max() < 1e-6 * size_of_it
        np.testing.assert_allclose(state.gather_von_mises("bar"), size_of_it, rtol=1e-6)
        np.testing.assert_allclose(state.gather_nodal_stress("bar")[0][:, 0, 0], true, rtol=1e-6)
    assert expected[0] > 0 > expected[-1]
    assert np.isnan(state.energies.strain)


def pressed(cuts: tuple[int, int, int]) -> DeformedState:
    """A stiff block that presses its edge into a softer one, of which the lower half does not yield."""
    base = in_halves(block((0, 0, 0), (2, 1, 1), (6, 3, 3)))
    punch = block((0, 0, 1), (1, 1, 2), (3, 3, 3))
    bodies = {
        "base": Body(
            base, {"left": J2Plasticity(10.0, 0.3, 0.1, 0.5), "right": IsotropicElasticity(10.0, 0.3)}
        ),
        "punch": Body(punch, IsotropicElasticity(100.0, 0.3)),
    }
    scene = Scene(
        bodies,
        [Support("base", "z0"), Support("punch", "z1", (0, 0, -0.05))],
        contacts=[ContactPair(Surface("punch", "z0"), Surface("base", "z1"), Coulomb(0.2))],
    )
    partitions = {name: box_partition(body.mesh, cuts) for name, body in bodies.items()}
    state = solve_scene(scene, MPI.COMM_SELF, partitions=partitions)
    assert isinstance(state, DeformedState)
    return state


def test_a_plastic_body_in_contact_does_not_depend_on_how_it_is_cut() -> None:
    one, other = pressed((1, 1, 1)), pressed((2, 1, 1))
    u = one.gather_displacement("base")
    np.testing.assert_allclose(other.gather_displacement("base"), u, atol=1e-6 * np.abs(u).max())
    stress = one.gather_von_mises("base")
    np.testing.assert_allclose(other.gather_von_mises("base"), stress, atol=1e-5 * stress.max())
    left = one.scene.bodies["base"].mesh.regions["left"]
    remembered = one.history.values["base"][left][..., 6]
    again = other.history.values["base"][left][..., 6]
    np.testing.assert_allclose(again, remembered, atol=1e-6 * remembered.max())
    assert np.count_nonzero(remembered) > 50
    assert stress[left].max() < 0.1 + 0.5 * remembered.max() + 1e-9
    assert np.isnan(one.gather_nodal_stress("base")[0]).any(), "materials keep their own nodal stresses"


ON_RANKS = """
from mpi4py import MPI
from fenics_contact import solve_scene
from fenics_contact.gallery import block
from fenics_contact import Body, Scene, Support
from fenics_contact.materials import FinitePlasticity
bodies = {
    name: Body(block((z, 0, 0), (z + 1, 1, 1), (2, 2, 2)), FinitePlasticity(200.0, 0.3, 0.2, 2.0))
    for z, name in enumerate("ab")
}
supports = [Support(name, *side) for name in bodies for side in (("x0",), ("x1", (0.01, 0.0, 0.0)))]
state = solve_scene(Scene(bodies, supports), MPI.COMM_WORLD)
mises = [state.gather_von_mises(name).max() for name in bodies]
means = [abs(state.gather_stress(name)).max() for name in bodies]
if MPI.COMM_WORLD.rank == 0:
    print(*mises, *means)
"""


def test_stresses_of_a_body_are_known_to_ranks_without_its_cells(mpirun: Callable[..., str]) -> None:
    first, second, one, other = map(float, mpirun(ON_RANKS, 2).split())
    assert first > 0.2
    assert one > 0.2
    assert (second, other) == pytest.approx((first, one), rel=1e-8)


def test_moments_of_small_strain_are_those_of_the_undeformed_bodies() -> None:
    load = [Traction("bar", "x1", (0.08, 0.0, 0.02))]
    bent = [
        solve_scene(Scene({"bar": Body(BAR, material)}, [Support("bar", "x0")], load), MPI.COMM_SELF)
        for material in (SMALL, IsotropicElasticity(200.0, 0.3))
    ]
    assert isinstance(bent[0], DeformedState)
    assert bent[0].history.values["bar"][..., 6].max() > 0
    assert bent[0].balance().imbalance < 1e-8
    moments = [state.reactions(about=(0.0, 0.5, 0.5))[0].moment[1] for state in bent]
    assert moments == pytest.approx([4 * 0.02] * 2, rel=1e-8)


def test_steps_of_plastic_bodies_go_on_from_a_checkpoint(tmp_path: Path) -> None:
    steps = [LoadStep(f"{x}", supports=pulled(SMALL, x).supports) for x in (0.02, 0.0)]
    file = Checkpoint(tmp_path / "steps.npz")
    LoadSequence(ContactProblem(pulled(SMALL, 0.0), MPI.COMM_SELF), checkpoint=file).advance(steps[0])
    stretched, resumed = solve_steps(
        ContactProblem(pulled(SMALL, 0.0), MPI.COMM_SELF), steps, checkpoint=file
    )
    _, whole = solve_steps(ContactProblem(pulled(SMALL, 0.0), MPI.COMM_SELF), steps)
    assert stretched.solution.reason == "read from a checkpoint"
    left = whole.reactions()[2].force
    assert np.abs(left).max() > 0.1
    assert resumed.reactions()[2].force == pytest.approx(left, rel=1e-8, abs=1e-8 * np.abs(left).max())


@dataclass(frozen=True)
class Creeping(HistoryMaterial):
    """Relaxes in time."""

    @property
    def history_size(self) -> int:
        return 1

    def respond(self, gradient: Any, history: Any, duration: Any) -> Any:
        unit = np.einsum("ik,jl->ijkl", np.eye(3), np.eye(3))
        tangent = np.exp(-duration) * np.broadcast_to(
            0.5 * (unit + unit.swapaxes(2, 3)), (len(gradient), 3, 3, 3, 3)
        )
        return MaterialResponse(np.einsum("nijkl,nkl->nij", tangent, gradient), tangent, history)


def test_a_duration_that_is_not_known_is_asked_for() -> None:
    with pytest.raises(
        InvalidInputError, match=r"Creeping needs the duration of the step, got none: give one"
    ):
        Creeping().answer(np.zeros((1, 3, 3)), np.zeros((1, 1)), np.nan)
