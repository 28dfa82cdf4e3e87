"""A taper in space that friction holds where it was driven: pulled, it answers alike in every partition."""

from __future__ import annotations

import numpy as np
import pytest

#: Pressed, unloaded and pulled: for each partition the pull in contact, the normal forces and the motion.
PULLED = """
import numpy as np
from mpi4py import MPI
from fenics_contact import ContactProblem, LoadSequence
from fenics_contact.gallery import block
from fenics_contact.mesh import bisection_partition
from fenics_contact import Body, ContactPair, Coulomb, LoadStep, RigidPlane, Scene, Surface, TotalForce
from fenics_contact.materials import IsotropicElasticity

angle, comm = np.radians(5.0), MPI.COMM_WORLD
base = block((-1.0, 0.0, 1.0), (1.0, 1.0, 6.0), (2, 2, 4))
x, y, z = base.points.T
mesh = base.moved(np.column_stack([x * (2.0 + z * np.tan(angle)), y + 0.02 * x * z, z]))
c, s = np.cos(angle), np.sin(angle)
walls = {"x1": RigidPlane((2.0, 0.0, 0.0), (-c, 0.0, s)), "x0": RigidPlane((-2.0, 0.0, 0.0), (c, 0.0, s))}
pairs = [ContactPair(Surface("taper", side), wall, Coulomb(0.3)) for side, wall in walls.items()]
scene = Scene({"taper": Body(mesh, IsotropicElasticity(1000.0, 0.3))}, [], [], pairs)
for pieces in PIECES:
    cut = {"taper": bisection_partition(mesh, pieces)}
    steps = LoadSequence(ContactProblem(scene, comm, partitions=cut, tolerance=1e-8))
    for force in (50.0, 25.0, 0.0, -5.0):
        pull = TotalForce("taper", "z1", (0.0, 0.0, -force))
        state = steps.advance(LoadStep(f"{force:g}", loads=[pull]))
    moved = np.linalg.norm(state.gather_displacement("taper"))
    if comm.rank == 0:
        print(-state.contact.force[:, 2].sum(), state.contact.normal_force.sum(), moved)
"""


@pytest.mark.parametrize(
    ("ranks", "pieces"), [(1, (1, 2, 3)), (2, (2, 5)), pytest.param(4, (5,), marks=pytest.mark.claim)]
)
def test_a_jammed_taper_bears_a_pull_alike_on_all_ranks_and_partitions(
    ranks: int, pieces: tuple[int, ...], mpirun
) -> None:
    written = mpirun(PULLED.replace("PIECES", repr(pieces)), ranks).split()
    found = np.array(written, dtype=float).reshape(len(pieces), 3)
    np.testing.assert_allclose(found, np.tile([5.0, 107.329345, 1.8832162], (len(pieces), 1)), rtol=1e-6)
