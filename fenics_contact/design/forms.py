"""Derivatives of subdomain integrals by the mesh coordinates, from UFL."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import ufl
from ufl.core.expr import Expr

from fenics_contact import _dolfinx
from fenics_contact._base.libraries import MPI
from fenics_contact._fem.composition import integrate, integrate_by_ply, material_sets
from fenics_contact._fem.forms import Temperature, stress_in_space, stress_left
from fenics_contact._fem.load_forms import Symbol, load_key, load_name, load_work
from fenics_contact._fem.templates import (
    Constants,
    Template,
    Templates,
    Written,
    scalar_constants,
    stiffness_measure,
    volume_measure,
)
from fenics_contact._kinematics.element import Element
from fenics_contact._scene.loads import Load
from fenics_contact.errors.kinds import user_code
from fenics_contact.feti.subdomain import Subdomain
from fenics_contact.feti.torn import TornSystem
from fenics_contact.materials.elastic import Material
from fenics_contact.materials.hyperelastic import is_nonlinear

#: Builds an integrand (UFL) from a displacement u, the coordinate x, the stress σ(u) and constants.
Integrand = Callable[..., Expr]
Materials = tuple[Material, ...]


@dataclass(frozen=True)
class Density:
    """What is integrated over a body.

    `integrand`: takes displacement, coordinates, stress, the constants and the fields of cells (UFL), returns
    a UFL scalar; `in_space`: whether the stress of plane bodies has the component normal to the plane, too;
    `degree`: degree of its quadrature on linear cells; `of_cells`: components of the field that is constant
    on cells, if there is one.
    """

    name: str
    integrand: Integrand
    constants: int = 0
    in_space: bool = False
    degree: int = 2
    of_cells: tuple[int, ...] = ()


class EveryNode:
    """The nodes that move where no design is known: all."""

    def __getitem__(self, nodes: np.ndarray) -> np.ndarray:
        return np.ones(len(nodes), dtype=bool)

    def any(self) -> bool:
        """Return whether there is one."""
        return True


#: Marks of the nodes of all bodies that move.
Moving = np.ndarray | EveryNode
EVERY_NODE = EveryNode()


class ShapeForms:
    """Compiled functionals of one or two displacement fields and their derivatives.

    A functional is compiled on first use, by all ranks together. ``materials`` are those of a `Composition`.
    """

    def __init__(self, comm: MPI.Comm, moving: Moving = EVERY_NODE) -> None:
        """Start empty."""
        self.moving = moving
        self._templates = Templates(comm)

    @classmethod
    def at_rest(cls, torn: TornSystem) -> ShapeForms:
        """Return those of a design that moves no node, for values and derivatives by forces alone."""
        decomposition = torn.decomposition
        return cls(decomposition.comm, np.zeros(decomposition.tearing.n_nodes, dtype=bool))

    @property
    def nothing_moves(self) -> bool:
        """Whether no derivative by nodes is needed, so that none need be compiled."""
        return not self.moving.any()

    @property
    def compiled(self) -> tuple[tuple[object, ...], ...]:
        """Names of the forms compiled so far."""
        return self._templates.names

    def virtual_work_by_shape(self, materials: Materials, element: Element) -> Template:
        """∂/∂x of the work of the stresses at u along w, a(u, w) in small strain; coefficients (u, w)."""

        def write() -> Written:
            u, w = element.fields(2)
            moved, along = element.in_space(u, w)
            form, constants = integrate_by_ply(
                materials,
                element,
                lambda m, c: _virtual_work(m, moved, along, c),
                stiffness_measure(element),
            )
            return _by_shape(form, element), constants, [u, w]

        name = ("work by shape", *(type(material) for material in materials), element.name)
        return self._templates.get(("work by shape", materials, element), name, write)

    def load_by_shape(self, load: Load, materials: Materials, element: Element) -> Template:
        """∂/∂x of the work of a load along w at fixed nodal values of its field; coefficients (w, field)."""
        return self._of_load("by shape", load, materials, element, _by_shape)

    def load_by_field(self, load: Load, materials: Materials, element: Element) -> Template:
        """Derivative of the work of a load along w by the values of its field; the same coefficients."""

        def by_field(form: ufl.Form, element: Element) -> ufl.Form:
            return ufl.derivative(form, Symbol(load, element).expression)

        return self._of_load("by field", load, materials, element, by_field)

    def _of_load(
        self,
        what: str,
        load: Load,
        materials: Materials,
        element: Element,
        differentiate: Callable[[ufl.Form, Element], ufl.Form],
    ) -> Template:
        def write() -> Written:
            (w,) = element.fields(1)
            symbol = Symbol(load, element)
            form, constants = load_work(load, materials, element, symbol.expression, w)
            coefficients = [w, *symbol.coefficients]
            return differentiate(form, element), (*symbol.constants, *constants), coefficients

        key = (f"load {what}", *load_key(load, materials, element))
        return self._templates.get(key, (what, *load_name(load, element)), write)

    def functional(
        self,
        density: Density,
        materials: Materials,
        element: Element,
        by: str,
        temperature: Temperature = Temperature(),
    ) -> Template:
        """∫ density dx itself (by="value"), or its derivative by="displacement", "shape" or "temperature".

        The derivative by the shape is that at fixed nodal values of a temperature that is a function of
        position, that by the temperature is by these values.

        Its constants are those of the density, of the temperature and of the materials; its coefficients are
        u, the fields of the density, and those of the temperature.
        """

        def write() -> Written:
            (u,) = element.fields(1)
            x = element.x
            change, numbers, fields = temperature.write(element)
            own = scalar_constants(element, density.constants)
            known = [ufl.Coefficient(element.cellwise((size,)), count=1) for size in density.of_cells]
            stress_of = stress_in_space if density.in_space else stress_left
            (moved,) = element.in_space(u)

            def write_density(material: Material, constants: Constants) -> Expr:
                with user_code(f"the integrand of {density.name!r}"):
                    stress = stress_of(material, moved, constants, change)
                    return density.integrand(u, x, stress, *own, *known)

            measure = volume_measure(element, density.degree)
            form, constants = integrate(materials, element, write_density, measure)
            if by == "displacement":
                form = ufl.derivative(form, u, ufl.TestFunction(element.displacements))
            elif by == "shape":
                form = _by_shape(form, element)
            elif by == "temperature":
                form = ufl.derivative(form, fields[0])
            return form, (*own, *numbers, *constants), [u, *known, *fields]

        types = tuple(type(material) for material in materials)
        key = (density, by, materials, element, temperature.key)
        return self._templates.get(key, (density.name, by, *types, element.name), write)


def _virtual_work(material: Any, u: Expr, w: Expr, constants: Constants) -> Expr:
    """Return the work of the stresses at u along w."""
    return material.work(u, w, constants) if is_nonlinear(material) else material.stiffness(u, w, constants)


def _by_shape(form: ufl.Form, element: Element) -> ufl.Form:
    velocity = ufl.TestFunction(element.displacements)
    return ufl.derivative(form, element.x, velocity)


def sets_in_use(torn: TornSystem, body: str) -> list[Materials]:
    """Return the materials of the subdomains of a body, of all ranks: others need no form. Collective."""
    every = material_sets(torn.scene.bodies[body])
    mine = {part.material.materials for part in torn.subdomains if part.mesh.body == body}
    used = torn.decomposition.comm.allgather([materials in mine for materials in every])
    return [materials for materials, *ranks in zip(every, *used, strict=True) if any(ranks)]


def sum_over_subdomains(
    torn: TornSystem,
    fields: Sequence[np.ndarray],
    evaluate: Callable[[Subdomain, Sequence[_dolfinx.fem.Function]], np.ndarray],
    moving: Moving = EVERY_NODE,
) -> np.ndarray:
    """Add up nodal derivatives over this rank's subdomains, shape (n_nodes, dim) for all bodies."""
    tearing = torn.decomposition.tearing
    total = np.zeros((int(tearing.node_offset[-1]), torn.scene.dim))
    for subdomain, functions in subdomain_fields(torn, fields, moving):
        vector = evaluate(subdomain, functions)
        nodes = tearing.global_nodes(subdomain.mesh.body, subdomain.mesh.nodes)
        total[nodes] += vector.reshape(-1, torn.scene.dim)
    return total


def subdomain_fields(
    torn: TornSystem, fields: Sequence[np.ndarray], moving: Moving = EVERY_NODE
) -> Iterator[tuple[Subdomain, list[_dolfinx.fem.Function]]]:
    """Yield each of this rank's subdomains with the fields as Functions on it."""
    tearing = torn.decomposition.tearing
    starts = np.cumsum([0] + [subdomain.mesh.size for subdomain in torn.subdomains])
    for subdomain, start in zip(torn.subdomains, starts[:-1], strict=True):
        mesh = subdomain.mesh
        if not moving[tearing.global_nodes(mesh.body, mesh.nodes)].any():
            continue
        # Systems of several geometries share the meshes: another one may have moved them in the meantime.
        points = torn.scene.bodies[mesh.body].mesh.points
        _dolfinx.update_coordinates(mesh.space.mesh, mesh.by_input_node(points[mesh.nodes]))
        functions = []
        for index, field in enumerate(fields):
            function = _dolfinx.fem.Function(mesh.space, name=f"field{index}")
            function.x.array[:] = mesh.on_space(field[start : start + mesh.size])
            functions.append(function)
        yield subdomain, functions
