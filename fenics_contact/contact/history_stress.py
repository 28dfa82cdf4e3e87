"""Stresses of materials with a history, which displacements alone do not tell."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from fenics_contact import _dolfinx
from fenics_contact.contact.fields import cells_of_body
from fenics_contact.fem import Response, quadrature_degree
from fenics_contact.feti import TornSystem
from fenics_contact.mesh import CELL_TYPES, BodyMesh, jacobians, quadrature


def put_history_stress(
    field: _dolfinx.fem.Function,
    torn: TornSystem,
    name: str,
    responses: tuple[Response, ...],
    quantity: Callable[[np.ndarray], np.ndarray],
) -> None:
    """Overwrite a field on the cells of materials with a history, all of which this rank knows. Collective.

    Args:
        field: Function on the body's mesh, constant on cells, of other materials' stresses.
        torn: The torn system.
        name: The body.
        responses: What each of this rank's subdomains answers.
        quantity: What the field is the mean of, of stresses (..., 3, 3).
    """
    body, shape = torn.scene.bodies[name], field.ufl_shape
    known = np.full((body.mesh.n_cells, *shape), np.nan)
    for mesh, response in zip(torn.decomposition.meshes, responses, strict=True):
        if mesh.body == name and response.stress is not None:
            known[mesh.cells] = _means(body.mesh, mesh.cells, quantity(response.stress))
    number = cells_of_body(field.function_space.mesh, body.mesh.cells)
    mine = known[number].reshape(len(number), math.prod(shape))  # a rank may have no cells
    here = ~np.isnan(mine[:, 0])
    own = _dolfinx.cell_dofs(field.function_space).ravel()[: len(number)]
    field.x.array.reshape(-1, mine.shape[1])[own[here]] = mine[here]
    field.x.scatter_forward()


def _means(mesh: BodyMesh, cells: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return means over cells of values at Gauss points, (n_cells, n_gauss, ...) to (n_cells, ...)."""
    positions, weights = quadrature(CELL_TYPES[mesh.cell_type], quadrature_degree(mesh.cell_type))
    weights = weights * jacobians(mesh.points, mesh.cells[cells], positions)
    weights = weights / weights.sum(axis=1, keepdims=True)
    return np.einsum("cq,cq...->c...", weights, values)
