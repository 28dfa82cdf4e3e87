"""Displacements, stresses and contact as fields: dolfinx Functions on the bodies' meshes, and arrays."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property, partial
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp
import ufl
from ufl.core.expr import Expr

from fenics_contact import _dolfinx
from fenics_contact._base.display import displayed
from fenics_contact._base.libraries import MPI
from fenics_contact._fem.composition import Composition, integrate
from fenics_contact._fem.forms import Temperature, stress_in_space, temperature_of
from fenics_contact._fem.templates import (
    Constants,
    Template,
    Written,
    quadrature_degree,
    scalar_constants,
    volume_measure,
)
from fenics_contact._kinematics.element import Element
from fenics_contact._pairing.points import NodeNumbers
from fenics_contact._scene.body import Body
from fenics_contact._scene.loads import initial_stress
from fenics_contact._scene.scene import Scene
from fenics_contact._surfaces.facets import filled_at_corners
from fenics_contact.errors import together
from fenics_contact.feti.decomposition import Decomposition
from fenics_contact.feti.torn import TornSystem
from fenics_contact.materials.elastic import Material
from fenics_contact.materials.hyperelastic import is_nonlinear
from fenics_contact.mesh.cell_types import CELL_TYPES, quadrature, shape_values
from fenics_contact.mesh.collapsed import places_of
from fenics_contact.mesh.quality import jacobians
from fenics_contact.results.contact import ContactResult

if TYPE_CHECKING:
    from fenics_contact._accuracy.recovery import Sites
    from fenics_contact._fem.mechanics import Response


def body_mesh(decomposition: Decomposition, name: str, body: Body) -> _dolfinx.mesh.Mesh:
    """Build the mesh of one body; a cell lives on the rank that owns its subdomain. Collective."""
    tearing, mesh = decomposition.tearing, body.mesh
    first = tearing.subdomain_offset[tearing.body_names.index(name)]
    rank = tearing.subdomain_rank[first + decomposition.partitions[name]]
    points, cells = mesh.at_nodes_apart(mesh.points), mesh.apart[0]
    return _dolfinx.rank_mesh(decomposition.comm, points, cells, rank, mesh.cell_type)


def displacement_function(mesh: _dolfinx.mesh.Mesh, values: np.ndarray) -> _dolfinx.fem.Function:
    """Return the displacement as a Function on a body's mesh. Collective.

    `values`: displacement of the nodes of its cells, see `BodyMesh.at_nodes_apart`, valid at least on those
    of this rank.
    """
    function = _dolfinx.coefficient(mesh, "displacement", values.shape[1])
    nodes, dofs = _dolfinx.node_dofs(function.function_space)
    function.x.array.reshape(-1, values.shape[1])[dofs] = values[nodes]
    function.x.scatter_forward()
    return function


def nodal_function(mesh: _dolfinx.mesh.Mesh, name: str, values: np.ndarray) -> _dolfinx.fem.Function:
    """Return a scalar field on a body's mesh from its nodal values. Collective.

    `values`: values at the nodes of its cells, see `BodyMesh.at_nodes_apart`, replicated.
    """
    function = _dolfinx.fem.Function(_dolfinx.scalar_space(mesh, 1), name=name)
    nodes, dofs = _dolfinx.node_dofs(function.function_space)
    function.x.array[dofs] = values[nodes]
    function.x.scatter_forward()
    return function


def cells_of_body(mesh: _dolfinx.mesh.Mesh, cells: np.ndarray) -> np.ndarray:
    """Return the number in the body of each cell owned by this rank, shape (n_owned,).

    `cells`: node numbers of all cells of the body, see `BodyMesh.apart`.
    """
    owned = mesh.topology.index_map(mesh.topology.dim).size_local
    mine = _dolfinx.cell_nodes(mesh).reshape(-1, cells.shape[1])[:owned]
    # dolfinx reorders cells: they are identified by their nodes.
    _, key = np.unique(np.sort(np.vstack([cells, mine]), axis=1), axis=0, return_inverse=True)
    key = key.ravel()
    place = np.empty(len(cells) + len(mine), dtype=np.int64)
    place[key[: len(cells)]] = np.arange(len(cells))
    return place[key[len(cells) :]]


def cell_values(function: _dolfinx.fem.Function, cells: np.ndarray) -> np.ndarray:
    """Gather a cellwise constant Function in the order of a body's cells, replicated. Collective."""
    space, shape = function.function_space, function.ufl_shape
    number = cells_of_body(space.mesh, cells)
    values = np.zeros((len(cells), *shape))
    own = _dolfinx.cell_dofs(space).ravel()[: len(number)]
    values[number] = function.x.array.reshape(-1, *shape)[own]
    return np.asarray(space.mesh.comm.allreduce(values))


#: The six components of a stress in VTK's order: xx, yy, zz, xy, yz, xz.
COMPONENTS = ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2))
#: Their names, as files and menus call them.
STRESS_COMPONENTS = tuple("xyz"[i] + "xyz"[j] for i, j in COMPONENTS)

#: Builds a number (UFL) from a stress, shape (3, 3), and constants.
OfStress = Callable[[Expr, Constants], Expr]


class CellMeans:
    """Means of a function of the stress over the cells of one body.

    The stress is that in space, for plane bodies with the component normal to the plane. Thermal stress is
    subtracted.
    """

    def __init__(
        self,
        mesh: _dolfinx.mesh.Mesh,
        body: Body,
        comm: MPI.Comm,
        temperature: Temperature,
        quantity: tuple[OfStress, int],
    ) -> None:
        """Compile the forms. Collective on ``comm``."""
        element = body.element
        self._parts = _composition(mesh, body)
        q = ufl.TestFunction(self._tests(element))
        with together(comm):
            form, constants, coefficients = _weighted(
                self._parts.materials, element, q, temperature, quantity, self._measure(element)
            )
            stress = None
            if temperature.initial:
                number = cells_of_body(mesh, body.mesh.apart[0])
                stress = initial_stress(temperature.initial, body)[number]
            self._fields = temperature.fields(mesh, body.mesh.at_nodes_apart(body.mesh.points), stress)
        self._form = Template(mesh.comm, form, constants, coefficients)
        self._numbers = temperature.numbers
        self._space = self._space_on(mesh, element)
        volume = Template(mesh.comm, element.integrand(q) * self._measure(element), ())
        self._volume = _dolfinx.assemble_vector(volume.bind([self._space], ()))

    def _measure(self, element: Element) -> ufl.Measure:
        """Return dx on the template."""
        return volume_measure(element, 2)

    def _tests(self, element: Element) -> ufl.FunctionSpace:
        """Return the template's space of functions by which is weighted."""
        return element.cellwise()

    def _space_on(self, mesh: _dolfinx.mesh.Mesh, element: Element) -> _dolfinx.fem.FunctionSpace:
        """Return the space of these on a mesh."""
        return _dolfinx.scalar_space(mesh, 0)

    def of(self, displacement: _dolfinx.fem.Function, values: tuple[float, ...] = ()) -> np.ndarray:
        """Return the means on this rank's cells, shape (n_owned,). Collective."""
        numbers = (*values, *self._numbers, *self._parts.parameters)
        functions = [displacement, *self._fields]
        bound = self._form.bind([self._space], numbers, functions, cells=self._parts.cells)
        means = _dolfinx.assemble_vector(bound) / self._volume
        return np.asarray(means[_dolfinx.cell_dofs(self._space).ravel()[: len(means)]])


class CellStress(CellMeans):
    """Means of the stress over the cells of one body."""

    def __init__(
        self, mesh: _dolfinx.mesh.Mesh, body: Body, comm: MPI.Comm, temperature: Temperature
    ) -> None:
        """Compile the forms. Collective on ``comm``."""
        super().__init__(mesh, body, comm, temperature, (_weighted_sum, len(COMPONENTS)))

    def components(self, displacement: _dolfinx.fem.Function) -> np.ndarray:
        """Return the `COMPONENTS` of the stress on this rank's cells, shape (n_owned, 6). Collective."""
        chosen = np.eye(len(COMPONENTS))
        return np.stack([self.of(displacement, tuple(row)) for row in chosen], axis=1)


def von_mises(
    displacement: _dolfinx.fem.Function, body: Body, comm: MPI.Comm, temperature: Temperature = Temperature()
) -> _dolfinx.fem.Function:
    """Return the von Mises stress averaged over each cell, [force / length²], a piecewise constant Function.

    Collective on ``comm``.
    """
    mesh = displacement.function_space.mesh
    means = CellMeans(mesh, body, comm, temperature, (_equivalent, 0))
    return _dolfinx.cell_field(mesh, "von_mises", means.of(displacement))


def stress(
    displacement: _dolfinx.fem.Function, body: Body, comm: MPI.Comm, temperature: Temperature
) -> _dolfinx.fem.Function:
    """Return the mean stress of each cell, a piecewise constant Function of shape (3, 3). Collective."""
    mesh = displacement.function_space.mesh
    components = CellStress(mesh, body, comm, temperature).components(displacement)
    return _dolfinx.cell_field(mesh, "stress", tensors(components))


def principal_stress(stress: _dolfinx.fem.Function, cells: np.ndarray) -> _dolfinx.fem.Function:
    """Return the principal stresses σ₁ ≥ σ₂ ≥ σ₃ of a cellwise stress, by cell. Collective."""
    mesh = stress.function_space.mesh
    own = _dolfinx.cell_dofs(stress.function_space).ravel()[: len(cells_of_body(mesh, cells))]
    return _dolfinx.cell_field(mesh, "principal_stress", principal(stress.x.array.reshape(-1, 3, 3)[own]))


def principal(tensor: np.ndarray) -> np.ndarray:
    """Return the eigenvalues of symmetric tensors, shape (..., 3, 3), largest first, shape (..., 3)."""
    return np.linalg.eigvalsh(tensor)[..., ::-1]


def von_mises_of(tensor: np.ndarray) -> np.ndarray:
    """Return the von Mises stress of symmetric tensors, shape (..., 3, 3)."""
    deviator = tensor - np.trace(tensor, axis1=-2, axis2=-1)[..., None, None] / 3 * np.eye(3)
    return np.asarray(np.sqrt(1.5 * (deviator**2).sum(axis=(-2, -1))))


def tensors(components: np.ndarray) -> np.ndarray:
    """Return symmetric tensors, shape (..., 3, 3), of their `COMPONENTS`, shape (..., 6)."""
    full = np.empty((*components.shape[:-1], 3, 3))
    for number, (i, j) in enumerate(COMPONENTS):
        full[..., i, j] = full[..., j, i] = components[..., number]
    return full


def components_of(tensor: np.ndarray) -> np.ndarray:
    """Return the `COMPONENTS` of symmetric tensors, shape (..., 6), of shape (..., 3, 3)."""
    return np.stack([tensor[..., i, j] for i, j in COMPONENTS], axis=-1)


def _equivalent(stress: Expr, _: Constants) -> Expr:
    deviator = stress - ufl.tr(stress) / 3 * ufl.Identity(3)
    return ufl.sqrt(1.5 * ufl.inner(deviator, deviator))


def _weighted_sum(stress: Expr, weights: Constants) -> Expr:
    terms = [weight * stress[place] for weight, place in zip(weights, COMPONENTS, strict=True)]
    return sum(terms[1:], terms[0])


def _weighted(
    materials: tuple[Material, ...],
    element: Element,
    q: Expr,
    temperature: Temperature,
    quantity: tuple[OfStress, int],
    dx: ufl.Measure,
) -> Written:
    """Return ∫ of a quantity times q dx (a form), its constants and its coefficients."""
    (u,) = element.fields(1)
    (displacement,) = element.in_space(u)
    change, numbers, fields = temperature.write(element)
    of_stress, count = quantity
    weights = scalar_constants(element, count)

    def density(material: Material, constants: tuple[ufl.Constant, ...]) -> Expr:
        return of_stress(stress_in_space(material, displacement, constants, change), weights) * q

    form, constants = integrate(materials, element, density, dx)
    return form, (*weights, *numbers, *constants), [u, *fields]


def _composition(mesh: _dolfinx.mesh.Mesh, body: Body) -> Composition:
    """Return all materials of a body's mesh on every rank, wherever their cells are."""
    count = len(body.materials)
    if count == 1:
        return Composition(body.materials)
    number = body.material_of_cells[cells_of_body(mesh, body.mesh.apart[0])]
    return Composition(body.materials, {k + 1: np.flatnonzero(number == k) for k in range(count)})


@displayed
@dataclass(frozen=True, eq=False)
class GatheredFields:
    """The fields of one body, replicated on all ranks.

    Attributes:
        points: Fields on nodes by their names: ``displacement``, (n_nodes, dim), [length], what
            `contact_fields` returns, and ``nodal_stress``, ``nodal_principal_stress`` and
            ``nodal_von_mises``, averaged around each node within one material, [force / length²]. Where
            materials meet they are those of the material in which the von Mises stress is largest.
            At hanging nodes all stresses are the means of their masters', so that fields are continuous.
        cells: Fields on cells: ``von_mises``, (n_cells,), ``stress``, the components xx, yy, zz, xy, yz, xz,
            (n_cells, 6), and ``principal_stress``, the largest first, (n_cells, 3), all means over the cell,
            [force / length²]; ``subdomain``, numbered over all bodies, (n_cells,) int.
    """

    points: dict[str, np.ndarray]
    cells: dict[str, np.ndarray]


@dataclass(frozen=True, eq=False)
class ContactNodes:
    """The nodes of one body at which contact points are."""

    contact: ContactResult
    scene: Scene
    numbers: NodeNumbers
    body: str

    @cached_property
    def _span(self) -> tuple[int, int]:
        start, end = self.numbers.node_offset[self.numbers.body_names.index(self.body) :][:2]
        return int(start), int(end - start)

    @cached_property
    def nodes(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the numbers of the contact points on the body, and of their nodes in it."""
        start, count = self._span
        nodes = self.contact.points.slave - start
        mine = np.flatnonzero((nodes >= 0) & (nodes < count))
        return mine, nodes[mine]

    def summed(self, values: np.ndarray, filled: bool = False) -> np.ndarray:
        """Return values of contact points at all nodes of the body, zero at others.

        `filled`: whether corners of quadratic facets without a point of their own are interpolated.
        """
        (start, count), (mine, _) = self._span, self.nodes
        points, mesh = self.contact.points, self.scene.bodies[self.body].mesh
        total = np.zeros((count, *values.shape[1:]))
        for pair in np.unique(points.pair[mine]):
            field, own = np.zeros_like(total), mine[points.pair[mine] == pair]
            nodes = points.slave[own] - start
            if filled and field.ndim == 1:
                every, given = points.of_surface(pair, values)
                alone = ~np.isin(every, points.slave)
                field[every[alone] - start] = given[alone]
            field[nodes] = values[own]
            facets = mesh.surfaces[self.scene.contacts[pair].slave.name]
            if filled and mesh.hanging:
                field = mesh.hanging.filled_in(field, facets, nodes)
            filled_in = filled and not self.scene.contacts[pair].by_mortar
            field = filled_at_corners(facets, field) if filled_in else field
            if filled_in and field.ndim == 1:  # slip is zero on an axis
                measure = self.scene.kinematics.measure
                field = measure.filled(facets, field, self.scene.bodies[self.body].on_axis)
            total += field
        return total


def contact_fields(
    contact: ContactResult, scene: Scene, numbers: NodeNumbers, body: str
) -> dict[str, np.ndarray]:
    """Return the contact result of a body's surfaces as fields on all its nodes.

    ``contact_status`` is the value of `Status`, −1 on nodes that are not contact points. Zero on those are
    ``contact_pressure``, ``contact_force`` on the slave and ``contact_slip``; where a body of the scene
    deforms much ``contact_nominal_pressure``, where a pair wears ``contact_worn_depth`` of both surfaces,
    too. By nodes pressures, depth and slip at the corners of quadratic triangles are interpolated, see
    `filled_at_corners`, and pressures at the ends of quadratic edges on an axis of revolution. A node that
    belongs to several pairs has their sum, and the status of the last; one whose force is that of a point
    elsewhere, as on one of both sides of a sector, has the pressure there.
    """
    at = ContactNodes(contact, scene, numbers, body)
    mine, nodes = at.nodes
    status = np.full(scene.bodies[body].mesh.n_nodes, -1, dtype=np.int32)
    status[nodes] = contact.status[mine]
    pressures = {"contact_pressure": contact.pressure}
    if scene.deforms_much:
        pressures["contact_nominal_pressure"] = contact.nominal_pressure
    if scene.wears:
        pressures["contact_worn_depth"] = contact.worn_depth
    return {
        "contact_status": status,
        **{name: np.maximum(at.summed(each, filled=True), 0.0) for name, each in pressures.items()},
        "contact_force": at.summed(contact.force),
        "contact_slip": at.summed(contact.slip_in_space, filled=True),
    }


def stress_fields(tensor: np.ndarray, prefix: str = "") -> dict[str, np.ndarray]:
    """Return components, principal values and von Mises stress of tensors, shape (n, 3, 3), by name.

    Von Mises stress of a mean is below the mean of von Mises stress.
    """
    return {
        f"{prefix}von_mises": von_mises_of(tensor),
        f"{prefix}stress": components_of(tensor),
        f"{prefix}principal_stress": principal(tensor),
    }


def most_stressed(by_material: np.ndarray) -> np.ndarray:
    """Return the stress of each node in the material with the largest von Mises stress there.

    A mean over materials would be the stress of none of them. `by_material`: shape (n_materials, n_nodes, 3,
    3), NaN where a node has no cell of a material.
    """
    size = von_mises_of(by_material)
    chosen = np.where(np.isnan(size), -1.0, size).argmax(axis=0)
    return np.asarray(by_material[chosen, np.arange(by_material.shape[1])])


def in_space(values: np.ndarray) -> np.ndarray:
    """Give points and vectors of plane bodies, (n, 2), a third component that is zero; leave others alone."""
    plane = values.ndim == 2 and values.shape[1] == 2
    return np.pad(values, ((0, 0), (0, 1))) if plane else values


def put_history_stress(
    field: _dolfinx.fem.Function,
    torn: TornSystem,
    name: str,
    responses: tuple[Response, ...],
    quantity: Callable[[np.ndarray], np.ndarray],
) -> None:
    """Overwrite a field on the cells of materials with a history, which this rank knows. Collective."""
    body, shape = torn.scene.bodies[name], field.ufl_shape
    known = np.full((body.mesh.n_cells, *shape), np.nan)
    for mesh, response in zip(torn.decomposition.meshes, responses, strict=True):
        if mesh.body == name and response.stress is not None:
            known[mesh.cells] = _means(body, mesh.cells, quantity(response.stress))
    number = cells_of_body(field.function_space.mesh, body.mesh.apart[0])
    mine = known[number].reshape(len(number), math.prod(shape))  # a rank may have no cells
    here = ~np.isnan(mine[:, 0])
    own = _dolfinx.cell_dofs(field.function_space).ravel()[: len(number)]
    field.x.array.reshape(-1, mine.shape[1])[own[here]] = mine[here]
    field.x.scatter_forward()


def _means(body: Body, cells: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return means over cells of values at Gauss points, (n_cells, n_gauss, ...) to (n_cells, ...)."""
    weights, places = _gauss_points(body, cells)
    weights = weights * body.kinematics.measure.around(places[..., 0])
    weights = weights / weights.sum(axis=1, keepdims=True)
    return np.einsum("cq,cq...->c...", weights, values)


def _gauss_points(body: Body, cells: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return weights of the Gauss points of cells in coordinates, (n_cells, n_gauss), and their places."""
    mesh, cell = body.mesh, CELL_TYPES[body.mesh.cell_type]
    positions, weights = quadrature(cell, quadrature_degree(body.element))
    corners, values = places_of(mesh.points, mesh.cells[cells]), shape_values(cell, positions)
    places = np.stack([corners[..., axis] @ values.T for axis in range(mesh.dim)], axis=-1)
    return weights * jacobians(mesh.points, mesh.cells[cells], positions), places


def nodal_stress(
    torn: TornSystem,
    displacement: np.ndarray,
    meshes: Mapping[str, _dolfinx.mesh.Mesh],
    stresses: Mapping[str, _dolfinx.fem.Function],
) -> dict[str, np.ndarray]:
    """Return the stress of all bodies at their nodes, material by material, replicated. Collective.

    `displacement`: of all nodes, valid on those of this rank; `stresses`: mean stress of the cells of at
    least the bodies with nonlinear materials, by name. The result of each body has shape (n_materials,
    n_nodes, 3, 3), NaN where a node has no cell of the material.
    """
    # Recovery is part of estimates, which a state with a fixed tolerance need not import.
    from fenics_contact._accuracy.recovery import find_sites, recovered_gradients

    found = {}
    for order in sorted({body.mesh.order for body in torn.scene.bodies.values()}):
        sites = find_sites(torn, order)
        gradients = recovered_gradients(sites, displacement[sites.node])
        for name, body in torn.scene.bodies.items():
            if body.mesh.order == order:
                if any(map(is_nonlinear, body.materials)):
                    own = _from_cells(torn, name, sites, stresses[name])
                else:
                    own = _at_sites(torn, name, sites, (displacement, gradients), meshes[name])
                found[name] = _gathered(torn, name, sites, own)
    return found


def _from_cells(torn: TornSystem, name: str, sites: Sites, stress: _dolfinx.fem.Function) -> np.ndarray:
    """Return the components of the mean stress around the sites of a body, shape (n_sites, 6). Collective."""
    space = stress.function_space
    number = cells_of_body(space.mesh, torn.scene.bodies[name].mesh.apart[0])
    own = _dolfinx.cell_dofs(space).ravel()[: len(number)]
    return _around_sites(torn, name, sites, components_of(stress.x.array.reshape(-1, 3, 3)[own]), number)


def _at_sites(
    torn: TornSystem,
    name: str,
    sites: Sites,
    moved: tuple[np.ndarray, np.ndarray],
    mesh: _dolfinx.mesh.Mesh,
) -> np.ndarray:
    """Return the components of the stress at the sites of a body, shape (n_sites, 6). Collective.

    It is affine in the gradient. Its coefficients are the stresses of unit gradients, averaged over the cells
    around a site; they are the same in all of them unless the material or the temperature varies. `moved`:
    displacements of all nodes and gradients at the sites.
    """
    body, dim, width = torn.scene.bodies[name], torn.scene.dim, torn.components
    displacement, gradients = moved
    temperature = temperature_of(torn.scene.loads, name)
    means = CellStress(mesh, body, torn.decomposition.comm, temperature)
    number = cells_of_body(mesh, body.mesh.apart[0])
    kinematics = body.kinematics
    places = kinematics.from_origin(body.mesh.points)
    # A rotation has no stress: the gradients (i, j) and (j, i) have the same.
    pairs = [(i, j) for i in range(dim) for j in range(i, dim)]
    units = np.zeros((1 + len(pairs), dim, dim))
    units[np.arange(1, len(units)), [j for _, j in pairs], [i for i, _ in pairs]] = 1.0
    fields = [np.pad(places @ unit.T, ((0, 0), (0, width - dim))) for unit in units]
    sizes = [gradients[:, i, j] + (gradients[:, j, i] if i != j else 0.0) for i, j in pairs]
    fields += kinematics.further_fields(places)
    sizes += kinematics.further_strains(gradients, partial(_by_radius, torn, sites, displacement))
    on_cells = [
        means.components(displacement_function(mesh, body.mesh.at_nodes_apart(field))) for field in fields
    ]
    rest, further = on_cells[0], on_cells[1 + len(pairs) :]
    gauss_points = partial(_gauss_points, body, number)
    on_cells[1 + len(pairs) :] = kinematics.of_unit_strains(rest, further, gauss_points)
    around = _around_sites(torn, name, sites, np.hstack(on_cells), number)
    at_rest, *strained = np.split(around, len(fields), axis=1)
    total = at_rest.copy()
    for size, stress in zip(sizes, strained, strict=True):
        total += size[:, None] * (stress - at_rest)
    return total


def _by_radius(
    torn: TornSystem, sites: Sites, displacement: np.ndarray, radial: np.ndarray, component: int
) -> np.ndarray:
    """Return a component of u over r at sites; on the axis it is its derivative by r there."""
    on_axis = np.concatenate([body.on_axis for body in torn.scene.bodies.values()])[sites.node]
    radii = np.where(on_axis, 1.0, sites.points[:, 0])
    return np.where(on_axis, radial, displacement[sites.node, component] / radii)


def _around_sites(
    torn: TornSystem, name: str, sites: Sites, values: np.ndarray, number: np.ndarray
) -> np.ndarray:
    """Return the means of values on cells over the cells around each site, shape (n_sites, k). Collective.

    `values`: on this rank's cells of the body; `number`: number in the body of each of them.
    """
    of_body = np.zeros((torn.scene.bodies[name].mesh.n_cells, values.shape[1] + 1))
    of_body[number] = np.pad(values, ((0, 0), (0, 1)), constant_values=1.0)
    total = np.zeros((sites.count, of_body.shape[1]))
    for mesh in torn.decomposition.meshes:
        if mesh.body == name:
            places = sites.of_cells[mesh.number]
            starts = np.arange(len(places) + 1) * places.shape[1]
            shape = (len(places), sites.count)
            around = sp.csr_matrix((np.ones(places.size), places.ravel(), starts), shape=shape).T
            total += around @ of_body[mesh.cells]
    total = sites.sharing.add_up(total)
    return np.asarray(total[:, :-1] / np.maximum(total[:, -1:], 1.0))


def _gathered(torn: TornSystem, name: str, sites: Sites, values: np.ndarray) -> np.ndarray:
    """Return values at the sites of a body by material and node, on every rank. Collective."""
    body, decomposition = torn.scene.bodies[name], torn.decomposition
    total = np.zeros((len(body.materials), body.mesh.n_nodes, len(COMPONENTS) + 1))
    for mesh in decomposition.meshes:
        if mesh.body == name:
            site, node = sites.of_cells[mesh.number], body.mesh.cells[mesh.cells]
            material = np.broadcast_to(body.material_of_cells[mesh.cells][:, None], node.shape)
            total[material, node, :-1] = values[site]
            total[material, node, -1] = 1.0
    total = decomposition.comm.allreduce(total)
    count = total[..., -1:]
    return tensors(np.where(count > 0, total[..., :-1] / np.maximum(count, 1.0), np.nan))
