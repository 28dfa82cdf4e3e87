"""Virtual work of loads in UFL, and the values and fields to bind to it."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from typing import Any

import numpy as np
import ufl
from ufl.core.expr import Expr

from fenics_contact import _dolfinx
from fenics_contact._fem.composition import Composition, integrate
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
KIND = {
    BodyForce: "body force", ThermalStrain: "thermal strain", InitialStress: "initial stress",
    Pressure: "pressure",
}  # fmt: skip


def is_scalar(load: Load) -> bool:
    """Return whether the value of a load is a scalar."""
    return isinstance(load, Pressure | ThermalStrain)


def load_name(load: Load, element: Element) -> tuple[str, str, str]:
    """Return the name of the form of a load: kind, type of its value, cell type."""
    given = "UFL" if isinstance(load.value, Ufl) else "of position" if callable(load.value) else "numbers"
    kind = KIND.get(type(load), "surface load") + " on a region" * (region_of(load) is not None)
    return (kind, given, element.name)


def region_of(load: Load) -> str | None:
    """Return the name of the region on which alone a load acts, None for others."""
    return load.region if isinstance(load, BodyForce | InitialStress) else None


def loaded_cells(
    load: Load, parts: Composition, body: Body, cells: np.ndarray
) -> dict[int, np.ndarray] | None:
    """Return the cells of one mesh by the tags of a load's form, None if it has none."""
    region = region_of(load)
    if region is not None and not isinstance(load, InitialStress):
        return {LOADED: np.flatnonzero(np.isin(cells, body.mesh.regions[region]))}
    return parts.cells if isinstance(load, ThermalStrain) else None


def load_key(load: Load, materials: tuple[Material, ...], element: Element) -> tuple[Hashable, ...]:
    """Return the key of everything on which the form of a load depends."""
    own = load.value if isinstance(load.value, Ufl) else None
    return (*load_name(load, element), element, own, materials if isinstance(load, ThermalStrain) else ())


class Symbol:
    """The value of a load as UFL, with its constants and coefficients."""

    def __init__(self, load: Load, element: Element, number: int = 0) -> None:
        """Write the value of ``load``; ``number`` distinguishes the loads of one form."""
        width = element.components
        self.constants: Constants = ()
        self.coefficients: tuple[ufl.Coefficient, ...] = ()
        if isinstance(load, InitialStress):
            space = element.cellwise((6,))
            self.expression = ufl.Coefficient(space, count=FIRST_COUNT + number)
            self.coefficients = (self.expression,)
        elif isinstance(load.value, Ufl):
            self.expression = from_ufl(load, load.value, element)
        elif callable(load.value):
            space = element.nodal if is_scalar(load) else element.displacements
            self.expression = ufl.Coefficient(space, count=FIRST_COUNT + number)
            self.coefficients = (self.expression,)
        else:
            self.constants = scalar_constants(element, 1 if is_scalar(load) else width)
            self.expression = self.constants[0] if is_scalar(load) else ufl.as_vector(list(self.constants))


def from_ufl(load: Load, value: Ufl, element: Element) -> Expr:
    """Return a value given as `Ufl`, written on the template, after a check of its shape."""
    width = element.components
    shape = () if is_scalar(load) else (width,)
    with user_code(f"the function given as Ufl of {type(load).__name__} on body {load.body!r}"):
        result = value.function(element.x)
        result = ufl.as_vector(list(result)) if isinstance(result, list | tuple) else ufl.as_ufl(result)
    if result.ufl_shape != shape:
        kind = "a scalar" if is_scalar(load) else f"a vector of {width} components"
        raise InvalidInputError(
            f"{type(load).__name__} on {load.body!r} needs shape {shape}, got {result.ufl_shape}: {kind}"
        )
    return result


def numbers_of(load: Load) -> tuple[float, ...]:
    """Return the values of a symbol's constants."""
    if callable(load.value) or isinstance(load.value, Ufl) or isinstance(load, InitialStress):
        return ()
    return tuple(load.value) if isinstance(load.value, Sequence) else (float(load.value),)


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
    if isinstance(load, InitialStress):
        assert of_cells is not None
        return (_dolfinx.cell_field(space.mesh, "initial_stress", of_cells),)
    if isinstance(load.value, Ufl) or not callable(load.value):
        return ()
    space = _dolfinx.scalar_space(space.mesh, 1) if is_scalar(load) else space
    nodes, dofs = _dolfinx.node_dofs(space)
    width = int(space.dofmap.index_map_bs)
    shape = () if is_scalar(load) else (width,)
    name = f"{type(load).__name__} on body {load.body!r}"
    here = np.arange(len(nodes)) if acted is None else np.flatnonzero(acted[nodes])
    field = _dolfinx.fem.Function(space, name="load")
    given = evaluate(name, load.value, points[nodes[here]], shape)
    field.x.array.reshape(-1, width)[dofs[here]] = given.reshape(-1, width)
    return (field,)


def has_work(load: Load, materials: tuple[Material, ...]) -> bool:
    """Return whether a load has a form: nonlinear materials feel temperatures themselves."""
    return not isinstance(load, ThermalStrain) or not all(map(is_nonlinear, materials))


def load_work(
    load: Load, materials: tuple[Material, ...], element: Element, value: Expr, v: Expr
) -> tuple[ufl.Form, Constants]:
    """Return the virtual work of a load along ``v``, a UFL form, and the constants of the materials in it."""
    if isinstance(load, ThermalStrain):
        (along,) = element.in_space(v)

        def thermal(material: Any, constants: Constants) -> Expr | None:
            if is_nonlinear(material):
                return None  # it feels the temperature itself
            work = value * ufl.inner(material.thermal_stress(constants), strain(along))
            return material.per_area(work, constants) if isinstance(material, Plate) else work

        return integrate(materials, element, thermal, volume_measure(element, 2))
    if isinstance(load, InitialStress):
        (along,) = element.in_space(v)
        size = len(along)
        work = -ufl.inner(
            ufl.as_matrix([[as_stress(value)[i, j] for j in range(size)] for i in range(size)]), strain(along)
        )
        return element.integrand(element.on_cells(work)) * volume_measure(element), ()
    work = ufl.dot(value, v) if not isinstance(load, Pressure) else None
    if work is None:
        normal = ufl.FacetNormal(element.template)
        work = -value * ufl.dot(normal, element.kinematics.in_section(v))
    measure = volume_measure(element, 2) if isinstance(load, BodyForce) else surface_measure(element)
    measure = measure if region_of(load) is None else measure(LOADED)
    return element.integrand(work) * measure, ()


def as_stress(vector: Expr) -> Expr:
    """Return the tensor (3 x 3, UFL) of six components xx, yy, zz, yz, xz, xy."""
    return as_tensor([vector[k] for k in range(6)], 3)


def load_parameters(load: Load, parts: Composition) -> tuple[float, ...]:
    """Return the values of the constants of a load's form: its own, then those of the materials."""
    return numbers_of(load) + (parts.parameters if isinstance(load, ThermalStrain) else ())
