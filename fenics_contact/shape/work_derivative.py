"""Derivatives of virtual works by the nodes: that of the stresses and that of the loads."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fenics_contact import _dolfinx
from fenics_contact.errors import together
from fenics_contact.fem import load_fields, load_parameters, material_sets
from fenics_contact.feti import Subdomain, TornSystem
from fenics_contact.scene import Load, SurfaceLoad, ThermalStrain, TotalForce
from fenics_contact.shape.forms import ShapeForms, sum_over_subdomains
from fenics_contact.shape.nodal_fields import field_by_places
from fenics_contact.shape.resultant_derivative import resultant_by_shape

Functions = Sequence["_dolfinx.fem.Function"]


def work_by_shape(forms: ShapeForms, torn: TornSystem, u: np.ndarray, w: np.ndarray) -> np.ndarray:
    """Return ∂/∂X of a(u, w) − L(w), this rank's share, at the nodes of all bodies, shape (n_nodes, dim)."""
    return strain_work_by_shape(forms, torn, u, w) - load_work_by_shape(forms, torn, w)


def strain_work_by_shape(forms: ShapeForms, torn: TornSystem, u: np.ndarray, w: np.ndarray) -> np.ndarray:
    """Return ∂/∂X of a(u, w), this rank's share, at the nodes of all bodies, shape (n_nodes, dim).

    Args:
        u: Torn displacement of this rank, [length].
    """
    for body in torn.scene.bodies.values():  # all ranks compile, also for bodies without a part on them
        for materials in material_sets(body):
            forms.virtual_work_by_shape(materials, body.mesh.cell_type)

    def on_subdomain(subdomain: Subdomain, functions: Functions) -> np.ndarray:
        parts, cell_type = subdomain.material, torn.scene.bodies[subdomain.mesh.body].mesh.cell_type
        template = forms.virtual_work_by_shape(parts.materials, cell_type)
        form = template.bind([subdomain.mesh.space], parts.parameters, functions, cells=parts.cells)
        return _dolfinx.assemble_vector(form)

    return sum_over_subdomains(torn, [u, w], on_subdomain, forms.moving)


def load_work_by_shape(forms: ShapeForms, torn: TornSystem, w: np.ndarray) -> np.ndarray:
    """Return ∂/∂X of L(w), the share of this rank, by all nodes, shape (n_nodes, dim). Collective."""
    loads = moving_loads(torn, forms.moving)
    spread: list[Load] = [load for load in loads if not isinstance(load, TotalForce)]
    for load in spread:  # all ranks compile
        body = torn.scene.bodies[load.body]
        for materials in material_sets(body):
            forms.load_by_shape(load, materials, body.mesh.cell_type)
            if callable(load.value):
                forms.load_by_field(load, materials, body.mesh.cell_type)

    def on_subdomain(subdomain: Subdomain, functions: Functions) -> np.ndarray:
        result = np.zeros(subdomain.mesh.size)
        for load in spread:
            if load.body == subdomain.mesh.body:
                result += _load_by_shape(forms, torn, subdomain, load, functions)
        return result

    with together(torn.decomposition.comm):
        result = sum_over_subdomains(torn, [w], on_subdomain, forms.moving)
    for resultant in loads:
        if isinstance(resultant, TotalForce):
            result += resultant_by_shape(torn, resultant, w)
    return result


def _load_by_shape(
    forms: ShapeForms, torn: TornSystem, subdomain: Subdomain, load: Load, functions: Functions
) -> np.ndarray:
    """Return the derivative of the work of one load on one subdomain, by dof."""
    mesh, parts = subdomain.mesh, subdomain.material
    body, facets = torn.scene.bodies[mesh.body], None
    nodes = np.sort(mesh.nodes)
    acted = None
    if isinstance(load, SurfaceLoad):
        facets = mesh.facets_of(body, load.surface)
        if len(facets[0]) == 0:
            return np.zeros(mesh.size)
        acted = np.isin(nodes, body.mesh.surfaces[load.surface])
    cells = parts.cells if isinstance(load, ThermalStrain) else None
    fields = load_fields(load, mesh.space, body.mesh.points[nodes], acted)
    values, given = load_parameters(load, parts), [*functions, *fields]
    template = forms.load_by_shape(load, parts.materials, body.mesh.cell_type)
    result = _dolfinx.assemble_vector(template.bind([mesh.space], values, given, facets, cells=cells))
    for field in fields:
        template = forms.load_by_field(load, parts.materials, body.mesh.cell_type)
        form = template.bind([field.function_space], values, given, facets, cells=cells)
        by_values = _dolfinx.assemble_vector(form)
        result += field_by_places(torn, subdomain, load, field.function_space, by_values, forms.moving)
    return result


def moving_loads(torn: TornSystem, moving: np.ndarray | None) -> list[Load]:
    """Return the loads that act on moving volumes and surfaces."""
    tearing, bodies = torn.decomposition.tearing, torn.scene.bodies

    def moves(load: Load) -> bool:
        mesh = bodies[load.body].mesh
        nodes = mesh.surfaces[load.surface] if isinstance(load, SurfaceLoad) else np.arange(mesh.n_nodes)
        return moving is None or bool(moving[tearing.global_nodes(load.body, nodes)].any())

    return [load for load in torn.scene.loads if moves(load)]
