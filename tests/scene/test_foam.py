"""Foams against the closed forms of a bar."""

from __future__ import annotations

from typing import Any

import pytest
from mpi4py import MPI

from fenics_contact import Body, Scene, Support, check_hyperelastic, solve_scene
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import block
from fenics_contact.materials import Hyperfoam

CUBE = block((0, 0, 0), (1, 1, 1), (1, 1, 1))


def bar(foam: Hyperfoam, stretch: float) -> tuple[float, float]:
    """Return force and lateral stretch of a bar of section one that is drawn out, free across."""
    sides = [Support("a", "x0", (0.0, None, None)), Support("a", "x1", (stretch - 1, None, None))]
    sides += [Support("a", "y0", (None, 0.0, None)), Support("a", "z0", (None, None, 0.0))]
    state = solve_scene(Scene({"a": Body(CUBE, foam)}, supports=sides), MPI.COMM_WORLD)
    force = state.nodal_reactions("a")[CUBE.points[:, 0] == 1.0, 0].sum()
    on_top = CUBE.points[:, 1] == 1.0
    return float(force), 1 + float(state.gather_displacement("a")[on_top, 1].mean())


@pytest.mark.parametrize("stretch", [0.4, 1.6])
def test_a_bar_of_one_term_widens_by_its_poisson_ratio(stretch: float) -> None:
    """λ_t = λ^(−ν) at any stretch, and P = 2 μ / α (λ^α − J^(−α β)) / λ."""
    mu, alpha, nu = 2.0, 3.5, 0.2
    force, across = bar(Hyperfoam((mu,), (alpha,), (nu,)), stretch)
    assert across == pytest.approx(stretch**-nu, rel=1e-6)
    volume, beta = stretch * across**2, nu / (1 - 2 * nu)
    energies = stretch**alpha - volume ** (-alpha * beta)
    assert force == pytest.approx(2 * mu / alpha * energies / stretch, rel=1e-6)


def test_a_bar_without_poisson_ratio_keeps_its_section() -> None:
    terms = ((0.16, 8.9), (0.02, -4.8))
    moduli, exponents = zip(*terms, strict=True)
    force, across = bar(Hyperfoam(moduli, exponents, (0.0, 0.0)), 0.6)
    assert across == pytest.approx(1.0, abs=1e-7)
    assert force == pytest.approx(sum(2 * m / a * (0.6 ** (a - 1) - 1 / 0.6) for m, a in terms), rel=1e-6)


@pytest.mark.parametrize("cell", ["hexahedron", "triangle6"])
def test_stress_and_tangent_are_derivatives_of_the_energy(cell: str) -> None:
    check_hyperelastic(Hyperfoam((1.0, 0.3), (2.0, -3.0), (0.3, 0.1), 1e-5), cell)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (((1.0,), (0.0,), (0.1,)), "exponents must not be zero"),
        (((1.0,), (2.0,), (0.5,)), "poisson_ratios must lie between 0 and 0.5"),
        (((-1.0,), (2.0,), (0.1,)), "the shear modulus Σ μ_p and the bulk modulus must be positive, got -1"),
        (((1.0, 2.0), (2.0,), (0.1,)), "exponents must be 2 finite numbers"),
    ],
)
def test_foams_without_meaning_are_refused(given: Any, message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        Hyperfoam(*given)
