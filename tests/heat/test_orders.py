"""Manufactured temperatures: the order of each cell in L2 and energy, of nodal fluxes and through sides."""

from __future__ import annotations

import numpy as np
import pytest
import sympy
import ufl

from fenics_contact import Ufl
from fenics_contact.heat import Conductor, TemperatureTable
from fenics_contact.mesh.cell_types import cell_type_of
from tests.heat.manufactured import DIM, ORDERS, REVOLVED, SHAPES, WAVE, Manufactured, T, X, bent, order

CELLS = [
    (shape, raised)
    for shape in SHAPES
    for raised in ORDERS
    if raised != "serendipity" or shape not in ("triangle", "tetrahedron")
]
QUICK = [("triangle", "quadratic"), ("hexahedron", "serendipity"), ("prism", "linear")]


def cells_along(shape: str, raised: str) -> tuple[int, int]:
    """Return numbers of cells along the sides of a coarse and of a fine mesh."""
    if DIM[shape] == 2:
        return 6, 12
    return (4, 8) if raised == "linear" else (2, 4)


def measured(exact: Manufactured, shape: str, raised: str, material: Conductor) -> tuple[float, float]:
    """Return the orders in L2 and in energy."""
    errors = []
    for n in cells_along(shape, raised):
        mesh = ORDERS[raised](bent(SHAPES[shape](n)))
        state = exact.state(mesh, material)
        assert state.balance.error < 1e-12
        errors.append(exact.errors(mesh, state.temperature["body"]))
    (coarse, coarse_slope), (fine, fine_slope) = errors
    return order(coarse, fine), order(coarse_slope, fine_slope)


def check(orders: tuple[float, float], raised: str) -> None:
    degree = 1 if raised == "linear" else 2
    assert orders[0] > degree + 1 - 0.15
    assert orders[1] > degree - 0.15


def anisotropic(dim: int) -> np.ndarray:
    return 2.0 * np.eye(dim) + 0.5


@pytest.mark.parametrize(("shape", "raised"), QUICK)
def test_cells_have_the_order_of_their_functions(shape: str, raised: str) -> None:
    k = anisotropic(DIM[shape])
    exact = Manufactured(WAVE[DIM[shape]], sympy.Matrix(k.tolist()), DIM[shape])
    check(measured(exact, shape, raised, Conductor(k)), raised)


@pytest.mark.slow
@pytest.mark.parametrize(("shape", "raised"), [cell for cell in CELLS if cell not in QUICK])
def test_all_other_cells_have_the_order_of_their_functions(shape: str, raised: str) -> None:
    test_cells_have_the_order_of_their_functions(shape, raised)


@pytest.mark.slow
@pytest.mark.parametrize(("shape", "raised"), [cell for cell in CELLS if DIM[cell[0]] == 2])
def test_bodies_of_revolution_have_it_also(shape: str, raised: str) -> None:
    exact = Manufactured(REVOLVED, sympy.diag(2, 3), 2, axisymmetric=True)
    check(measured(exact, shape, raised, Conductor((2.0, 3.0))), raised)


LAWS = {
    "ufl": (1 + X[0] + T**2 / 5, Conductor(Ufl(lambda x, t: 1.0 + x[0] + t**2 / 5.0))),
    "ufl of functions": (2 + sympy.sin(T / 2), Conductor(Ufl(lambda x, t: 2.0 + ufl.sin(0.5 * t)))),
    "table": (3 + T / 2, Conductor(TemperatureTable((-5.0, 5.0), (0.5, 5.5)))),
    "function": (3 + T**2 / 2, Conductor(lambda t: 3.0 + 0.5 * t**2)),
}


@pytest.mark.parametrize(
    ("law", "shape", "raised"),
    [
        ("ufl", "triangle", "quadratic"),
        ("table", "quadrilateral", "linear"),
        *(
            pytest.param(law, shape, raised, marks=pytest.mark.slow)
            for law in LAWS
            for shape in ("triangle", "quadrilateral", "hexahedron", "prism")
            for raised in ("linear", "quadratic")
        ),
    ],
)
def test_conductivities_by_temperature_have_it_also(law: str, shape: str, raised: str) -> None:
    k, material = LAWS[law]
    check(measured(Manufactured(WAVE[DIM[shape]], k, DIM[shape]), shape, raised, material), raised)


@pytest.mark.parametrize(
    ("shape", "raised"),
    [
        ("quadrilateral", "linear"),
        ("triangle", "quadratic"),
        *(
            pytest.param(shape, raised, marks=pytest.mark.slow)
            for shape in SHAPES
            for raised in ("linear", "quadratic")
            if shape != "pyramid"
        ),
    ],
)
def test_nodal_fluxes_and_heat_through_sides_have_one_order_more(shape: str, raised: str) -> None:
    k, material = LAWS["ufl"]
    dim, degree = DIM[shape], 1 if raised == "linear" else 2
    exact, wrong = Manufactured(WAVE[dim], k, dim), []
    for n in cells_along(shape, raised):
        mesh = ORDERS[raised](bent(SHAPES[shape](n)))
        state = exact.state(mesh, material)
        flux = exact.flux(mesh.points)
        nodal = np.linalg.norm(state.nodal_flux("body")[0] - flux) / np.linalg.norm(flux)
        through = {side: state.heat_through("body", side) for side in mesh.surfaces}
        # What enters through all sides is what the source takes away, corners of three sides included.
        source = state.balance.by_part["HeatSource body"]
        assert sum(through.values()) == pytest.approx(-source, rel=1e-12)
        wrong.append((nodal, abs(through["x0"] / entering(exact) - 1.0)))
    assert order(wrong[0][0], wrong[1][0]) > degree + 1 - 0.2
    assert order(wrong[0][1], wrong[1][1]) > degree + 1 - 0.2
    assert wrong[1][1] < 0.03


def entering(exact: Manufactured) -> float:
    """Return the heat that enters through x0 by Gauss's quadrature."""
    at, weights = np.polynomial.legendre.leggauss(12)
    at, weights = 0.5 * (at + 1.0), 0.5 * weights
    places = np.stack(np.meshgrid(*[at] * (exact.dim - 1), indexing="ij"), axis=-1).reshape(-1, exact.dim - 1)
    weight = np.stack(np.meshgrid(*[weights] * (exact.dim - 1), indexing="ij"), axis=-1).prod(axis=-1).ravel()
    return float(exact.flux(np.pad(places, ((0, 0), (1, 0))))[:, 0] @ weight)


@pytest.mark.parametrize("shape", ["prism", pytest.param("pyramid", marks=pytest.mark.slow)])
def test_mean_fluxes_of_cells_of_a_linear_temperature_are_exact(shape: str) -> None:
    exact = Manufactured(1 + 2 * X[0] - X[1] + 3 * X[2], sympy.Integer(2), 3)
    mesh = ORDERS["quadratic"](bent(SHAPES[shape](2)))
    assert cell_type_of(mesh.cells, 3).name == "hexahedron27"
    state = exact.state(mesh, Conductor(2.0))
    assert state.flux["body"] == pytest.approx(np.tile([-4.0, 2.0, -6.0], (mesh.n_cells, 1)), rel=1e-9)
    assert state.nodal_flux("body")[0] == pytest.approx(
        np.tile([-4.0, 2.0, -6.0], (mesh.n_nodes, 1)), rel=1e-7
    )
