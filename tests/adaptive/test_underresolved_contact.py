"""Spots of contact that are smaller than the cells around them."""

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    Limits,
    RigidPlane,
    RigidSphere,
    Scene,
    Support,
    Surface,
    TotalForce,
    Traction,
    gallery,
    solve_scene,
    solve_to,
    theory,
)
from fenics_contact._adaptive import equilibrium
from fenics_contact._adaptive.underresolved_contact import refined_at_spots, underresolved_pairs
from fenics_contact.design import PeakPressure
from fenics_contact.materials import IsotropicElasticity, PlaneStrain
from fenics_contact.mesh.cell_types import CELL_TYPES, shape_values

E, NU, RADIUS = 2.1e5, 0.3, 10.0
MODULUS = theory.contact_modulus(E, NU, np.inf, 0.0)


def flat(cells: int) -> Scene:
    mesh = gallery.rectangle((0.0, 0.0), (1.0, 1.0), (cells, cells))
    return Scene(
        bodies={"block": Body(mesh, PlaneStrain(E, NU))},
        supports=[Support("block", "x0", (0.0, None))],
        loads=[Traction("block", "y1", (0.0, -1.0))],
        contacts=[ContactPair(Surface("block", "y0"), RigidPlane((0.0, 0.0), (0.0, 1.0)))],
    )


def on_cylinder(force: float, cell: str = "quadrilateral") -> Scene:
    """Half of a block on a rigid cylinder, which the force of the whole presses down; cells of 2 mm."""
    mesh = gallery.rectangle((0.0, 0.0), (10.0, 10.0), (5, 5), cell=cell)
    return Scene(
        bodies={"block": Body(mesh, PlaneStrain(E, NU))},
        supports=[Support("block", "x0", (0.0, None))],
        loads=[Traction("block", "y1", (0.0, -force / 20.0))],
        contacts=[ContactPair(Surface("block", "y0"), RigidSphere((0.0, -RADIUS), RADIUS))],
    )


def on_ball(force: float) -> Scene:
    """A quarter of a block on a rigid ball."""
    mesh = gallery.block((0.0, 0.0, 0.0), (10.0, 10.0, 10.0), (3, 3, 3))
    return Scene(
        bodies={"block": Body(mesh, IsotropicElasticity(E, NU))},
        supports=[Support("block", "x0", (0.0, None, None)), Support("block", "y0", (None, 0.0, None))],
        loads=[TotalForce("block", "z1", (0.0, 0.0, -force / 4.0))],
        contacts=[ContactPair(Surface("block", "z0"), RigidSphere((0.0, 0.0, -RADIUS), RADIUS))],
    )


def widths_around(scene: Scene, place: tuple[float, ...]) -> np.ndarray:
    """Return the longest edges along an axis of the cells at a place."""
    mesh = scene.bodies["block"].mesh
    here = np.linalg.norm(mesh.points[mesh.cells] - np.array(place), axis=2).min(axis=1) < 1e-9
    return np.ptp(mesh.points[mesh.cells[here]], axis=1).max(axis=1)


def test_contacts_of_one_facet_are_doubted():
    assert underresolved_pairs(solve_scene(flat(1), MPI.COMM_SELF)) == [0]
    assert underresolved_pairs(solve_scene(flat(3), MPI.COMM_SELF)) == []


@pytest.mark.parametrize("cell", ["quadrilateral", "triangle"])
@pytest.mark.parametrize("force", [50.0, 1000.0])
def test_two_cells_lie_across_the_half_width_of_a_line(force, cell):
    half_width = theory.hertz_line(force, 1.0 / RADIUS, MODULUS).half_width
    state = solve_scene(on_cylinder(force, cell), MPI.COMM_SELF)
    found = refined_at_spots(state, [0])
    widths = widths_around(found.scene, (0.0, 0.0))
    assert widths.max() <= half_width / 2.0 * np.sqrt(2.0)  # triangles are wider than they count
    assert widths.min() > half_width / 8.0
    # Away from the spot nothing is halved.
    assert widths_around(found.scene, (10.0, 10.0)).max() == pytest.approx(2.0)


def test_two_cells_lie_across_the_radius_of_a_spot():
    radius = max(theory.hertz_point(1000.0, (1.0 / RADIUS, 1.0 / RADIUS), MODULUS).semi_axes)
    state = solve_scene(on_ball(1000.0), MPI.COMM_SELF)
    found = refined_at_spots(state, [0])
    widths = widths_around(found.scene, (0.0, 0.0, 0.0))
    assert radius / 4.0 < widths.max() <= radius / 2.0


def test_the_refinement_leads_from_the_first_meshes():
    state = solve_scene(on_cylinder(50.0), MPI.COMM_SELF)
    found = refined_at_spots(state, [0])
    coarse, fine = state.scene.bodies["block"].mesh, found.scene.bodies["block"].mesh
    step = found.refinements["block"]
    values = shape_values(CELL_TYPES["quadrilateral"], step.positions.reshape(-1, 2))
    values = values.reshape(fine.n_cells, 4, 4)
    places = np.einsum("ckn,cni->cki", values, coarse.points[coarse.cells[step.parents]])
    assert fine.n_cells > coarse.n_cells + 9  # halved more than once
    np.testing.assert_allclose(places, fine.points[fine.cells], atol=1e-12)


def test_a_flat_spot_is_halved_once():
    found = refined_at_spots(solve_scene(flat(1), MPI.COMM_SELF), [0])
    assert found.scene.bodies["block"].mesh.n_cells == 4


def test_doubted_meshes_cost_no_adjoint(monkeypatch):
    def refuse(*_):
        raise AssertionError

    monkeypatch.setattr(equilibrium, "goal_error", refuse)
    found = solve_to(on_cylinder(1000.0), PeakPressure(), 0.1, MPI.COMM_SELF, limits=Limits(levels=1))
    assert found.value > 0.0
    resolved = replace(on_cylinder(1000.0), contacts=flat(5).contacts)
    with pytest.raises(AssertionError):
        solve_to(resolved, PeakPressure(), 0.1, MPI.COMM_SELF)
