"""Derivatives of virtual works by the nodes: of stresses, of loads, fields of position and resultants."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fenics_contact import _dolfinx
from fenics_contact._fem.load_forms import load_fields, load_parameters, loaded_cells
from fenics_contact._fem.loads import LinearTraction, spread_traction
from fenics_contact._scene.fields import gradients_of
from fenics_contact._scene.load_part import SurfaceLoad
from fenics_contact._scene.loads import Load, PointForce, ThermalStrain, TotalForce
from fenics_contact._surfaces.facets import GaussPoint, gauss_points, surface_moments
from fenics_contact.design.forms import Moving, ShapeForms, sets_in_use, subdomain_fields, sum_over_subdomains
from fenics_contact.design.surface_derivatives import integral_pulled_back
from fenics_contact.errors import InvalidInputError, together
from fenics_contact.feti.averages import nodal_mean_at
from fenics_contact.feti.subdomain import Subdomain
from fenics_contact.feti.torn import TornSystem


def field_by_places(
    torn: TornSystem,
    subdomain: Subdomain,
    load: Load,
    space: _dolfinx.fem.FunctionSpace,
    by_values: np.ndarray,
    moving: Moving,
) -> np.ndarray:
    """Return Σ_c g_c ∇f_c at the nodes that move, by dof of the displacement, shape (size,)."""
    mesh, dim, mesh_of_body = subdomain.mesh, torn.components, torn.scene.bodies[subdomain.mesh.body].mesh
    nodes = np.sort(mesh.nodes)
    chosen = moving[torn.decomposition.tearing.global_nodes(mesh.body, nodes)]
    if load.on_surface:
        chosen &= np.isin(nodes, load.nodes_in(mesh_of_body))
    inputs, dofs = _dolfinx.node_dofs(space)
    _, own_dofs = _dolfinx.node_dofs(mesh.space)
    here = chosen[inputs]
    places = mesh_of_body.points[nodes[inputs[here]]]
    function, name = load.function, f"{type(load).__name__} on body {load.body!r}"
    slope = gradients_of(name, function, places, load.width(dim))
    weight = by_values.reshape(len(nodes), -1)[dofs[here]]
    result = np.zeros((len(nodes), dim))
    result[own_dofs[here]] = np.einsum("nc,ncd->nd", weight, slope.reshape(*weight.shape, dim))
    return result.ravel()


@dataclass(frozen=True, eq=False)
class _Spread:
    """A traction a + b × (x − c) and how its work along w depends on the moments of the surface.

    The work is L = a·W₀ + b·W₁, W₀ = ∫ w, W₁ = ∫ r × w, r = x − c. At fixed w it changes with the surface,
    and through a = F / A, the centroid c and J b = M + (p − c) × F, J = tr(S) I − S, S = ∫ r rᵀ. With y = J⁻¹
    W₁

        δL = ∫δ (t·w + α + β·r + rᵀ Γ r),   α = −a·W₀ / A,   β = −(W₀ × b + F × y) / A,
        Γ = (y bᵀ + b yᵀ) / 2 − (y·b) I,

    with F × y only where the force acts at a given point. All vectors have three components; those of plane
    bodies lie in the plane, and turning vectors normal to it. `even`: a; `turning`: b; `centre`: c; `linear`:
    β; `square`: Γ.
    """

    even: np.ndarray
    turning: np.ndarray
    centre: np.ndarray
    constant: float
    linear: np.ndarray
    square: np.ndarray

    def density(self, places: np.ndarray, field: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the integrand at places with the field there, and its derivative by the places."""
        dim = places.shape[1]
        arm, w = _in_space(places) - self.centre, _in_space(field)
        bent = arm @ self.square
        work = np.einsum("nd,nd->n", self.even + np.cross(self.turning, arm), w)
        values = work + self.constant + arm @ self.linear + np.einsum("nd,nd->n", bent, arm)
        return values, (np.cross(w, self.turning) + self.linear + 2.0 * bent)[:, :dim]


def resultant_by_shape(torn: TornSystem, load: TotalForce, w: np.ndarray) -> np.ndarray:
    """Return ∂/∂X of the work of a resultant along w, on the first rank, zero elsewhere. Collective."""
    mesh, tearing = torn.scene.bodies[load.body].mesh, torn.decomposition.tearing
    result = np.zeros((tearing.n_nodes, torn.components))
    nodes, facets = np.unique(mesh.surfaces[load.surface], return_inverse=True)
    facets = facets.reshape(mesh.surfaces[load.surface].shape)
    numbers = tearing.global_nodes(load.body, nodes)
    field, points = nodal_mean_at(torn.decomposition, w, numbers), mesh.points[nodes]
    if torn.decomposition.comm.rank == 0:
        spread = _spread(torn, load, points, facets, field)

        def density(at: GaussPoint) -> tuple[np.ndarray, np.ndarray]:
            return spread.density(at.of(points, facets), at.of(field, facets))

        result[numbers] = integral_pulled_back(points, facets, density, torn.scene.kinematics.measure)
    return result


def _spread(
    torn: TornSystem, load: TotalForce, points: np.ndarray, facets: np.ndarray, field: np.ndarray
) -> _Spread:
    """Return the traction of a load and the coefficients of the moments, see the class."""
    moments = surface_moments(points, facets, torn.scene.kinematics.measure)
    centre, force = (_in_space(vector[None])[0] for vector in (moments.centroid, np.array(load.value)))
    total, turned = np.zeros(3), np.zeros(3)  # W₀ and W₁
    for at in gauss_points(points, facets, torn.scene.kinematics.measure):
        arm, w = _in_space(at.of(points, facets)) - centre, _in_space(at.of(field, facets))
        total += at.areas @ w
        turned += at.areas @ np.cross(arm, w)
    even, turning, lever = force / moments.area, np.zeros(3), np.zeros(3)
    traction = spread_traction(torn.scene, load).value
    if isinstance(traction, LinearTraction):
        turning[-len(traction.turning) :] = traction.turning
        lever = _turn(moments.second_moment, turned)
    moved = np.cross(total, turning) + (0.0 if load.at is None else np.cross(force, lever))
    both = np.outer(lever, turning)
    square = (both + both.T) / 2.0 - (lever @ turning) * np.eye(3)
    return _Spread(even, turning, centre, -float(even @ total) / moments.area, -moved / moments.area, square)


def _turn(second: np.ndarray, moment: np.ndarray) -> np.ndarray:
    """Return J⁻¹ M for the second moment S of a surface, of a curve in the plane about its normal."""
    if len(second) == 2:
        return moment / np.trace(second)
    return np.asarray(np.linalg.solve(np.trace(second) * np.eye(3) - second, moment))


def _in_space(vectors: np.ndarray) -> np.ndarray:
    """Return vectors with three components, shape (n, 3), the third of plane ones zero."""
    return np.pad(vectors, ((0, 0), (0, 3 - vectors.shape[1])))


Functions = Sequence["_dolfinx.fem.Function"]


def work_by_shape(forms: ShapeForms, torn: TornSystem, u: np.ndarray, w: np.ndarray) -> np.ndarray:
    """Return ∂/∂X of a(u, w) − L(w), this rank's share, at the nodes of all bodies, shape (n_nodes, dim)."""
    return strain_work_by_shape(forms, torn, u, w) - load_work_by_shape(forms, torn, w)


def strain_work_by_shape(forms: ShapeForms, torn: TornSystem, u: np.ndarray, w: np.ndarray) -> np.ndarray:
    """Return ∂/∂X of a(u, w), this rank's share, at the nodes of all bodies, shape (n_nodes, dim)."""
    if forms.nothing_moves:
        return np.zeros((torn.decomposition.tearing.n_nodes, torn.components))
    for name, body in torn.scene.bodies.items():  # all ranks compile, also for bodies without a part on them
        for materials in sets_in_use(torn, name):
            forms.virtual_work_by_shape(materials, body.element)

    def on_subdomain(subdomain: Subdomain, functions: Functions) -> np.ndarray:
        parts, element = subdomain.material, torn.scene.bodies[subdomain.mesh.body].element
        template = forms.virtual_work_by_shape(parts.materials, element)
        form = template.bind([subdomain.mesh.space], parts.parameters, functions, cells=parts.cells)
        return _dolfinx.assemble_vector(form)

    return sum_over_subdomains(torn, [u, w], on_subdomain, forms.moving)


def load_work_by_shape(forms: ShapeForms, torn: TornSystem, w: np.ndarray) -> np.ndarray:
    """Return ∂/∂X of L(w), the share of this rank, by all nodes, shape (n_nodes, dim). Collective."""
    loads = moving_loads(torn, forms.moving)
    spread: list[Load] = [load for load in loads if not isinstance(load, TotalForce | PointForce)]
    for load in spread:  # all ranks compile
        body = torn.scene.bodies[load.body]
        for materials in sets_in_use(torn, load.body):
            forms.load_by_shape(load, materials, body.element)
            if callable(load.value):
                forms.load_by_field(load, materials, body.element)

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
        acted = np.isin(nodes, load.nodes_in(body.mesh))
    cells = loaded_cells(load, parts, body, mesh.cells)
    fields = load_fields(load, mesh.space, body.mesh.points[nodes], acted)
    values, given = load_parameters(load, parts), [*functions, *fields]
    template = forms.load_by_shape(load, parts.materials, body.element)
    result = _dolfinx.assemble_vector(template.bind([mesh.space], values, given, facets, cells=cells))
    for field in fields:
        template = forms.load_by_field(load, parts.materials, body.element)
        form = template.bind([field.function_space], values, given, facets, cells=cells)
        by_values = _dolfinx.assemble_vector(form)
        result += field_by_places(torn, subdomain, load, field.function_space, by_values, forms.moving)
    return result


def moving_loads(torn: TornSystem, moving: Moving) -> list[Load]:
    """Return the loads that act on moving volumes and surfaces."""
    tearing, bodies = torn.decomposition.tearing, torn.scene.bodies

    def moves(load: Load) -> bool:
        nodes = load.nodes_in(bodies[load.body].mesh)
        return bool(moving[tearing.global_nodes(load.body, nodes)].any())

    found = [load for load in torn.scene.loads if moves(load)]
    if any(each.is_function for load in found for each in load.at_points):
        raise InvalidInputError(
            "derivatives by the shape need forces at nodes as numbers, got a function: give each a PointForce"
        )
    return found


def thermal_work_by_temperature(
    forms: ShapeForms, torn: TornSystem, load: ThermalStrain, w: np.ndarray
) -> np.ndarray:
    """Return ∂/∂T of the work of a thermal strain along w at nodes of its body, (n_nodes,). Collective."""
    body, comm = torn.scene.bodies[load.body], torn.decomposition.comm
    for materials in sets_in_use(torn, load.body):
        forms.load_by_field(load, materials, body.element)
    total = np.zeros(body.mesh.n_nodes)
    with together(comm):
        for subdomain, along in subdomain_fields(torn, [w]):
            mesh, parts = subdomain.mesh, subdomain.material
            if mesh.body != load.body:
                continue
            (field,) = load_fields(load, mesh.space, mesh.by_input_node(body.mesh.points[mesh.nodes]))
            template = forms.load_by_field(load, parts.materials, body.element)
            cells, values = loaded_cells(load, parts, body, mesh.cells), load_parameters(load, parts)
            form = template.bind([field.function_space], values, [*along, field], cells=cells)
            inputs, dofs = _dolfinx.node_dofs(field.function_space)
            by_input = np.zeros(len(inputs))
            by_input[inputs] = _dolfinx.assemble_vector(form)[dofs]
            total[mesh.nodes] += mesh.from_input_node(by_input)
    return np.asarray(comm.allreduce(total))
