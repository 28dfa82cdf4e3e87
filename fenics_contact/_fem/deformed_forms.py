"""The forms of bodies under large deformations."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import ufl
from ufl.core.expr import Expr

from fenics_contact._fem.composition import integrate
from fenics_contact._fem.heated import heat_expands, on_stretched, thermal_split
from fenics_contact._fem.templates import (
    UNSEEN,
    Constants,
    Templates,
    Written,
    coefficient_shape,
    polynomial,
    stiffness_measure,
)
from fenics_contact._kinematics.element import Element
from fenics_contact.materials.elastic import Material
from fenics_contact.materials.hyperelastic import (
    deformation_gradient,
    gradient_in_space,
    has_mean_dilatation,
    is_nonlinear,
    volume_change,
)
from fenics_contact.materials.plastic import has_history


class Fields(NamedTuple):
    """The displacement, and the dilatation and pressure of cells, on the template.

    `tests`: such polynomials as test and as trial function; `swelling`: cube of the thermal stretch: what is
    held beside the dilatation is so in its total.
    """

    u: Expr
    v: Expr
    du: Expr
    dilatation: Expr
    pressure: Expr
    tests: tuple[Expr, Expr]
    unseen: bool
    swelling: Expr | int = 1


#: Returns an integrand from a material, the fields and the material's constants.
Density = Callable[[Any, Fields, Constants], "Expr | None"]


def prepare_forms(templates: Templates, materials: tuple[Material, ...], element: Element) -> None:
    """Compile the missing forms of a set of materials, one of them nonlinear. Collective."""
    for kind in FORMS | (MEAN_FORMS if have_mean_energy(materials) else {}):
        name = (kind, *(type(material) for material in materials), element.name)
        templates.get((kind, materials, element), name, partial(_written, kind, materials, element))


def have_mean_energy(materials: tuple[Material, ...]) -> bool:
    """Return whether some material has an energy of the mean dilatation of each cell."""
    return any(has_mean_dilatation(each) and not has_history(each) for each in materials)


def _written(kind: str, materials: tuple[Material, ...], element: Element) -> Written:
    """Return a form; its coefficients are the displacement and the fields of `MeanDilatation`.

    Where a nonlinear material expands the change of temperature is the last of them.
    """
    (u,) = element.fields(1)
    space = element.cellwise(coefficient_shape(element))
    means, pressures = (ufl.Coefficient(space, count=number) for number in (1, 2))
    centre = ufl.Coefficient(element.cellwise((len(u),)), count=3)
    q, r = (polynomial(each(space), centre, element) for each in (ufl.TestFunction, ufl.TrialFunction))
    dilatation, pressure = (polynomial(each, centre, element) for each in (means, pressures))
    V = u.ufl_function_space()
    moved, v, du = element.in_space(u, ufl.TestFunction(V), ufl.TrialFunction(V))
    fields = Fields(moved, v, du, dilatation, pressure, (q, r), element.cells in UNSEEN)
    change = ufl.Coefficient(element.nodal, count=4)
    density = (FORMS | MEAN_FORMS)[kind]

    def integrand(material: Material, constants: Constants) -> Expr | None:
        if has_history(material):
            return None  # what it answers is added to the assembled forms
        if not heat_expands(material):
            return density(material, fields, constants)
        stretch = 1 + constants[-1] * change
        now = thermal_split(stretch, moved, v, du)
        swelling = stretch**3
        heated = fields._replace(
            u=now[0], v=now[1], du=now[2], dilatation=dilatation / swelling, swelling=swelling
        )
        part = density(material, heated, constants)
        # What is integrated over cells grows as the volume of a warm body does; these two are per volume.
        power = {"cell pressure": 0, "bulk modulus": -3}.get(kind, 3)
        return None if part is None else stretch**power * on_stretched(part, element)

    form, constants = integrate(materials, element, integrand, stiffness_measure(element))
    coefficients = (u, means, pressures, centre)
    return form, constants, (*coefficients, change) if any(map(heat_expands, materials)) else coefficients


def _held(material: Any, fields: Fields, constants: Constants) -> Expr:
    """Return the modulus of what J has beside its projection."""
    return fields.swelling * material.unseen_modulus(constants)


def _apart(fields: Fields) -> Expr:
    """Return what J has beside its projection."""
    return ufl.det(deformation_gradient(fields.u)) - fields.dilatation


def _energy(material: Any, fields: Fields, constants: Constants) -> Expr:
    """Return the energy per undeformed volume."""
    u, F = fields.u, deformation_gradient(fields.u)
    if has_mean_dilatation(material):
        shape = material.shape_energy(gradient_in_space(F), constants)
        energy = shape + material.volume_energy(fields.dilatation, constants)
        if fields.unseen:
            energy += _held(material, fields, constants) / 2 * _apart(fields) ** 2
        return energy
    return (
        material.density(F, constants) if is_nonlinear(material) else material.stiffness(u, u, constants) / 2
    )


def _work(material: Any, fields: Fields, constants: Constants) -> Expr:
    """Return the work of the stresses on a test function per undeformed volume."""
    u, v = fields.u, fields.v
    if has_mean_dilatation(material):
        shape = ufl.inner(material.shape_stress(deformation_gradient(u), constants), ufl.grad(v))
        return shape + _pressure_at(material, fields, constants) * volume_change(u, v)
    return material.work(u, v, constants) if is_nonlinear(material) else material.stiffness(u, v, constants)


def _tangent(material: Any, fields: Fields, constants: Constants) -> Expr:
    """Return the growth of the work with the displacement at fixed dilatations and pressures."""
    u, v, du = fields.u, fields.v, fields.du
    if has_mean_dilatation(material):
        growth = ufl.derivative(volume_change(u, v), u, du)
        volume = _pressure_at(material, fields, constants) * growth
        if fields.unseen:
            volume += _held(material, fields, constants) * volume_change(u, v) * volume_change(u, du)
        return material.shape_tangent(u, du, v, constants) + volume
    if is_nonlinear(material):
        return material.tangent(u, du, v, constants)
    return material.stiffness(du, v, constants)


def _pressure_at(material: Any, fields: Fields, constants: Constants) -> Expr:
    """Return the pressure at a point: that of the cell, and of what its dilatation leaves out."""
    if not fields.unseen:
        return fields.pressure
    return fields.pressure + _held(material, fields, constants) * _apart(fields)


def _volume_change(material: Any, fields: Fields, constants: Constants) -> Expr | None:
    """Return the change of J, tested by polynomials in cells."""
    if not has_mean_dilatation(material):
        return None
    return fields.tests[0] * volume_change(fields.u, fields.du)


def _pressure(material: Any, fields: Fields, constants: Constants) -> Expr | None:
    """Return U' of the dilatation, tested by polynomials in cells."""
    if not has_mean_dilatation(material):
        return None
    return fields.tests[0] * material.pressure(fields.dilatation, constants)


def _bulk_modulus(material: Any, fields: Fields, constants: Constants) -> Expr | None:
    """Return U'' of the dilatation, less what the tangent has of it at points, between polynomials."""
    if not has_mean_dilatation(material):
        return None
    modulus = material.bulk_modulus_at(fields.dilatation, constants)
    if fields.unseen:
        modulus -= _held(material, fields, constants)
    return fields.tests[0] * fields.tests[1] * modulus


#: Integrands of the forms of every set of materials with a nonlinear one, by number of arguments.
FORMS: dict[str, Density] = {"energy": _energy, "internal force": _work, "tangent": _tangent}
#: Those in addition where one of the materials has a mean dilatation, see `MeanDilatation`.
MEAN_FORMS: dict[str, Density] = {
    "volume change": _volume_change,
    "cell pressure": _pressure,
    "bulk modulus": _bulk_modulus,
}
