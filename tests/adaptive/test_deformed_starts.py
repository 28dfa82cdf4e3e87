"""States of nonlinear materials on refined meshes start from those on coarser ones."""

from __future__ import annotations

import logging

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    AutomaticSteps,
    Body,
    ContactPair,
    ContactProblem,
    Coulomb,
    RigidSphere,
    Scene,
    Support,
    Surface,
    Traction,
)
from fenics_contact._adaptive.refined_scene import SceneRefinement, refine_scene
from fenics_contact._equilibrium.starts import CoarseStart
from fenics_contact.gallery import rectangle
from fenics_contact.materials import NeoHooke
from fenics_contact.results.deformed_state import DeformedState


def pad(size: float = 0.2) -> Scene:
    """Half of a rubber block on a cylinder, with friction."""
    mesh = rectangle((0.0, 0.0), (10.0, 10.0), (5, 5), "triangle")
    return Scene(
        {"pad": Body(mesh, NeoHooke(2.0, 0.3))},
        [Support("pad", "x0", (0.0, None))],
        [Traction("pad", "y1", (0.0, -size))],
        [ContactPair(Surface("pad", "y0"), RigidSphere((0.0, -10.0), 10.0), Coulomb(0.3))],
    )


def finer(scene: Scene) -> SceneRefinement:
    return refine_scene(scene, {"pad": np.arange(scene.bodies["pad"].mesh.n_cells)})


def solved(scene: Scene, steps: AutomaticSteps | None = None, **given: object) -> DeformedState:
    problem = ContactProblem(scene, MPI.COMM_SELF, steps=steps)
    state = problem.solve(**given)  # type: ignore[arg-type]
    assert isinstance(state, DeformedState)
    return state


@pytest.fixture(scope="module")
def coarse() -> DeformedState:
    return solved(pad())


def test_rubber_on_refined_meshes_has_the_state_of_a_solve_from_rest(coarse: DeformedState) -> None:
    found = finer(coarse.scene)
    cold, warm = solved(found.scene), solved(found.scene, start=coarse, refinements=found.refinements)
    assert warm.solution.products < 0.7 * cold.solution.products
    moved, slip = (np.abs(each).max() for each in (cold.torn_displacement, cold.contact.slip))
    assert warm.torn_displacement == pytest.approx(cold.torn_displacement, abs=1e-6 * moved)
    assert warm.contact.slip == pytest.approx(cold.contact.slip, abs=1e-6 * slip)
    assert slip > 0.01
    assert warm.energies.friction == pytest.approx(cold.energies.friction, rel=1e-5)


def test_a_start_that_leads_nowhere_costs_a_solve_from_rest(
    coarse: DeformedState, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """Displacements that turn cells inside out."""
    found, interpolated = finer(coarse.scene), CoarseStart.displacement
    monkeypatch.setattr(CoarseStart, "displacement", lambda *given: -40.0 * interpolated(*given))
    with caplog.at_level(logging.INFO):
        state = solved(found.scene, start=coarse, refinements=found.refinements)
    assert "the start from coarser meshes led nowhere" in caplog.text
    assert state.contact.normal_force.sum() == pytest.approx(2.0, rel=0.2)  # friction holds back a part


@pytest.mark.parametrize("way", [{"snaps": True}, {"finer_history": True}])
def test_equilibria_that_depend_on_the_way_there_are_followed_from_rest(
    coarse: DeformedState, way: dict[str, bool]
) -> None:
    found = finer(coarse.scene)
    given = {"start": coarse, "refinements": found.refinements}
    assert solved(found.scene, AutomaticSteps(first=0.5, **way), **given).fractions[0] == 0.5
