"""Conduction, storage and exchange of heat: UFL forms, each compiled once, and matrices of subdomains.

Three bilinear forms make everything: ∫ k ∇u·∇v, and ∫ s u v over volumes and over surfaces with a nodal field
s. Sources, fluxes and films are these matrices times nodal values, so that what one form takes from a body
another one gives, to rounding.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
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
from fenics_contact._scene.fields import Ufl
from fenics_contact._surfaces.facets import quadrature_areas
from fenics_contact.errors.kinds import user_code
from fenics_contact.feti.subdomain import SubdomainMesh
from fenics_contact.heat.properties import Conductor, Property, at_temperatures
from fenics_contact.heat.scene import ConductingBody, HeatScene


@dataclass(frozen=True)
class Symbols:
    """A property as UFL: what is known as numbers, by fields at nodes, and by the temperature there."""

    expression: Any
    constants: tuple[ufl.Constant, ...]
    coefficients: tuple[ufl.Coefficient, ...]


def _symbols(given: Property, element: Element, number: int) -> Symbols:
    """Return a property on the template; ``number`` distinguishes the fields of one form."""
    if isinstance(given, float):
        constant = element.constant()
        return Symbols(constant, (constant,), ())
    field = ufl.Coefficient(element.nodal, count=FIRST_COUNT + number)
    if isinstance(given, Ufl):
        with user_code("a property given as Ufl"):
            return Symbols(ufl.as_ufl(given.function(element.x, field)), (), (field,))  # type: ignore[call-arg]
    return Symbols(field, (), (field,))


def _kind(given: Property) -> Hashable:
    """Return what the form depends on."""
    if isinstance(given, float):
        return "number"
    return given if isinstance(given, Ufl) else "field"


@dataclass(frozen=True)
class HeatForms:
    """The compiled forms of the bodies of a scene."""

    templates: Templates

    def prepare(self, scene: HeatScene) -> None:
        """Compile the missing forms. Collective."""
        for name, body in scene.field.bodies.items():
            element = body.element
            for material in scene.bodies[name].materials:
                self.conduction(material, element)
                if isinstance(material.heat_capacity, Ufl):
                    self.own_storage(material.heat_capacity, element)
            self.storage(element)
            self.exchange(element)

    def conduction(self, material: Conductor, element: Element) -> Template:
        """Return ∫ k ∇u·∇v over the marked cells."""
        given, matrix = material.along_axes, material.matrix
        kinds = tuple(_kind(each) for each in given) or ("matrix",)

        def write() -> Written:
            V = element.displacements
            u, v = ufl.TrialFunction(V)[0], ufl.TestFunction(V)[0]
            if len(matrix):
                constants = tuple(element.constant() for _ in range(matrix.size))
                rows = np.array(constants, dtype=object).reshape(matrix.shape).tolist()
                density = ufl.dot(ufl.dot(ufl.as_matrix(rows), ufl.grad(u)), ufl.grad(v))
                return element.integrand(density) * volume_measure(element, 2)(LOADED), constants, ()
            parts = [_symbols(each, element, number) for number, each in enumerate(given)]
            if len(parts) == 1:
                density = parts[0].expression * ufl.dot(ufl.grad(u), ufl.grad(v))
            else:
                density = sum(each.expression * u.dx(axis) * v.dx(axis) for axis, each in enumerate(parts))
            constants = tuple(symbol for each in parts for symbol in each.constants)
            coefficients = tuple(symbol for each in parts for symbol in each.coefficients)
            return element.integrand(density) * volume_measure(element, 2)(LOADED), constants, coefficients

        key = ("conduction", kinds, element)
        return self.templates.get(key, ("conduction", element.name), write)

    def storage(self, element: Element) -> Template:
        """Return ∫ s u v over the marked cells."""

        def write() -> Written:
            V = element.displacements
            s = ufl.Coefficient(element.nodal, count=FIRST_COUNT)
            density = s * ufl.TrialFunction(V)[0] * ufl.TestFunction(V)[0]
            return element.integrand(density) * volume_measure(element, 3)(LOADED), (), (s,)

        return self.templates.get(("storage", element), ("storage", element.name), write)

    def own_storage(self, capacity: Ufl, element: Element) -> Template:
        """Return ∫ c(x, T) u v over the marked cells."""

        def write() -> Written:
            V, symbols = element.displacements, _symbols(capacity, element, 0)
            density = symbols.expression * ufl.TrialFunction(V)[0] * ufl.TestFunction(V)[0]
            measure = volume_measure(element, 3)(LOADED)
            return element.integrand(density) * measure, (), symbols.coefficients

        return self.templates.get(("storage", capacity, element), ("storage of UFL", element.name), write)

    def exchange(self, element: Element) -> Template:
        """Return ∫ s u v over the marked facets."""

        def write() -> Written:
            V = element.displacements
            s = ufl.Coefficient(element.nodal, count=FIRST_COUNT)
            density = s * ufl.TrialFunction(V)[0] * ufl.TestFunction(V)[0]
            metadata = {"quadrature_degree": 3 * element.cell.order + 1}
            measure = ufl.ds(domain=element.template, metadata=metadata)(LOADED)
            return element.integrand(density) * measure, (), (s,)

        return self.templates.get(("exchange", element), ("exchange", element.name), write)


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
        """Move the nodes of the mesh, which others may share, to where they are here."""
        _dolfinx.update_coordinates(self.mesh.space.mesh, self.mesh.by_input_node(self.points))

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
        own = np.isin(self.mesh.cells, self.body.cells_of(number))
        return {LOADED: np.flatnonzero(own)}

    def _bound(self, template: Template, given: Sequence[Property], name: str, at: np.ndarray) -> Any:
        values = [each for each in given if isinstance(each, float)]
        fields = [
            self._field(at if isinstance(each, Ufl) else at_temperatures(name, each, at))
            for each in given
            if not isinstance(each, float)
        ]
        return values, fields

    def conduction(self, temperature: np.ndarray) -> sp.csr_matrix:
        """Return ∫ k(T) ∇u·∇v, shape (n, n); assembles where `place` has put the nodes."""
        total, spaces = None, [self.mesh.space] * 2
        for number, material in enumerate(self.body.materials):
            template = self.forms.conduction(material, self.element)
            values, fields = list(material.matrix.ravel()), []
            if not len(values):
                name = f"the conductivity of {self.name}"
                values, fields = self._bound(template, material.along_axes, name, temperature)
            form = template.bind(spaces, values, fields, cells=self._marked(number))
            part = self._matrix(form)
            total = part if total is None else total + part
        assert total is not None
        return total

    def capacity(self, before: np.ndarray, after: np.ndarray) -> sp.csr_matrix:
        """Return ∫ c u v with the mean c between two temperatures, so that C (T₂ − T₁) is what is stored."""
        total, spaces = Csr((self.mesh.size, self.mesh.size)), [self.mesh.space] * 2
        for number, material in enumerate(self.body.materials):
            given = material.heat_capacity
            if given is None:
                continue
            if isinstance(given, Ufl):
                template, field = (
                    self.forms.own_storage(given, self.element),
                    self._field(0.5 * (before + after)),
                )
            else:
                name = f"the heat capacity of {self.name}"
                template = self.forms.storage(self.element)
                field = self._field(_mean(name, given, before, after))
            form = template.bind(spaces, (), [field], cells=self._marked(number))
            total = total + self._matrix(form)
        return total

    def volume(self, values: np.ndarray, region: str) -> sp.csr_matrix:
        """Return ∫ s u v over a region, by default the body, shape (n, n)."""
        own = self.mesh.cells
        here = np.isin(own, self.body.mesh.regions[region]) if region else np.ones(len(own), dtype=bool)
        marked = {LOADED: np.flatnonzero(here)}
        template = self.forms.storage(self.element)
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
        """Return its share in some nodes of the body: that of its cells among those at each, shape (n,)."""
        mesh, whole = self.mesh, self.body.mesh
        own, every = (
            np.bincount(cells.ravel(), minlength=whole.n_nodes)[mesh.nodes]
            for cells in (whole.cells[mesh.cells], whole.cells)
        )
        return np.where(np.isin(mesh.nodes, whole.nodes_of(nodes)), own / every, 0.0)


def _mean(name: str, given: Property, before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Return the mean of a property between two temperatures at each node, by Gauss's quadrature."""
    if isinstance(given, float):
        return np.full(before.shape, given)
    places, weights = np.polynomial.legendre.leggauss(8)
    between = before[:, None] + 0.5 * (places + 1.0) * (after - before)[:, None]
    values = at_temperatures(name, given, between.ravel()).reshape(between.shape)
    return np.asarray(0.5 * values @ weights)
