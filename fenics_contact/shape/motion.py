"""The mesh follows its design surface."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import ufl

from fenics_contact import _dolfinx
from fenics_contact._libraries import MPI, PETSc, check_not_forked
from fenics_contact.contact import body_mesh
from fenics_contact.display import counted, displayed
from fenics_contact.errors import InvalidInputError
from fenics_contact.fem import Template, volume_measure
from fenics_contact.feti import Decomposition
from fenics_contact.linalg import dispose_with
from fenics_contact.scene import Body, Scene, mirrored
from fenics_contact.shape.design import SurfaceDesign


@dataclass(frozen=True)
class _Nodes:
    """Some nodes: where they are in arrays of all and in distributed vectors of them alone."""

    comm: MPI.Comm
    rows: PETSc.IS
    here: np.ndarray

    @classmethod
    def chosen(cls, space: _dolfinx.fem.FunctionSpace, marks: np.ndarray) -> _Nodes:
        """Return the marked ones, marks of shape (n_nodes,). Collective."""
        nodes, dofs = _dolfinx.node_dofs(space)
        own = (dofs < space.dofmap.index_map.size_local) & marks[nodes]
        rows = _dolfinx.global_dofs(space, dofs[own])
        order, comm = np.argsort(rows), space.mesh.comm
        return cls(comm, PETSc.IS().createGeneral(rows[order].astype(PETSc.IntType), comm), nodes[own][order])

    def add(self, vector: PETSc.Vec, values: np.ndarray) -> None:
        """Add a vector to values at all nodes, shape (n_nodes,), on every rank. Collective."""
        for places, part in self.comm.allgather((self.here, vector.array_r)):
            values[places] += part


class _Component:
    """One component of the motion: at some nodes it is free, at others given, at the rest zero."""

    def __init__(
        self, space: _dolfinx.fem.FunctionSpace, matrix: PETSc.Mat, given: np.ndarray, free: np.ndarray
    ) -> None:
        """Factor the matrix of the free nodes. Collective.

        Args:
            given: Marks of the nodes where it is given, shape (n_nodes,).
        """
        self._given, self._free = _Nodes.chosen(space, given), _Nodes.chosen(space, free)
        inner = matrix.createSubMatrix(self._free.rows, self._free.rows)
        self._coupling = matrix.createSubMatrix(self._free.rows, self._given.rows)
        self._ksp = PETSc.KSP().create(inner.getComm())
        self._ksp.setOperators(inner)
        self._ksp.setType(PETSc.KSP.Type.PREONLY)
        self._ksp.getPC().setType(PETSc.PC.Type.LU)
        self._ksp.getPC().setFactorSolverType("mumps")
        self._ksp.setUp()
        owned = (self._ksp.getPC(), self._ksp, inner, self._coupling, self._free.rows, self._given.rows)
        # The mesh owns the communicator, which must not be freed before them.
        dispose_with(self, *owned, comm=space.mesh.comm, keep=space)

    def extend(self, values: np.ndarray) -> None:
        """Fill in the free nodes, of values at all nodes. Collective."""
        known, right = self._coupling.createVecs()
        solution = right.duplicate()
        known.array_w[:] = -values[self._given.here]
        self._coupling.mult(known, right)
        self._ksp.solve(right, solution)
        self._free.add(solution, values)
        for vector in (known, right, solution):
            vector.destroy()

    def pull_back(self, values: np.ndarray) -> None:
        """Add to derivatives at the given nodes those at the free ones that follow them. Collective."""
        known, right = self._coupling.createVecs()
        adjoint = right.duplicate()
        right.array_w[:] = -values[self._free.here]
        self._ksp.solve(right, adjoint)
        self._coupling.multTranspose(adjoint, known)
        self._given.add(known, values)
        for vector in (known, right, adjoint):
            vector.destroy()


@displayed
class MeshMotion:
    """Each component of the mesh displacement is as smooth as the mesh allows, in small cells above all.

    It minimises ∫ ∇v·∇v det(J)^(−χ) dx, J the Jacobian of the cells, prescribed on the design surface, zero
    where held: large cells give way and small ones keep their shape. On equal cells it is harmonic. Sides
    along which the surface moves stay flat. All is integrated over the reference mesh: the motion is linear
    in the surface displacement, and one factorisation serves all designs and, transposed, all gradients.

    Attributes:
        moving: Nodes of the design surface.
        held: Components of nodes that do not move, shape (n_nodes, dim).

    References:
        Stein, Tezduyar and Benson, Mesh moving techniques for fluid-structure interactions with large
        displacements, J. Appl. Mech. 70 (2003), 58-63: stiffness by the Jacobian.
    """

    def _facts(self) -> dict[str, np.ndarray]:
        return {"moving": self.moving, "held": self.held}

    def __init__(
        self,
        decomposition: Decomposition,
        name: str,
        body: Body,
        moving: np.ndarray,
        held: np.ndarray,
        *,
        stiffening: float = 2.0,
    ) -> None:
        """Assemble and factor the stiffness of a mesh. Collective on the decomposition's communicator.

        Args:
            decomposition: Which rank owns which cells.
            name: Name of the body.
            body: The body in its reference shape.
            moving: Nodes of the design surface.
            held: Components of nodes that do not move, shape (n_nodes, dim): all of them, or on a plane of
                symmetry the one across it.
            stiffening: χ: 0 makes all cells equally stiff.

        Raises:
            InvalidInputError: If a node is both moved and held.
        """
        both = int(np.count_nonzero(held[moving].all(axis=1)))
        if both:
            nodes = counted(both, f"node of body {name!r} lies", f"nodes of body {name!r} lie")
            raise InvalidInputError(
                f"the design surface must keep away from supports, but {nodes} on both: "
                "choose another surface"
            )
        self.moving, self.held = moving, held
        mesh = body_mesh(decomposition, name, body)
        space = _dolfinx.scalar_space(mesh, 1)
        template = Template(mesh.comm, _stiffness(body.mesh.cell_type, stiffening), ())
        matrix = _dolfinx.assemble_matrix(template.bind([space, space], ()))
        given = np.zeros(body.mesh.n_nodes, dtype=bool)
        given[moving] = True
        known: dict[bytes, _Component] = {}
        for column in held.T:
            key = column.tobytes()
            known[key] = known.get(key) or _Component(space, matrix, given, ~(given | column))
        self._components = [known[column.tobytes()] for column in held.T]
        matrix.destroy()

    def extend(self, displacement: np.ndarray) -> np.ndarray:
        """Return the displacement of all nodes, shape (n_nodes, dim), from the moving ones'. Collective."""
        check_not_forked()
        result = np.zeros(self.held.shape)
        result[self.moving] = displacement
        for component, values in zip(self._components, result.T, strict=True):
            component.extend(values)
        return result

    def pull_back(self, gradient: np.ndarray) -> np.ndarray:
        """Return the transpose of `extend` applied to nodal derivatives, shape (n_moving, dim). Collective.

        Args:
            gradient: Derivative by the displacement of every node, shape (n_nodes, dim), replicated.
        """
        check_not_forked()
        result = np.array(gradient, dtype=float)
        for component, values in zip(self._components, result.T, strict=True):
            component.pull_back(values)
        return np.asarray(result[self.moving])


def _stiffness(cell_type: str, stiffening: float) -> ufl.Form:
    """Write ∫ ∇u · ∇v det(J)^(−χ) dx."""
    V, mesh = _dolfinx.nodal_space(cell_type), _dolfinx.template(cell_type)
    u, v = ufl.TrialFunction(V), ufl.TestFunction(V)
    weight = abs(ufl.JacobianDeterminant(mesh)) ** (-stiffening)
    return weight * ufl.inner(ufl.grad(u), ufl.grad(v)) * volume_measure(cell_type, 2)


def motion_of(decomposition: Decomposition, scene: Scene, design: SurfaceDesign) -> MeshMotion:
    """Return how the mesh of a body follows its design. Collective."""
    name = design.body
    body = scene.bodies[name]
    cut = mirrored(scene, name)
    held = cut.copy()
    for support in scene.supports:
        if support.body == name:
            facets = body.mesh.surfaces[support.surface]
            held[facets[~cut[facets].all(axis=1).any(axis=1)]] = True
    held[design.nodes_beyond_transition(body.mesh, cut)] = True
    return MeshMotion(decomposition, name, body, design.lattice.nodes, held)


def moving_nodes(
    scene: Scene, designs: Sequence[SurfaceDesign], motions: Sequence[MeshMotion]
) -> dict[str, np.ndarray]:
    """Return which nodes of each body its designs move, body name -> marks, shape (n_nodes,)."""
    moving = {name: np.zeros(body.mesh.n_nodes, dtype=bool) for name, body in scene.bodies.items()}
    for design, motion in zip(designs, motions, strict=True):
        moving[design.body] |= ~motion.held.all(axis=1)
    return moving
