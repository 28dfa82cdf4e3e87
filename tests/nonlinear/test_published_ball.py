"""A cube of metal under a rigid ball, with a published force on the same mesh.

J. Frohne, T. Heister, W. Bangerth, Efficient numerical methods for the large-scale, parallel solution of
elastoplastic contact problems, Int. J. Numer. Methods Eng. 105 (2016); force from tutorial 42 of deal.II.
"""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from fenics_contact.contact import solve_scene
from fenics_contact.gallery import block
from fenics_contact.partition import box_partition
from fenics_contact.scene import Body, ContactPair, J2Plasticity, RigidPlane, Scene, Support, Surface

#: Force on 512 hexahedra, and its last digit.
PUBLISHED, DIGIT = 37.3058, 1e-4


def above_the_pole(points: np.ndarray) -> np.ndarray:
    """Height of a ball of radius 0.6 over its lowest point, on the vertical through each point."""
    beside = ((points[:, :2] - 0.5) ** 2).sum(axis=1)
    return np.asarray(0.6 - np.sqrt(0.36 - np.minimum(beside, 0.35)))


def test_a_ball_on_yielding_metal_has_the_published_force() -> None:
    """A quarter of the cube, lifted by 0.01; there the deviator, not √(3/2) of it, is bounded by 400."""
    modulus, ratio, bound, growth = 2e5, 0.3, 400.0, 0.01
    slope = 1.5 * modulus / (1.0 + ratio) * growth / (1.0 - growth)
    metal = J2Plasticity(modulus, ratio, np.sqrt(1.5) * bound, isotropic_hardening=slope)
    mesh = block((0, 0, 0), (0.5, 0.5, 1), (4, 4, 8))
    supports = [
        Support("cube", "z0", (0.0, 0.0, 0.01)),
        *(Support("cube", side, (0.0, 0.0, None)) for side in ("x0", "y0")),
        Support("cube", "x1", (0.0, None, None)),
        Support("cube", "y1", (None, 0.0, None)),
    ]
    plane = RigidPlane((0, 0, 1), (0, 0, -1))
    pair = ContactPair(Surface("cube", "z1"), plane, gap=above_the_pole)
    scene = Scene({"cube": Body(mesh, metal)}, supports, contacts=[pair])
    state = solve_scene(scene, MPI.COMM_SELF, partitions={"cube": box_partition(mesh, (2, 2, 2))})
    assert abs(-4.0 * state.contact.force[:, 2].sum() - PUBLISHED) < DIGIT
