"""Conduction, storage and exchange of heat: UFL forms, each compiled once, and matrices of subdomains.

Three bilinear forms make everything: ∫ k ∇u·∇v, and ∫ s u v over volumes and over surfaces with a nodal field
s. Sources, fluxes and films are these matrices times nodal values, so that what one form takes from a body
another one gives, to rounding.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp
import ufl

from fenics_contact import _dolfinx
from fenics_contact._base.csr import Csr
from fenics_contact._fem.load_forms import FIRST_COUNT
from fenics_contact._fem.templates import LOADED, Template, Templates, Written, volume_measure
from fenics_contact._kinematics.element import Element
from fenics_contact._scene.body import Body
from fenics_contact._surfaces.facets import quadrature_areas
from fenics_contact.feti.subdomain import SubdomainMesh
from fenics_contact.heat.properties import ByFunction, Conductor, Fields, Property
from fenics_contact.heat.scene import ConductingBody, HeatScene

#: A property that is given at nodes.
FIELD = ByFunction("a nodal field", np.asarray)


@dataclass(frozen=True)
class HeatForms:
    """The compiled forms of the bodies of a scene."""

    templates: Templates

    def prepare(self, scene: HeatScene) -> None:
        """Compile the missing forms. Collective."""
        for name, body in scene.field.bodies.items():
            for material in scene.bodies[name].materials:
                self.conduction(material, body.element)
                for capacity in material.capacities:
                    self.storage(capacity, body.element)
            self.storage(FIELD, body.element)
            self.exchange(body.element)

    def parts(self, scene: HeatScene, meshes: Sequence[SubdomainMesh]) -> tuple[Part, ...]:
        """Return subdomains of a scene."""
        solids = scene.field.bodies
        return tuple(Part(each, scene.bodies[each.body], solids[each.body], self) for each in meshes)

    def conduction(self, material: Conductor, element: Element) -> Template:
        """Return ∫ k ∇u·∇v over the marked cells."""
        given, shape = material.tensor.ravel(), material.tensor.shape

        def write() -> Written:
            V = element.displacements
            slope, along = ufl.grad(ufl.TrialFunction(V)[0]), ufl.grad(ufl.TestFunction(V)[0])
            parts = [each.symbols(element, number) for number, each in enumerate(given)]
            k = np.array([each.expression for each in parts], dtype=object).reshape(shape)
            if len(shape) == 2:
                slope = ufl.dot(ufl.as_matrix(k.tolist()), slope)
            elif shape:
                slope = ufl.as_vector([each * slope[axis] for axis, each in enumerate(k)])
            else:
                slope = k.item() * slope
            constants = tuple(symbol for each in parts for symbol in each.constants)
            coefficients = tuple(symbol for each in parts for symbol in each.coefficients)
            density = element.integrand(ufl.dot(slope, along))
            return density * volume_measure(element, 2)(LOADED), constants, coefficients

        key = ("conduction", tuple(each.kind for each in given), shape, element)
        return self.templates.get(key, ("conduction", element.name), write)

    def conduction_by_temperature(self, material: Conductor, element: Element) -> Template:
        """Return ∂/∂T of ∫ k(T) ∇U·∇w along test functions, with nodal U and w."""
        given = [(place, each) for place, each in np.ndenumerate(material.tensor) if each.varies]

        def write() -> Written:
            U, w = (ufl.Coefficient(element.nodal, count=FIRST_COUNT + number) for number in range(2))
            parts = [each.by_temperature(element, number + 2) for number, (_, each) in enumerate(given)]
            density = ufl.as_ufl(0.0)
            for (place, _), part in zip(given, parts, strict=True):
                along = U.dx(place[0]) * w.dx(place[0]) if place else ufl.dot(ufl.grad(U), ufl.grad(w))
                density += part.expression * along
            constants = tuple(symbol for part in parts for symbol in part.constants)
            fields = tuple(symbol for part in parts for symbol in part.coefficients)
            density = density * ufl.TestFunction(element.displacements)[0]
            measure = volume_measure(element, 2)(LOADED)
            return element.integrand(density) * measure, constants, (U, w, *fields)

        kinds = tuple((place, each.kind) for place, each in given)
        key = ("conduction by temperature", kinds, element)
        return self.templates.get(key, ("conduction by temperature", element.name), write)

    def storage(self, capacity: Property, element: Element) -> Template:
        """Return ∫ c u v over the marked cells."""
        name = ("storage", capacity.kind, element)
        return self.templates.get(
            name, ("storage", element.name), lambda: _product(capacity, element, volume_measure(element, 3))
        )

    def exchange(self, element: Element) -> Template:
        """Return ∫ s u v over the marked facets, with a nodal field s."""
        metadata = {"quadrature_degree": 3 * element.cell.order + 1}
        measure = ufl.ds(domain=element.template, metadata=metadata)
        return self.templates.get(
            ("exchange", element), ("exchange", element.name), lambda: _product(FIELD, element, measure)
        )


def _product(given: Property, element: Element, measure: ufl.Measure) -> Written:
    V, symbols = element.displacements, given.symbols(element, 0)
    density = symbols.expression * ufl.TrialFunction(V)[0] * ufl.TestFunction(V)[0]
    return element.integrand(density) * measure(LOADED), symbols.constants, symbols.coefficients


@dataclass(frozen=True, eq=False)
class Part:
    """One subdomain of a body, on which forms are assembled.

    All values are by block: one for each node of the subdomain.
    """

    mesh: SubdomainMesh
    body: ConductingBody
    field: Body
    forms: HeatForms

    @property
    def name(self) -> str:
        """The body, in words."""
        return f"body {self.mesh.body!r}"

    @property
    def element(self) -> Element:
        """The finite element of its temperatures."""
        return self.field.element

    @cached_property
    def points(self) -> np.ndarray:
        """Its nodes, shape (n, dim)."""
        return self.body.mesh.points[self.mesh.nodes]

    def place(self) -> None:
        """Move the nodes of the mesh, which others may share, to where they are here.

        From a node of their own where nothing depends on the place: equal subdomains have equal matrices.
        """
        fixed = [not self.element.kinematics.is_homogeneous, *(each.by_place for each in self.body.materials)]
        points = self.mesh.by_input_node(self.points - (not any(fixed)) * self.points[0])
        _dolfinx.update_coordinates(self.mesh.space.mesh, points)

    def _field(self, values: np.ndarray) -> _dolfinx.fem.Function:
        space = _dolfinx.nodal_space_on(self.mesh.space.mesh, 1)
        nodes, dofs = _dolfinx.node_dofs(space)
        field = _dolfinx.fem.Function(space, name="s")
        field.x.array[dofs] = self.mesh.by_input_node(values)[nodes]
        return field

    def _matrix(self, form: _dolfinx.fem.Form) -> sp.csr_matrix:
        indptr, indices, data = _dolfinx.assemble_csr(form)
        size = len(indptr) - 1  # facets alone may not reach the last columns
        matrix = self.mesh.matrix_of(Csr((data, indices, indptr), shape=(size, size)))
        return (self.body.thickness * matrix).tocsr()

    def _marked(self, number: int) -> Mapping[int, np.ndarray]:
        """Return the cells here of one of the materials of the body."""
        return {LOADED: np.flatnonzero(self.field.material_of_cells[self.mesh.cells] == number)}

    def _bound(self, template: Template, given: Sequence[Property], fields: Fields, number: int) -> Any:
        """Return the matrix of a form on the cells of a material."""
        values = [value for each in given for value in each.numbers]
        functions = [self._field(each) for each in fields]
        marked = self._marked(number)
        return self._matrix(template.bind([self.mesh.space] * 2, values, functions, cells=marked))

    def conduction(self, temperature: np.ndarray) -> sp.csr_matrix:
        """Return ∫ k(T) ∇u·∇v, shape (n, n); assembles where `place` has put the nodes."""
        total = Csr((self.mesh.size, self.mesh.size))
        for number, material in enumerate(self.body.materials):
            given = list(material.tensor.ravel())
            fields = tuple(field for each in given for field in each.fields(temperature))
            template = self.forms.conduction(material, self.element)
            total = total + self._bound(template, given, fields, number)
        return total

    def conduction_by_temperature(self, temperature: np.ndarray, along: np.ndarray) -> np.ndarray:
        """Return ∂/∂T of wᵀ K(T) U at U = T, shape (n,), `along`: w; what K itself does not have of it."""
        total = np.zeros(self.mesh.size)
        for number, material in enumerate(self.body.materials):
            given = [each for each in material.tensor.ravel() if each.varies]
            if not given:
                continue
            template = self.forms.conduction_by_temperature(material, self.element)
            nodal = [temperature, along, *(field for each in given for field in each.slopes(temperature))]
            values = [value for each in given for value in each.numbers]
            fields = [self._field(each) for each in nodal]
            form = template.bind([self.mesh.space], values, fields, cells=self._marked(number))
            total += self.body.thickness * self.mesh.force_of(_dolfinx.assemble_vector(form))
        return total

    def capacity(self, before: np.ndarray, after: np.ndarray) -> sp.csr_matrix:
        """Return ∫ c u v with the mean c between two temperatures, so that C (T₂ − T₁) is what is stored."""
        total = Csr((self.mesh.size, self.mesh.size))
        for number, material in enumerate(self.body.materials):
            for each in material.capacities:
                template, fields = self.forms.storage(each, self.element), each.mean_fields(before, after)
                total = total + self._bound(template, [each], fields, number)
        return total

    def volume(self, values: np.ndarray, region: str) -> sp.csr_matrix:
        """Return ∫ s u v over a region, by default the body, shape (n, n)."""
        own = self.mesh.cells
        here = np.isin(own, self.body.mesh.regions[region]) if region else np.ones(len(own), dtype=bool)
        marked = {LOADED: np.flatnonzero(here)}
        template = self.forms.storage(FIELD, self.element)
        return self._matrix(template.bind([self.mesh.space] * 2, (), [self._field(values)], cells=marked))

    def surface(self, values: np.ndarray, surface: str) -> sp.csr_matrix:
        """Return ∫ s u v over a surface, shape (n, n)."""
        facets = self.mesh.facets_of(self.field, surface)
        if not len(facets[0]):
            return Csr((self.mesh.size, self.mesh.size))
        template = self.forms.exchange(self.element)
        spaces = [self.mesh.space] * 2
        return self._matrix(template.bind(spaces, (), [self._field(values)], facets=facets))

    def area(self, surface: str) -> float:
        """Return the area of a surface of the body, [length²]."""
        mesh, measure = self.body.mesh, self.element.kinematics.measure
        plane = float(quadrature_areas(mesh.points, mesh.surfaces[surface], measure).sum())
        return self.body.thickness * plane

    def share(self, nodes: str) -> np.ndarray:
        """Return its share in some nodes of the body, shape (n,)."""
        here = np.isin(self.mesh.nodes, self.body.mesh.nodes_of(nodes))
        return np.where(here, self.portion, 0.0)

    def own(self, values: float | np.ndarray) -> np.ndarray:
        """Return its share of values at the nodes of its body, (n_nodes,), as (n,)."""
        every = np.broadcast_to(values, self.body.mesh.n_nodes)
        return np.asarray(self.portion * every[self.mesh.nodes])

    @cached_property
    def portion(self) -> np.ndarray:
        """Its portion of what enters at each node: that of its cells among those there, shape (n,)."""
        return self.mesh.portion(self.body.mesh)
