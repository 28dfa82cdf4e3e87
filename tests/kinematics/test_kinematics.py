"""Components, motions, volumes, gradients and forces of bodies in space, in the plane, around an axis."""

from __future__ import annotations

import numpy as np
import pytest

from fenics_contact._kinematics.base import Kinematics
from fenics_contact._kinematics.integration import AT_SECTIONS, FULL, STABILISED, Reduced, Stabilised
from fenics_contact._kinematics.revolution import Revolution
from fenics_contact._kinematics.torsion import Torsion
from fenics_contact.gallery import rectangle

ALL = (Kinematics(3), Kinematics(2), Revolution(), Torsion())


def test_kinematics_differ_in_components_motions_and_axes() -> None:
    assert [each.components for each in ALL] == [3, 2, 2, 3]
    assert [each.motions for each in ALL] == [6, 3, 1, 2]
    assert ["".join(each.axes) for each in ALL] == ["xyz", "xy", "rz", "rz"]
    assert len(set(ALL)) == len(ALL), "they are keys of forms"


@pytest.mark.parametrize("kinematics", ALL, ids=lambda each: each.name or str(each.dim))
def test_there_are_as_many_rigid_modes_as_motions(kinematics: Kinematics) -> None:
    points = np.random.default_rng(1).uniform(1.0, 2.0, (7, kinematics.dim))
    modes = kinematics.rigid_modes(points)
    assert modes.shape == (7, kinematics.components, kinematics.motions)
    assert np.linalg.matrix_rank(modes.reshape(-1, kinematics.motions)) == kinematics.motions


def test_the_volume_of_a_ring_is_that_of_a_full_revolution() -> None:
    mesh = rectangle((1.0, 0.0), (3.0, 0.5), (3, 2))
    assert Kinematics(2).volume(mesh, mesh.cells) == pytest.approx(1.0, rel=1e-12)
    assert Revolution().volume(mesh, mesh.cells) == pytest.approx(np.pi * (9.0 - 1.0) * 0.5, rel=1e-12)


def test_a_radial_displacement_has_a_hoop_strain() -> None:
    slopes, values = np.array([[[[-1.0, 0.0], [1.0, 0.0]]]]), np.array([[0.5, 0.5]])
    radius, nodal = np.array([[2.5]]), np.array([[[0.2, 0.0], [0.3, 0.0]]])
    plane, turned = (each.gradients(slopes, values, radius).of(nodal)[0, 0] for each in ALL[1:3])
    np.testing.assert_allclose(plane, np.diag([0.1, 0.0, 0.0]), atol=1e-15)
    np.testing.assert_allclose(turned, np.diag([0.1, 0.0, 0.25 / 2.5]), atol=1e-15)


def test_forces_around_an_axis_have_the_torque_about_it_alone() -> None:
    places, about = np.array([[2.0, 0.0], [3.0, 1.0]]), np.zeros(2)
    force, moment = Torsion().resultant(np.array([[1.0, 5.0, 0.5], [2.0, 6.0, 2.0]]), places, about)
    np.testing.assert_allclose(force, [3.0, 11.0])
    np.testing.assert_allclose(moment, [2.0 * 0.5 + 3.0 * 2.0])
    forces = np.array([[1.0, 5.0], [2.0, 6.0]])
    assert np.size(Revolution().resultant(forces, places, about)[1]) == 0
    assert Kinematics(2).resultant(forces, places, about)[1] == pytest.approx(2.0 * 5.0 + 3.0 * 6.0 - 2.0)


def test_reduced_integration_has_the_degree_of_linear_cells() -> None:
    assert [each.degree(2, 2) for each in (FULL, Reduced(), Stabilised())] == [4, 2, 2]
    assert AT_SECTIONS.share < STABILISED.share < 0.01
