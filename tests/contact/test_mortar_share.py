"""Mortar between true surfaces: gaps that linear displacements of both bodies can close."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import Body, Scene, solve_scene
from fenics_contact._scene.pair_geometry import master_share
from fenics_contact.materials import IsotropicElasticity, OrthotropicElasticity
from fenics_contact.study import Parameters
from fenics_contact.study.scenes import hertz


def pressed(size: int) -> Scene:
    return hertz.build(Parameters(size, discretisation="mortar"), MPI.COMM_SELF).scene


def missed(scene: Scene) -> float:
    """Relative error of the pressure in the middle, beside Hertz."""
    state = solve_scene(scene, MPI.COMM_SELF, tolerance=1e-6)
    middle = np.argmin(np.linalg.norm(state.contact_places[:, :2], axis=1))
    return float(state.contact.pressure[middle] / hertz.PEAK - 1)


@pytest.mark.parametrize("size", [2, 4])
def test_mirrored_bodies_are_as_exact_as_between_their_facets(size: int) -> None:
    scene = pressed(size)
    faceted = replace(scene, contacts=[replace(pair, geometry="faceted") for pair in scene.contacts])
    found = missed(scene)
    assert abs(found) < 0.005
    assert found == pytest.approx(missed(faceted), abs=1e-4)


def test_the_share_is_that_of_the_compliance() -> None:
    scene = pressed(2)
    (pair,) = scene.contacts
    assert master_share(scene, pair) == pytest.approx(0.5)
    lower = Body(scene.bodies["lower"].mesh, IsotropicElasticity(3 * hertz.YOUNG, hertz.POISSON))
    stiffer = replace(scene, bodies={**scene.bodies, "lower": lower})
    assert master_share(stiffer, pair) == pytest.approx(0.25)
    wood = OrthotropicElasticity((12e3, 800.0, 500.0), (0.4, 0.35, 0.3), (700.0, 600.0, 60.0))
    grown = replace(scene, bodies={**scene.bodies, "lower": Body(lower.mesh, wood)})
    assert master_share(grown, pair) == 0.5
