"""Virtual work of loads in UFL, and the values and fields to bind to it."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from typing import Any

import numpy as np
import ufl
from ufl.core.expr import Expr

from fenics_contact import _dolfinx
from fenics_contact._fem.composition import Composition, integrate_by_ply
from fenics_contact._fem.templates import (
    LOADED,
    Constants,
    scalar_constants,
    surface_measure,
    volume_measure,
)
from fenics_contact._kinematics.element import Element
from fenics_contact._scene.body import Body
from fenics_contact._scene.fields import Ufl, evaluate
from fenics_contact._scene.loads import BodyForce, InitialStress, Load, Pressure, ThermalStrain
from fenics_contact.errors import InvalidInputError
from fenics_contact.errors.kinds import user_code
from fenics_contact.materials.elastic import Material, Plate, as_tensor, strain
from fenics_contact.materials.hyperelastic import is_nonlinear

#: First number of the coefficients of loads, after those of displacement fields.
FIRST_COUNT = 4


def load_name(load: Load, element: Element) -> tuple[str, str, str]:
    """Return the name of the form of a load: kind, type of its value, cell type."""
    given = "UFL" if load.is_ufl else "of position" if load.is_function else "numbers"
    return (load.kind + " on a region" * bool(load.on_region), given, element.name)


def loaded_cells(
    load: Load, parts: Composition, body: Body, cells: np.ndarray
) -> dict[int, np.ndarray] | None:
    """Return the cells of one mesh by the tags of a load's form, None if it has none."""
    if load.on_region and not load.by_cell:
        return {LOADED: np.flatnonzero(np.isin(cells, body.mesh.regions[load.on_region]))}
    return parts.cells if load.by_materials else None


def load_key(load: Load, materials: tuple[Material, ...], element: Element) -> tuple[Hashable, ...]:
    """Return the key of everything on which the form of a load depends."""
    own = load.value if load.is_ufl else None
    return (*load_name(load, element), element, own, materials if load.by_materials else ())


class Symbol:
    """The value of a load as UFL, with its constants and coefficients."""

    def __init__(self, load: Load, element: Element, number: int = 0) -> None:
        """Write the value of ``load``; ``number`` distinguishes the loads of one form."""
        width = element.components
        self.constants: Constants = ()
        self.coefficients: tuple[ufl.Coefficient, ...] = ()
        if load.by_cell:
            space = element.cellwise((6,))
            self.expression = ufl.Coefficient(space, count=FIRST_COUNT + number)
            self.coefficients = (self.expression,)
        elif isinstance(load.value, Ufl):
            self.expression = from_ufl(load, load.value, element)
        elif load.is_function:
            space = element.nodal if load.is_scalar else element.displacements
            self.expression = ufl.Coefficient(space, count=FIRST_COUNT + number)
            self.coefficients = (self.expression,)
        else:
            self.constants = scalar_constants(element, 1 if load.is_scalar else width)
            self.expression = self.constants[0] if load.is_scalar else ufl.as_vector(list(self.constants))


def from_ufl(load: Load, value: Ufl, element: Element) -> Expr:
    """Return a value given as `Ufl`, written on the template, after a check of its shape."""
    shape = load.width(element.components)
    with user_code(f"the function given as Ufl of {type(load).__name__} on body {load.body!r}"):
        result = value.function(element.x)
        result = ufl.as_vector(list(result)) if isinstance(result, list | tuple) else ufl.as_ufl(result)
    if result.ufl_shape != shape:
        kind = "a scalar" if load.is_scalar else f"a vector of {element.components} components"
        raise InvalidInputError(
            f"{type(load).__name__} on {load.body!r} needs shape {shape}, got {result.ufl_shape}: {kind}"
        )
    return result


def numbers_of(load: Load) -> tuple[float, ...]:
    """Return the values of a symbol's constants."""
    return () if load.by_cell else load.numbers


def load_fields(
    load: Load,
    space: _dolfinx.fem.FunctionSpace,
    points: np.ndarray,
    acted: np.ndarray | None = None,
    of_cells: np.ndarray | None = None,
) -> tuple[_dolfinx.fem.Function, ...]:
    """Return the Functions for a symbol's coefficients.

    `acted`: marks of the nodes on the load's surface; the value is asked for only there.
    """
    if load.by_cell:
        assert of_cells is not None
        return (_dolfinx.cell_field(space.mesh, "initial_stress", of_cells),)
    if not load.is_function:
        return ()
    space = _dolfinx.scalar_space(space.mesh, 1) if load.is_scalar else space
    nodes, dofs = _dolfinx.node_dofs(space)
    width = int(space.dofmap.index_map_bs)
    name = f"{type(load).__name__} on body {load.body!r}"
    here = np.arange(len(nodes)) if acted is None else np.flatnonzero(acted[nodes])
    field = _dolfinx.fem.Function(space, name="load")
    given = evaluate(name, load.function, points[nodes[here]], load.width(width))
    field.x.array.reshape(-1, width)[dofs[here]] = given.reshape(-1, width)
    return (field,)


def has_work(load: Load, materials: tuple[Material, ...]) -> bool:
    """Return whether a load has a form: nonlinear materials feel temperatures themselves."""
    return not load.by_materials or not all(map(is_nonlinear, materials))


def load_work(
    load: Load, materials: tuple[Material, ...], element: Element, value: Expr, v: Expr
) -> tuple[ufl.Form, Constants]:
    """Return the virtual work of a load along ``v``, a UFL form, and the constants of the materials in it."""
    return WORK.get(type(load), _surface_work)(load, materials, element, value, v)


def _thermal_work(
    load: ThermalStrain, materials: tuple[Material, ...], element: Element, value: Expr, v: Expr
) -> tuple[ufl.Form, Constants]:
    (along,) = element.in_space(v)

    def thermal(material: Any, constants: Constants) -> Expr | None:
        if is_nonlinear(material):
            return None  # it feels the temperature itself
        work = value * ufl.inner(material.thermal_stress(constants), strain(along))
        return material.per_area(work, constants) if isinstance(material, Plate) else work

    return integrate_by_ply(materials, element, thermal, volume_measure(element, 2))


def _stress_work(
    load: InitialStress, materials: tuple[Material, ...], element: Element, value: Expr, v: Expr
) -> tuple[ufl.Form, Constants]:
    (along,) = element.in_space(v)
    axes, stress = range(len(along)), as_stress(value)
    work = -ufl.inner(ufl.as_matrix([[stress[i, j] for j in axes] for i in axes]), strain(along))
    return element.integrand(element.on_cells(work)) * volume_measure(element), ()


def _body_work(
    load: BodyForce, materials: tuple[Material, ...], element: Element, value: Expr, v: Expr
) -> tuple[ufl.Form, Constants]:
    measure = volume_measure(element, 2)
    measure = measure(LOADED) if load.on_region else measure
    return element.integrand(ufl.dot(value, v)) * measure, ()


def _pressure_work(
    load: Pressure, materials: tuple[Material, ...], element: Element, value: Expr, v: Expr
) -> tuple[ufl.Form, Constants]:
    work = -value * ufl.dot(ufl.FacetNormal(element.template), element.kinematics.in_section(v))
    return element.integrand(work) * surface_measure(element), ()


def _surface_work(
    load: Load, materials: tuple[Material, ...], element: Element, value: Expr, v: Expr
) -> tuple[ufl.Form, Constants]:
    return element.integrand(ufl.dot(value, v)) * surface_measure(element), ()


#: The virtual work of loads by their type; of all others it is that of forces on a surface.
WORK: dict[type, Callable[[Any, tuple[Material, ...], Element, Expr, Expr], tuple[ufl.Form, Constants]]] = {
    BodyForce: _body_work,
    ThermalStrain: _thermal_work,
    InitialStress: _stress_work,
    Pressure: _pressure_work,
}


def as_stress(vector: Expr) -> Expr:
    """Return the tensor (3 x 3, UFL) of six components xx, yy, zz, yz, xz, xy."""
    return as_tensor([vector[k] for k in range(6)], 3)


def load_parameters(load: Load, parts: Composition) -> tuple[float, ...]:
    """Return the values of the constants of a load's form: its own, then those of the materials."""
    return numbers_of(load) + (parts.parameters if load.by_materials else ())
