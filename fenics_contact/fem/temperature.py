"""The temperature change of a body in UFL, and the stress including thermal strain."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import ufl
from ufl.core.expr import Expr

from fenics_contact import _dolfinx
from fenics_contact.fem.load_forms import FIRST_COUNT, from_ufl
from fenics_contact.fem.templates import Constants, scalar_constants
from fenics_contact.scene import Hyperelasticity, Load, Material, ThermalStrain, Transverse, Ufl, evaluate


@dataclass(frozen=True)
class Temperature:
    """The sum of the temperature changes of one body.

    Attributes:
        loads: The temperature changes; without any, no form depends on temperature.
    """

    loads: tuple[ThermalStrain, ...] = ()

    @property
    def key(self) -> tuple[bool, bool, tuple[Ufl, ...]]:
        """The key of everything on which a form depends."""
        return bool(self._numbers), bool(self.of_position), tuple(load.value for load in self._ufl)

    @property
    def numbers(self) -> tuple[float, ...]:
        """Values of the constants: the sum of the uniform changes."""
        return (sum(self._numbers),) if self._numbers else ()

    def write(self, cell_type: str) -> tuple[Expr | None, Constants, tuple[ufl.Coefficient, ...]]:
        """Return ΔT (UFL, None without loads), its constants and its coefficients."""
        constants = scalar_constants(cell_type, 1) if self._numbers else ()
        coefficients: tuple[ufl.Coefficient, ...] = ()
        if self.of_position:
            coefficients = (ufl.Coefficient(_dolfinx.nodal_space(cell_type), count=FIRST_COUNT),)
        terms = [*constants, *coefficients, *(from_ufl(load, load.value, cell_type) for load in self._ufl)]
        return (sum(terms[1:], terms[0]) if terms else None), constants, coefficients

    def fields(self, mesh: _dolfinx.mesh.Mesh, points: np.ndarray) -> tuple[_dolfinx.fem.Function, ...]:
        """Return the Functions for the coefficients.

        Args:
            mesh: The mesh.
            points: Coordinates by input node, shape (n, dim), [length].
        """
        if not self.of_position:
            return ()
        space = _dolfinx.scalar_space(mesh, 1)
        nodes, dofs = _dolfinx.node_dofs(space)
        field = _dolfinx.fem.Function(space, name="temperature")
        for load in self.of_position:
            field.x.array[dofs] += evaluate("temperature_change", load.value, points[nodes], ())
        return (field,)

    @property
    def _numbers(self) -> list[float]:
        return [load.value for load in self.loads if isinstance(load.value, float)]

    @property
    def _ufl(self) -> list[Any]:
        return [load for load in self.loads if isinstance(load.value, Ufl)]

    @property
    def of_position(self) -> list[Any]:
        """The changes given as functions of position."""
        return [load for load in self.loads if not isinstance(load.value, float | Ufl)]


def temperature_of(loads: Iterable[Load], body: str) -> Temperature:
    """Return the temperature change of a body."""
    return Temperature(tuple(load for load in loads if isinstance(load, ThermalStrain) and load.body == body))


def stress_left(material: Any, u: Expr, constants: Constants, temperature: Expr | None) -> Expr:
    """Return the stress (dim x dim, UFL) of a displacement at a temperature change.

    Args:
        material: The material.
        u: The displacement (UFL).
        constants: The material's constants.
        temperature: ΔT (UFL) or None.
    """
    stress = material.stress(u, constants)
    return stress if temperature is None else stress - temperature * material.thermal_stress(constants)


def stress_in_space(material: Material, u: Expr, constants: Constants, temperature: Expr | None) -> Expr:
    """Return the stress (3 x 3, UFL), in the plane including the component normal to it.

    Where the material is nonlinear it is Cauchy's.
    """
    if isinstance(material, Hyperelasticity):
        return material.cauchy(u, constants)
    stress = stress_left(material, u, constants, temperature)
    if stress.ufl_shape == (3, 3):
        return stress
    normal: Expr | int = 0
    if isinstance(material, Transverse):
        normal = material.transverse_stress(u, constants)
        if temperature is not None:
            normal = normal - temperature * material.transverse_thermal_stress(constants)
    rows = [[stress[i, j] for j in range(2)] + [0] for i in range(2)]
    return ufl.as_tensor([*rows, [0, 0, normal]])
