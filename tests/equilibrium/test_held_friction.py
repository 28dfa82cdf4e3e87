"""Friction at nodes that supports hold, of which there are more than the master has nodes."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import Body, ContactPair, Coulomb, Scene, Support, Surface, Tresca, solve_scene
from fenics_contact.gallery import rectangle_lattice
from fenics_contact.materials import PlaneStrain
from tests.scenes import partitions


def drawn(law: Coulomb | Tresca, kind: str) -> Scene:
    """Four cells, whose lower side is drawn along x, on two."""
    places = {"low": ((0.0, 1.0, 2.0), (0.0, 0.6, 1.0)), "up": (np.linspace(0.0, 2.0, 5), (1.0, 1.4, 1.8))}
    bodies = {
        name: Body(rectangle_lattice([np.array(each) for each in at], "quadrilateral"), PlaneStrain(1.0, 0.3))
        for name, at in places.items()
    }
    held = [Support("low", "y0"), Support("up", "y0", (0.002, None)), Support("up", "y1", (None, -0.02))]
    pair = ContactPair(Surface("up", "y0"), Surface("low", "y1"), law, kind)  # type: ignore[arg-type]
    return Scene(bodies, held, contacts=[pair])


@pytest.mark.parametrize("law", [Coulomb(0.9), Tresca(1.0)])
@pytest.mark.parametrize("kind", ["node", "mortar"])
def test_of_all_friction_with_one_effect_the_most_even_one_is_found(law: Coulomb | Tresca, kind: str) -> None:
    """Σ τ²/A is least where tractions lie in the space of the master, linear between its nodes."""
    scene, found = drawn(law, kind), []
    for cut in (None, partitions(scene, (2, 2, 1))):
        contact = solve_scene(scene, MPI.COMM_SELF, partitions=cut, tolerance=1e-10).contact
        order = np.argsort(scene.points[contact.points.slave, 0])
        along = contact.traction[order, 0] * contact.points.tangents[order, 0, 0]
        found.append(along)
        stuck = np.abs(contact.friction_force[order, 0]) < 0.999 * contact.slip_bound[order]
        assert stuck.all()
        if kind == "node":
            assert along[[1, 3]] == pytest.approx(0.5 * (along[[0, 2]] + along[[2, 4]]), rel=1e-7)
    np.testing.assert_allclose(*found, rtol=0.0, atol=1e-7 * np.abs(found).max())
