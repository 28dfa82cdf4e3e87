"""Derivative by the places of the nodes at which loads given as functions of position are evaluated."""

from __future__ import annotations

from typing import cast

import numpy as np

from fenics_contact import _dolfinx
from fenics_contact.fem import is_scalar
from fenics_contact.feti import Subdomain, TornSystem
from fenics_contact.scene import Load, OfPosition, SurfaceLoad, gradients_of


def field_by_places(
    torn: TornSystem,
    subdomain: Subdomain,
    load: Load,
    space: _dolfinx.fem.FunctionSpace,
    by_values: np.ndarray,
    moving: np.ndarray | None,
) -> np.ndarray:
    """Return Σ_c g_c ∇f_c at the nodes that move, by dof of the displacement, shape (size,).

    Args:
        moving: Marks of the nodes of all bodies that move, or None for all.
    """
    mesh, dim, mesh_of_body = subdomain.mesh, torn.dim, torn.scene.bodies[subdomain.mesh.body].mesh
    nodes = np.sort(mesh.nodes)
    chosen = np.ones(len(nodes), dtype=bool)
    if moving is not None:
        chosen &= moving[torn.decomposition.tearing.global_nodes(mesh.body, nodes)]
    if isinstance(load, SurfaceLoad):
        chosen &= np.isin(nodes, mesh_of_body.surfaces[load.surface])
    inputs, dofs = _dolfinx.node_dofs(space)
    _, own_dofs = _dolfinx.node_dofs(mesh.space)
    here = chosen[inputs]
    shape = () if is_scalar(load) else (dim,)
    places = mesh_of_body.points[nodes[inputs[here]]]
    function, name = cast(OfPosition, load.value), f"{type(load).__name__} on body {load.body!r}"
    slope = gradients_of(name, function, places, shape)
    weight = by_values.reshape(len(nodes), -1)[dofs[here]]
    result = np.zeros((len(nodes), dim))
    result[own_dofs[here]] = np.einsum("nc,ncd->nd", weight, slope.reshape(*weight.shape, dim))
    return result.ravel()
