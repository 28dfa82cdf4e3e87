"""The forms of bodies under large deformations."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import ufl
from ufl.core.expr import Expr

from fenics_contact import _dolfinx
from fenics_contact.fem.composition import integrate
from fenics_contact.fem.templates import Constants, Templates, Written, volume_measure
from fenics_contact.scene import (
    HistoryMaterial,
    Material,
    deformation_gradient,
    gradient_in_space,
    has_mean_dilatation,
    is_nonlinear,
    volume_change,
)

#: Returns an integrand from a material, the displacement, the mean dilatation and the material's constants.
Density = Callable[[Any, Expr, Expr, Constants], "Expr | None"]


def prepare_forms(templates: Templates, materials: tuple[Material, ...], cell_type: str) -> None:
    """Compile the missing forms of a set of materials, one of them nonlinear. Collective."""
    for kind in FORMS | (MEAN_FORMS if have_mean_energy(materials) else {}):
        name = (kind, *(type(material) for material in materials), cell_type)
        templates.get((kind, materials, cell_type), name, partial(_written, kind, materials, cell_type))


def have_mean_energy(materials: tuple[Material, ...]) -> bool:
    """Return whether some material has an energy of the mean dilatation of each cell."""
    return any(has_mean_dilatation(each) and not isinstance(each, HistoryMaterial) for each in materials)


def _written(kind: str, materials: tuple[Material, ...], cell_type: str) -> Written:
    """Return a form; its coefficients are the displacement and the mean dilatation of each cell."""
    (u,) = _dolfinx.field_symbols(cell_type, 1)
    mean = ufl.Coefficient(_dolfinx.cellwise_space(cell_type), count=1)
    density = (FORMS | MEAN_FORMS)[kind]

    def integrand(material: Material, constants: Constants) -> Expr | None:
        if isinstance(material, HistoryMaterial):
            return None  # what it answers is added to the assembled forms
        return density(material, u, mean, constants)

    form, constants = integrate(materials, cell_type, integrand, volume_measure(cell_type))
    return form, constants, (u, mean)


def _energy(material: Any, u: Expr, mean: Expr, constants: Constants) -> Expr:
    """Return the energy per undeformed volume."""
    F = deformation_gradient(u)
    if has_mean_dilatation(material):
        return material.shape_energy(gradient_in_space(F), constants) + material.volume_energy(
            mean, constants
        )
    return (
        material.density(F, constants) if is_nonlinear(material) else material.stiffness(u, u, constants) / 2
    )


def _work(material: Any, u: Expr, mean: Expr, constants: Constants) -> Expr:
    """Return the work of the stresses on a test function per undeformed volume."""
    v = ufl.TestFunction(u.ufl_function_space())
    if has_mean_dilatation(material):
        shape = ufl.inner(material.shape_stress(deformation_gradient(u), constants), ufl.grad(v))
        return shape + material.pressure(mean, constants) * volume_change(u, v)
    return material.work(u, v, constants) if is_nonlinear(material) else material.stiffness(u, v, constants)


def _tangent(material: Any, u: Expr, mean: Expr, constants: Constants) -> Expr:
    """Return the growth of the work with the displacement at fixed mean dilatations."""
    v, du = ufl.TestFunction(u.ufl_function_space()), ufl.TrialFunction(u.ufl_function_space())
    if has_mean_dilatation(material):
        volume = material.pressure(mean, constants) * ufl.derivative(volume_change(u, v), u, du)
        return material.shape_tangent(u, du, v, constants) + volume
    if is_nonlinear(material):
        return material.tangent(u, du, v, constants)
    return material.stiffness(du, v, constants)


def _volume_change(material: Any, u: Expr, mean: Expr, constants: Constants) -> Expr | None:
    """Return the change of J, tested by functions that are constant on cells."""
    if not has_mean_dilatation(material):
        return None
    q, du = ufl.TestFunction(mean.ufl_function_space()), ufl.TrialFunction(u.ufl_function_space())
    return q * volume_change(u, du)


def _bulk_modulus(material: Any, u: Expr, mean: Expr, constants: Constants) -> Expr | None:
    """Return U'' of the mean dilatation."""
    if not has_mean_dilatation(material):
        return None
    return ufl.TestFunction(mean.ufl_function_space()) * material.bulk_modulus_at(mean, constants)


#: Integrands of the forms of every set of materials with a nonlinear one, by number of arguments.
FORMS: dict[str, Density] = {"energy": _energy, "internal force": _work, "tangent": _tangent}
#: Those in addition where one of the materials has a mean dilatation, see `MeanDilatation`.
MEAN_FORMS: dict[str, Density] = {"volume change": _volume_change, "bulk modulus": _bulk_modulus}
