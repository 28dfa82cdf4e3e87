"""Manufactured temperatures: meshes of all cells, sources that belong to them, and errors."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import sympy
from mpi4py import MPI

from fenics_contact.gallery import block, rectangle
from fenics_contact.heat import (
    ConductingBody,
    Conductor,
    HeatFlux,
    HeatScene,
    HeatSource,
    HeatState,
    HeldTemperature,
    solve_heat,
)
from fenics_contact.mesh import joined_cells, quadratic, serendipity
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.mesh.cell_types import (
    HEXAHEDRON,
    cell_type_of,
    quadrature,
    shape_gradients,
    shape_values,
)
from fenics_contact.mesh.collapsed import as_hexahedra, places_of
from tests.fem.mixed_cells import named_sides

X = sympy.symbols("x y z")
T = sympy.Symbol("T")


def pyramids(n: int) -> BodyMesh:
    """Return a cube each of whose cells is six pyramids around its middle."""
    whole = block((0, 0, 0), (1, 1, 1), (n, n, n))
    middles = whole.points[whole.cells].mean(axis=1)
    apex = len(whole.points) + np.arange(len(middles))
    bases = whole.cells[:, HEXAHEDRON.faces][:, :, ::-1].reshape(-1, 4)
    found = {"pyramid": np.column_stack([bases, np.repeat(apex, 6)])}
    return named_sides(np.concatenate([whole.points, middles]), joined_cells(found))


def prisms(n: int) -> BodyMesh:
    """Return a cube of prisms."""
    whole = block((0, 0, 0), (1, 1, 1), (n, n, n))
    halves = whole.cells[:, [[0, 1, 2, 4, 5, 6], [0, 2, 3, 4, 6, 7]]].reshape(-1, 6)
    return named_sides(whole.points, joined_cells({"prism": halves}))


def _plane(cell: str) -> Callable[[int], BodyMesh]:
    return lambda n: rectangle((0, 0), (1, 1), (n, n), cell)


def _solid(cell: str) -> Callable[[int], BodyMesh]:
    return lambda n: block((0, 0, 0), (1, 1, 1), (n, n, n), cell)


#: Cubes and squares of n cells a side, by the shape of their cells.
SHAPES: dict[str, Callable[[int], BodyMesh]] = {
    "triangle": _plane("triangle"),
    "quadrilateral": _plane("quadrilateral"),
    "tetrahedron": _solid("tetrahedron"),
    "hexahedron": _solid("hexahedron"),
    "prism": prisms,
    "pyramid": pyramids,
}
ORDERS: dict[str, Callable[[BodyMesh], BodyMesh]] = {
    "linear": lambda mesh: mesh,
    "quadratic": quadratic,
    "serendipity": lambda mesh: serendipity(quadratic(mesh)),
}


def bent(mesh: BodyMesh) -> BodyMesh:
    """Move the nodes smoothly, so that no cell is a parallelepiped; outer faces stay plane."""
    away = 0.06 * np.sin(np.pi * mesh.points).prod(axis=1)
    return mesh.moved(mesh.points + away[:, None] * [1.0, -0.7, 0.4][: mesh.dim])


@dataclass(frozen=True)
class Manufactured:
    """A temperature, and the conductivity as symbols: a number, or a matrix; of coordinates and T."""

    temperature: sympy.Expr
    conductivity: sympy.Expr | sympy.Matrix
    dim: int
    axisymmetric: bool = False

    @cached_property
    def _slope(self) -> Any:
        return sympy.Matrix([self.temperature.diff(x) for x in X[: self.dim]])

    @cached_property
    def _flux(self) -> Any:
        k = sympy.sympify(self.conductivity).subs(T, self.temperature)
        return -(k * self._slope)

    def _function(self, expression: sympy.Expr) -> Callable[[np.ndarray], np.ndarray]:
        found = sympy.lambdify(X[: self.dim], expression, "numpy")
        return lambda points: np.broadcast_to(found(*points.T), len(points)).astype(float)

    @cached_property
    def value(self) -> Callable[[np.ndarray], np.ndarray]:
        return self._function(self.temperature)

    @cached_property
    def source(self) -> Callable[[np.ndarray], np.ndarray]:
        weight = X[0] if self.axisymmetric else sympy.Integer(1)
        terms = (sympy.diff(weight * q, x) for q, x in zip(self._flux, X, strict=False))
        return self._function(sympy.cancel(sum(terms) / weight) if self.axisymmetric else sum(terms))

    def flux(self, points: np.ndarray) -> np.ndarray:
        return np.column_stack([self._function(q)(points) for q in self._flux])

    def slope(self, points: np.ndarray) -> np.ndarray:
        return np.column_stack([self._function(s)(points) for s in self._slope])

    def state(self, mesh: BodyMesh, material: Conductor) -> HeatState:
        """Solve with the temperature held on all sides but x1, through which its flux enters."""
        body = ConductingBody(mesh, material, self.axisymmetric)
        free = {"x0", "x1"} if self.axisymmetric else {"x1"}
        sides = [name for name in mesh.surfaces if name not in free]
        held = [HeldTemperature("body", name, self.value) for name in sides]
        entering = HeatFlux("body", "x1", lambda points: -self.flux(points)[:, 0])
        loads = [HeatSource("body", self.source), entering]
        return solve_heat(HeatScene({"body": body}, held, loads), MPI.COMM_SELF)

    def errors(self, mesh: BodyMesh, temperature: np.ndarray) -> tuple[float, float]:
        """Return the L2 norms of the errors of temperature and slope, relative to those of the exact ones."""
        kind = cell_type_of(mesh.cells, mesh.dim)
        at, weights = quadrature(kind, 8)
        values = as_hexahedra(temperature[mesh.cells], mesh.cells, mesh.dim)
        corners = places_of(mesh.points, mesh.cells)
        shape, gradient = shape_values(kind, at), shape_gradients(kind, at)
        jacobian = np.einsum("qkd,cke->cqed", gradient, corners)
        places = np.einsum("qk,cke->cqe", shape, corners)
        size = weights * np.abs(np.linalg.det(jacobian)) * (places[..., 0] if self.axisymmetric else 1.0)
        slopes = np.einsum("qkd,cqde,ck->cqe", gradient, np.linalg.inv(jacobian), values)
        flat = places.reshape(-1, mesh.dim)
        exact, slope = self.value(flat).reshape(size.shape), self.slope(flat).reshape(places.shape)
        wrong = np.einsum("qk,ck->cq", shape, values) - exact
        of_slope = ((slopes - slope) ** 2).sum(axis=2)
        return (
            float(np.sqrt((size * wrong**2).sum() / (size * exact**2).sum())),
            float(np.sqrt((size * of_slope).sum() / (size * (slope**2).sum(axis=2)).sum())),
        )


def order(coarse: float, fine: float, ratio: float = 2.0) -> float:
    """Return the order of errors on two meshes whose cells differ in size by a ratio."""
    return float(np.log(coarse / fine) / np.log(ratio))


WAVE = {
    2: sympy.sin(2 * X[0] + sympy.Rational(1, 2)) * sympy.exp(X[1]),
    3: sympy.sin(2 * X[0] + sympy.Rational(1, 2)) * sympy.exp(X[1]) * sympy.cos(X[2]),
}
#: Smooth around the axis, for bodies of revolution.
REVOLVED = (1 + X[0] ** 2 - sympy.Rational(2, 3) * X[0] ** 4) * sympy.exp(X[1])
DIM = {name: 2 if name in ("triangle", "quadrilateral") else 3 for name in SHAPES}
