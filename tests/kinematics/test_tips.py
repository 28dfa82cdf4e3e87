"""A tip on the axis of revolution presses, on quadratic cells, too."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import Body, BodyMesh, ContactPair, RigidPlane, Scene, Support, Surface, solve_scene
from fenics_contact.gallery import rectangle
from fenics_contact.materials import IsotropicElasticity, Material, NeoHooke
from fenics_contact.mesh import quadratic

pytestmark = pytest.mark.filterwarnings("ignore::UserWarning")

#: Tangent of the half angle of a cone, how deep it is pressed, and size of the block.
STEEPNESS, DEPTH, SIZE = 2.7, 0.02, 1.2


def under_a_cone(mesh: BodyMesh, material: Material) -> tuple[float, float]:
    """Return force and displacement at the tip of a rigid cone in a block that is held below."""
    normal = np.array([1.0, -STEEPNESS]) / np.hypot(1.0, STEEPNESS)
    pair = ContactPair(Surface("block", "y1"), RigidPlane((0.0, -DEPTH), normal), interference="measured")
    bodies = {"block": Body(mesh, material, axisymmetric=True)}
    scene = Scene(bodies, [Support("block", "y0")], contacts=[pair])
    state = solve_scene(scene, MPI.COMM_SELF)
    tip = np.argmin(np.hypot(*mesh.points.T))
    force = state.contact.normal_force @ state.contact.points.normal
    return float(-force[1]), float(state.gather_displacement("block")[tip, 1])


@pytest.mark.parametrize(
    "material", [IsotropicElasticity(2e5, 0.3), NeoHooke(2e5, 0.3)], ids=["small", "large"]
)
def test_a_cone_does_not_go_through_the_node_on_the_axis(material: Material) -> None:
    """Sneddon's force on a half space is 2 E* d² tan θ / π; a block of 60 depths is a little stiffer."""
    mesh = quadratic(rectangle((0, -SIZE), (SIZE, 0), (10, 10)))
    force, down = under_a_cone(mesh, material)
    sneddon = 2.0 / np.pi * 2e5 / (1 - 0.3**2) * DEPTH**2 * STEEPNESS
    assert down == pytest.approx(-DEPTH, rel=1e-4)
    assert force == pytest.approx(sneddon, rel=0.1)
