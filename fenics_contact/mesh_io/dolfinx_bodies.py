"""Bodies of a dolfinx mesh, with the way back: fields of the bodies as Functions on that mesh."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from fenics_contact.display import displayed
from fenics_contact.errors import InvalidInputError, together
from fenics_contact.mesh import BodyMesh

if TYPE_CHECKING:
    import dolfinx

    from fenics_contact._dolfinx import MeshArrays


@displayed
@dataclass(frozen=True, eq=False)
class DolfinxBodies(Mapping[str, BodyMesh]):
    """Name to body, as a read-only mapping, the same on all ranks of the mesh.

    Attributes:
        bodies: Name to body.
        cells: Name to the number of each of its cells in the order in which the mesh was created.
        nodes: Name to the number of each of its nodes, likewise.
        arrays: The mesh.
    """

    bodies: Mapping[str, BodyMesh]
    cells: Mapping[str, np.ndarray]
    nodes: Mapping[str, np.ndarray]
    arrays: MeshArrays

    def __getitem__(self, name: str) -> BodyMesh:
        """Return a body."""
        return self.bodies[name]

    def __iter__(self) -> Iterator[str]:
        """Iterate over the names."""
        return iter(self.bodies)

    def __len__(self) -> int:
        """Return the number of bodies."""
        return len(self.bodies)

    def _facts(self) -> dict[str, Any]:
        return {name: mesh.cells_in_words for name, mesh in self.bodies.items()}

    def function_on(
        self, space: dolfinx.fem.FunctionSpace, values: Mapping[str, np.ndarray], name: str = "f"
    ) -> dolfinx.fem.Function:
        """Return values of the bodies as a Function in a space on the mesh that they were made of.

        Example:
            ``bodies.function_on(V, {name: state.gather_displacement(name) for name in bodies})`` is the
            displacement in the caller's own dofs, ``state.stress[name]`` likewise in a space of degree 0.

        Args:
            space: Space of Lagrange elements on that mesh, of its order or higher, or of degree 0 for values
                on cells; scalar, or with as many components as there are.
            values: Name of a body to its values at nodes, (n_nodes,) or (n_nodes, k), in a space of degree 0
                on cells, (n_cells,) or (n_cells, k); the same on all ranks. Other bodies have zero.
            name: Name of the Function.

        Returns:
            The Function, ghosts included.

        Raises:
            InvalidInputError: If the space is on another mesh or of lower order, a body is not known, values
                have another shape, or two bodies have different values at a node that they share.

        Note:
            Collective on the mesh's communicator.
        """
        from fenics_contact import _dolfinx

        with together(space.mesh.comm):
            degree = self._checked_degree(space)
            per_body = self._checked_values(space, values, degree)
        found = _dolfinx.fem.Function(space, name=name)
        if degree > self.arrays.order:
            isoparametric = _dolfinx.nodal_space_on(space.mesh, int(space.dofmap.index_map_bs))
            found.interpolate(self.function_on(isoparametric, values))
            return found
        count, dofs = len(self.arrays.cell), _dolfinx.cell_dofs(space)
        nodes = self.arrays.node[_dolfinx.cell_geometry(space.mesh)]
        field = found.x.array.reshape(-1, int(space.dofmap.index_map_bs))
        for body, rows in per_body.items():
            place = np.full(len(self.arrays.cells), -1)
            place[self.cells[body]] = np.arange(len(self.cells[body]))
            mine = np.flatnonzero(place[self.arrays.cell] >= 0)
            if degree == 0:
                field[dofs[:count][mine]] = rows[place[self.arrays.cell[mine]], None]
            else:
                field[dofs[mine]] = rows[np.searchsorted(self.nodes[body], nodes[mine])]
        found.x.scatter_forward()
        return found

    def _checked_degree(self, space: dolfinx.fem.FunctionSpace) -> int:
        """Return the degree of a space; reject other elements and meshes."""
        from fenics_contact import _dolfinx

        given = np.asarray(space.mesh.geometry.input_global_indices)
        if not np.array_equal(self.arrays.inputs[self.arrays.node], given):
            raise InvalidInputError(
                "function_on needs a space on the mesh that the bodies were made of, this one is on another: "
                "give a space on that mesh"
            )
        degree, order = _dolfinx.lagrange_degree(space), self.arrays.order
        if degree is None or 0 < degree < order:
            raise InvalidInputError(
                f"function_on needs a space of Lagrange elements, of degree {order} or higher like the mesh, "
                f"or of degree 0 for values on cells, got {space.ufl_element()}: give another space"
            )
        return degree

    def _checked_values(
        self, space: dolfinx.fem.FunctionSpace, values: Mapping[str, np.ndarray], degree: int
    ) -> dict[str, np.ndarray]:
        """Return the values of each body as rows of the space's components."""
        size, result = int(space.dofmap.index_map_bs), {}
        what, numbers = ("cells", self.cells) if degree == 0 else ("nodes", self.nodes)
        for body, given in values.items():
            if body not in self.bodies:
                raise InvalidInputError(
                    f"function_on knows the bodies {list(self.bodies)}, got {body!r}: use these"
                )
            rows = np.asarray(given, dtype=np.float64)
            rows = rows.reshape(len(rows), -1)
            if rows.shape != (len(numbers[body]), size):
                raise InvalidInputError(
                    f"values of body {body!r} must have shape ({len(numbers[body])}, {size}), its {what} and "
                    f"the components of the space, got {np.shape(given)}: give another space or other values"
                )
            result[body] = rows
        if degree > 0:
            self._check_alike(result)
        return result

    def _check_alike(self, values: Mapping[str, np.ndarray]) -> None:
        """Reject different values of two bodies at one node, which a continuous function cannot have."""
        nodes = np.concatenate([self.nodes[body] for body in values])
        rows = np.concatenate(list(values.values()))
        order = np.argsort(nodes, kind="stable")
        same = np.diff(nodes[order]) == 0
        apart = np.abs(np.diff(rows[order], axis=0)).max(axis=1, initial=0.0)[same].max(initial=0.0)
        if apart > 1e-6 * np.abs(rows).max(initial=0.0):
            raise InvalidInputError(
                f"bodies that share nodes of the mesh must have the same values there, {list(values)} differ "
                f"by up to {apart:.3g}: bring them back one at a time, or mesh them with nodes of their own"
            )
