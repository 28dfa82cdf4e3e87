"""The cells of a mesh, none of which share nodes: what each of them answers to its own displacement."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from fenics_contact import _dolfinx
from fenics_contact._fem.composition import Composition
from fenics_contact._fem.forms import FormLibrary
from fenics_contact._fem.kinematics import GaussPoints
from fenics_contact._fem.mechanics import MaterialStep, Mechanics, Response
from fenics_contact._kinematics.element import Element


def values_of_dofs(space: _dolfinx.fem.FunctionSpace, values: np.ndarray) -> np.ndarray:
    """Return values by dof at the nodes of each cell of a mesh on one rank, (n_cells, nodes, components)."""
    return np.asarray(values.reshape(-1, space.dofmap.index_map_bs)[_dolfinx.vtk_cell_dofs(space)])


def values_of_nodes(space: _dolfinx.fem.FunctionSpace, values: np.ndarray) -> np.ndarray:
    """Return values by input node at the nodes of each cell of a mesh on one rank, (n_cells, nodes, ...)."""
    nodes, dofs = _dolfinx.node_dofs(space)
    by_block = np.empty_like(values)
    by_block[dofs] = values[nodes]
    return np.asarray(by_block[_dolfinx.vtk_cell_dofs(space)])


@dataclass(frozen=True, eq=False)
class CellTangent:
    """What cells of any materials resist at a displacement, in the mean over each.

    Attributes:
        stress: Nominal stress P, shape (n_cells, components, dim), [force / length²].
        change: Of the stress along another displacement, to first order, shape as of ``stress``.
        moduli: ∂P_ij/∂∇u_kl, index dim i + j, shape (n_cells, components dim, components dim); at no
            change of strains that displacements have themselves.
    """

    stress: np.ndarray
    change: np.ndarray
    moduli: np.ndarray


@dataclass(frozen=True, eq=False)
class SeparateCells:
    """Cells with nodes of their own, in the order in which they were given.

    `mechanics`: of all of them; `order`: number of each as dolfinx has ordered them; `blocks`: dofs of their
    nodes, shape (n_cells, nodes of a cell); `points`: by cell and node; `gauss`: points of integration, their
    cells in dolfinx's order.
    """

    mechanics: Mechanics
    order: np.ndarray
    blocks: np.ndarray
    points: np.ndarray
    gauss: GaussPoints

    @classmethod
    def of(
        cls,
        forms: FormLibrary,
        parts: Callable[[np.ndarray], Composition],
        element: Element,
        points: np.ndarray,
    ) -> SeparateCells:
        """Return cells whose forms are compiled, with nodes at some points, (n_cells, nodes of a cell, dim).

        `parts`: returns the materials of some of the cells.
        """
        count, width, dim = points.shape
        nodes = np.arange(count * width).reshape(count, width)
        mesh = _dolfinx.local_mesh(points.reshape(-1, dim), nodes, element.cells)
        space = _dolfinx.coefficient(mesh, "u", element.components).function_space
        here, dofs = _dolfinx.node_dofs(space)
        blocks = np.empty(count * width, dtype=np.int64)
        blocks[here] = dofs
        by_block = np.empty((count * width, dim))
        by_block[blocks] = points.reshape(-1, dim)
        order = _dolfinx.input_cells(mesh)
        mechanics = forms.mechanics(parts(order), element, space, points.reshape(-1, dim))
        # Products of two errors are of second degree on linear cells.
        gauss = GaussPoints(space, element, by_block, 2 * element.cell.order + 1)
        return cls(mechanics, order, blocks.reshape(count, width), points, gauss)

    def forces(self, displacement: np.ndarray, step: MaterialStep) -> np.ndarray:
        """Return the forces of each cell for a displacement, both (n_cells, nodes of a cell, components).

        `step`: with the history by cell in their order, and temperatures by cell and node.
        """
        return self._at_nodes(self._answer(displacement, step).force, displacement.shape[2])

    def tangent(self, displacement: np.ndarray, along: np.ndarray, step: MaterialStep) -> CellTangent:
        """Return stresses and moduli for a displacement; arguments as of `forces`.

        They are what nodal forces and their growth do along displacements that are linear in each cell, and
        zero at its middle: the mean moduli of the cell, of which those with a mean dilatation are a part.
        `along`: the other displacement, of the same shape.
        """
        count, width, components = displacement.shape
        away = self.points - self.points.mean(axis=1, keepdims=True)
        motions = np.einsum("ik,naj->naikj", np.eye(components), away).reshape(count, width * components, -1)
        answer, volume = self._answer(displacement, step), self.weights.sum(axis=1)[:, None]

        def stress(forces: np.ndarray) -> np.ndarray:
            forces = self._at_nodes(forces, components).reshape(count, -1)
            return np.asarray(np.einsum("nam,na->nm", motions, forces) / volume)

        columns = [stress(answer.stiffness @ self._by_dof(each)) for each in np.moveaxis(motions, 2, 0)]
        shape, change = (count, components, -1), stress(answer.stiffness @ self._by_dof(along))
        return CellTangent(
            stress(answer.force).reshape(shape), change.reshape(shape), np.stack(columns, axis=2)
        )

    @property
    def weights(self) -> np.ndarray:
        """Volumes that belong to the Gauss points of each cell, (n_cells, n_gauss)."""
        return self._ordered(self.gauss.weights)

    def gradients(self, displacement: np.ndarray) -> np.ndarray:
        """Return ∇u in space at the Gauss points, shape (n_cells, n_gauss, 3, 3)."""
        return self._ordered(self.gauss.gradient(self._by_dof(displacement)))

    def within(self, values: np.ndarray) -> np.ndarray:
        """Return values at the Gauss points by those at the nodes of cells, (n_cells, nodes, ...)."""
        return self.gauss.within(values)

    def _answer(self, displacement: np.ndarray, step: MaterialStep) -> Response:
        history, temperature = step.history, step.temperature
        if history is not None:
            history = history[self.order]
        if temperature is not None:
            temperature = temperature.ravel()
        step = replace(step, history=history, temperature=temperature)
        return self.mechanics.at(self._by_dof(displacement), step)

    def _by_dof(self, values: np.ndarray) -> np.ndarray:
        by_block = np.empty((self.blocks.size, values.size // self.blocks.size))
        by_block[self.blocks.ravel()] = values.reshape(by_block.shape)
        return by_block.ravel()

    def _at_nodes(self, values: np.ndarray, components: int) -> np.ndarray:
        return np.asarray(values.reshape(-1, components)[self.blocks])

    def _ordered(self, by_cell: np.ndarray) -> np.ndarray:
        result = np.empty_like(by_cell)
        result[self.order] = by_cell
        return result
