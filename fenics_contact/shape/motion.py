"""Smooth extension of a surface displacement into the mesh."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import ufl

from fenics_contact import _dolfinx
from fenics_contact._libraries import MPI, PETSc, check_not_forked
from fenics_contact.contact import body_mesh
from fenics_contact.display import displayed
from fenics_contact.errors import InvalidInputError
from fenics_contact.fem import Template, volume_measure
from fenics_contact.feti import Decomposition
from fenics_contact.linalg import dispose_with
from fenics_contact.scene import Body, Scene, mirrored
from fenics_contact.shape.design import SurfaceDesign


@displayed
class HarmonicExtension:
    """Each component of the mesh displacement is harmonic, prescribed on the design surface, zero where held.

    The matrix is that of the reference mesh: the extension is linear in the surface displacement, and one
    factorisation serves all designs and, transposed, all gradients.

    Attributes:
        moving: Nodes of the design surface.
        held: Components of nodes that do not move, shape (n_nodes, dim).
    """

    def _facts(self) -> dict[str, np.ndarray]:
        return {"moving": self.moving, "held": self.held}

    def __init__(
        self, decomposition: Decomposition, name: str, body: Body, moving: np.ndarray, held: np.ndarray
    ) -> None:
        """Assemble and factor the Laplacian of a body. Collective on the decomposition's communicator.

        Args:
            decomposition: Which rank owns which cells.
            name: Name of the body.
            body: The body in its reference shape.
            moving: Nodes of the design surface.
            held: Components of nodes that do not move, shape (n_nodes, dim): all of them, or on a plane of
                symmetry the one across it.

        Raises:
            InvalidInputError: If a node is both moved and held.
        """
        both = int(np.count_nonzero(held[moving].all(axis=1)))
        if both:
            raise InvalidInputError(
                f"the design surface must keep away from supports, but {both} nodes of "
                f"body {name!r} "
                "lie on both: choose another surface"
            )
        self.moving, self.held = moving, held
        mesh = body_mesh(decomposition, name, body)
        V = _dolfinx.nodal_space(body.mesh.cell_type)
        form = ufl.inner(ufl.grad(ufl.TrialFunction(V)), ufl.grad(ufl.TestFunction(V)))
        template = Template(mesh.comm, form * volume_measure(body.mesh.cell_type, 2), ())
        space = _dolfinx.scalar_space(mesh, 1)
        self._space = space  # its mesh owns the matrix's communicator, which must not be freed before
        self._laplacian = _dolfinx.assemble_matrix(template.bind([space, space], ()))
        nodes, dofs = _dolfinx.node_dofs(space)
        self._rows = np.zeros(body.mesh.n_nodes, dtype=PETSc.IntType)
        mine = np.full(body.mesh.n_nodes, -1, dtype=np.int64)
        mine[nodes] = _dolfinx.global_dofs(space, dofs)
        mesh.comm.Allreduce(mine, everywhere := np.empty_like(mine), op=MPI.MAX)
        self._rows[:] = everywhere
        dispose_with(self, self._laplacian, comm=decomposition.comm, keep=space)
        known: dict[bytes, PETSc.KSP] = {}
        self._given, self._ksp = [], []
        for column in held.T:
            given = np.union1d(moving, np.flatnonzero(column))
            self._given.append(self._rows[given])
            key = given.tobytes()
            known[key] = known.get(key) or self._factor(given)
            self._ksp.append(known[key])

    def _factor(self, given: np.ndarray) -> PETSc.KSP:
        matrix = self._laplacian.copy()
        matrix.zeroRowsColumns(self._rows[given], diag=1.0)
        ksp = PETSc.KSP().create(matrix.getComm())
        ksp.setOperators(matrix)
        ksp.setType(PETSc.KSP.Type.PREONLY)
        ksp.getPC().setType(PETSc.PC.Type.LU)
        ksp.getPC().setFactorSolverType("mumps")
        ksp.setUp()
        comm = self._laplacian.getComm().tompi4py()
        dispose_with(self, ksp.getPC(), ksp, matrix, comm=comm, keep=self._space)
        return ksp

    def extend(self, displacement: np.ndarray) -> np.ndarray:
        """Return the displacement of all nodes, shape (n_nodes, dim), from the moving ones'. Collective."""
        check_not_forked()
        prescribed, right = self._laplacian.createVecs()
        solution = right.duplicate()
        result = np.zeros((len(self._rows), displacement.shape[1]))
        for axis in range(displacement.shape[1]):
            prescribed.zeroEntries()
            self._put(prescribed, self._rows[self.moving], displacement[:, axis])
            self._laplacian.mult(prescribed, right)
            right.scale(-1.0)
            self._put(right, self._given[axis], self._values(prescribed)[self._given[axis]])
            self._ksp[axis].solve(right, solution)
            result[:, axis] = self._values(solution)[self._rows]
        for vector in (prescribed, right, solution):
            vector.destroy()
        return result

    def pull_back(self, gradient: np.ndarray) -> np.ndarray:
        """Return the transpose of `extend` applied to nodal derivatives, shape (n_moving, dim). Collective.

        Args:
            gradient: Derivative by the displacement of every node, shape (n_nodes, dim), replicated.
        """
        check_not_forked()
        right, image = self._laplacian.createVecs()
        adjoint = right.duplicate()
        result = np.zeros((len(self.moving), gradient.shape[1]))
        for axis in range(gradient.shape[1]):
            self._put(right, self._rows, gradient[:, axis])
            self._put(right, self._given[axis], np.zeros(len(self._given[axis])))
            self._ksp[axis].solve(right, adjoint)
            self._laplacian.mult(adjoint, image)
            result[:, axis] = gradient[self.moving, axis] - self._values(image)[self._rows[self.moving]]
        for vector in (right, image, adjoint):
            vector.destroy()
        return result

    @staticmethod
    def _put(vector: PETSc.Vec, rows: np.ndarray, values: np.ndarray) -> None:
        """Set the entries that this rank owns."""
        start, stop = vector.getOwnershipRange()
        here = (rows >= start) & (rows < stop)
        vector.array_w[rows[here] - start] = values[here]

    @staticmethod
    def _values(vector: PETSc.Vec) -> np.ndarray:
        """Return all entries of a distributed vector on every rank."""
        comm = vector.getComm().tompi4py()
        return np.concatenate(comm.allgather(vector.array_r))


def motion_of(decomposition: Decomposition, scene: Scene, design: SurfaceDesign) -> HarmonicExtension:
    """Return the extension that moves the mesh of a body with its design. Collective.

    Raises:
        InvalidInputError: If a moving surface is held.
    """
    name = design.body
    body = scene.bodies[name]
    cut = mirrored(scene, name)
    held = cut.copy()
    for support in scene.supports:
        if support.body == name:
            facets = body.mesh.surfaces[support.surface]
            held[facets[~cut[facets].all(axis=1).any(axis=1)]] = True
    held[design.nodes_beyond_transition(body.mesh, cut)] = True
    return HarmonicExtension(decomposition, name, body, design.lattice.nodes, held)


def moving_nodes(
    scene: Scene, designs: Sequence[SurfaceDesign], motions: Sequence[HarmonicExtension]
) -> dict[str, np.ndarray]:
    """Return which nodes of each body its designs move, body name -> marks, shape (n_nodes,)."""
    moving = {name: np.zeros(body.mesh.n_nodes, dtype=bool) for name, body in scene.bodies.items()}
    for design, motion in zip(designs, motions, strict=True):
        moving[design.body] |= ~motion.held.all(axis=1)
    return moving
