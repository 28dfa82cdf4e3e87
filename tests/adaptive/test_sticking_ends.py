"""Ends of contacts that stick on large cells and slip on smaller ones."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    Coulomb,
    RigidPlane,
    Scene,
    Support,
    Surface,
    Traction,
    solve_scene,
    solve_to,
)
from fenics_contact._adaptive.refined_scene import SceneRefinement
from fenics_contact._adaptive.sticking_ends import depends_on_slip, refined_at_sticking_ends, sticking_ends
from fenics_contact.design import FrictionWork, StrainEnergy
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import IsotropicElasticity, PlaneStrain
from fenics_contact.mesh import quadratic
from tools.random_scenes.corners import corners


def punch(friction: float, cell: str = "quadrilateral", order: int = 1, push: float = 0.02) -> Scene:
    """A stiff block pressed on a soft one and pushed along x."""
    upper = rectangle((0.0, 0.0), (1.0, 1.0), (4, 4), cell)
    lower = rectangle((-0.5, -1.0), (1.5, 0.0), (8, 4), cell)
    if order == 2:
        upper, lower = quadratic(upper), quadratic(lower)
    return Scene(
        {"a": Body(upper, PlaneStrain(1e4, 0.1)), "b": Body(lower, PlaneStrain(100.0, 0.3))},
        [Support("b", "y0")],
        [Traction("a", "y1", (push, -1.0))],
        [ContactPair(Surface("a", "y0"), Surface("b", "y1"), Coulomb(friction) if friction else None)],
    )


def ends(scene: Scene) -> list[float]:
    return sticking_ends(solve_scene(scene, MPI.COMM_SELF), 0)[:, 0].tolist()


def test_ends_stick_where_friction_needs_more_towards_them() -> None:
    """Stress at the corners of a stiff block on a soft one turns inwards, by more the nearer it is."""
    assert ends(punch(0.2)) == [1.0]
    assert ends(punch(0.9, "triangle", 2)) == [1.0]
    assert ends(punch(0.45, push=0.2)) == [1.0], "the other end slips"
    assert ends(punch(0.9)) == [], "seen from these cells, a zone of slip is too small to count"
    assert ends(punch(0.0, push=0.0)) == []


def test_sides_of_symmetry_and_ends_that_need_no_friction_are_none() -> None:
    half = rectangle((0.0, 0.0), (1.0, 1.0), (4, 4))
    floor = ContactPair(Surface("a", "y0"), RigidPlane((0.0, 0.0), (0.0, 1.0)), Coulomb(0.9))
    parts = {"loads": [Traction("a", "y1", (0.0, -1.0))], "contacts": [floor]}
    pressed = Scene({"a": Body(half, PlaneStrain(100.0, 0.3))}, [Support("a", "x0", (0.0, None))], **parts)
    assert ends(pressed) == [1.0]
    even = Scene({"a": Body(half, PlaneStrain(100.0, 0.0))}, [Support("a", "x0", (0.0, None))], **parts)
    assert ends(even) == []


def test_edges_of_contacts_in_space_are_none() -> None:
    cube = block((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), (2, 2, 2))
    scene = Scene(
        {"a": Body(cube, IsotropicElasticity(100.0, 0.3))},
        loads=[Traction("a", "z1", (0.1, 0.0, -1.0))],
        contacts=[ContactPair(Surface("a", "z0"), RigidPlane((0, 0, 0), (0, 0, 1)), Coulomb(0.9))],
    )
    assert sticking_ends(solve_scene(scene, MPI.COMM_SELF), 0).shape == (0, 3)


def test_cells_of_both_bodies_are_halved_around_ends() -> None:
    state = solve_scene(punch(0.2), MPI.COMM_SELF)
    found = refined_at_sticking_ends(state, SceneRefinement(state.scene, {}), 2)
    for body in found.scene.bodies.values():
        corners = body.mesh.points[body.mesh.cells]
        width, middle = np.ptp(corners, axis=1).max(axis=1), corners.mean(axis=1)
        assert width[np.argmin(np.hypot(middle[:, 0] - 1.0, middle[:, 1]))] == pytest.approx(0.25 / 4.0)
        assert width.max() == pytest.approx(0.25)
    all_together = solve_scene(punch(0.2, order=2), MPI.COMM_SELF)
    assert not refined_at_sticking_ends(all_together, SceneRefinement(all_together.scene, {})).refinements


def test_quantities_made_of_slip_are_known() -> None:
    assert depends_on_slip(FrictionWork())
    assert depends_on_slip(StrainEnergy() + 2.0 * FrictionWork(0))
    assert not depends_on_slip(StrainEnergy() + StrainEnergy())


def test_work_of_friction_is_found_where_a_corner_slips_in_a_small_part_of_a_cell() -> None:
    """Stated 7.1 % and 14 % off while the corner, which slips along 0.2 % of the surface, was not refined."""
    found = solve_to(corners(71).start(), "friction_work", 0.1, MPI.COMM_SELF)
    assert found.reached
    assert abs(found.value - 1.2008e-3) < 0.5 * found.error  # of graded quadratic cells, on three meshes
