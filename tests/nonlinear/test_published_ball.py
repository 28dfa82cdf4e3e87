"""A cube of metal under a rigid ball, with a published force on the same mesh.

J. Frohne, T. Heister, W. Bangerth, Efficient numerical methods for the large-scale, parallel solution of
elastoplastic contact problems, Int. J. Numer. Methods Eng. 105 (2016); force from tutorial 42 of deal.II.
"""

from __future__ import annotations

from mpi4py import MPI

from benchmarks.large_deformations.ball_on_metal import pressed
from fenics_contact import box_partition, solve_scene
from fenics_contact.gallery import block

#: Force on 512 hexahedra, and its last digit.
PUBLISHED, DIGIT = 37.3058, 1e-4


def test_a_ball_on_yielding_metal_has_the_published_force() -> None:
    mesh = block((0, 0, 0), (0.5, 0.5, 1), (4, 4, 8))
    state = solve_scene(pressed(mesh), MPI.COMM_SELF, partitions={"cube": box_partition(mesh, (2, 2, 2))})
    assert abs(-4.0 * state.contact.force[:, 2].sum() - PUBLISHED) < DIGIT
