"""Slipping points that can slip along one line alone, or touch two surfaces, cost few products."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import Body, ContactPair, ContactProblem, Coulomb, RigidPlane, Scene, Support, Surface
from fenics_contact.gallery import block
from fenics_contact.materials import IsotropicElasticity
from fenics_contact.qp import FaceNewton
from fenics_contact.qp.face import Face
from fenics_contact.results.dual_solve import solve_dual
from fenics_contact.results.linear_state import LinearState
from tests.equilibrium.nested_cases import quarter_on_ball


@pytest.fixture(scope="module")
def quarter() -> LinearState:
    """A quarter of a block on a ball, six of whose tangents lie across planes of symmetry."""
    state = ContactProblem(quarter_on_ball(), MPI.COMM_SELF, tolerance=1e-8).solve()
    assert isinstance(state, LinearState)
    return state


def products_by_friction_along_held_tangents(quarter: LinearState, sizes: Sequence[float]) -> np.ndarray:
    """Return the products from starts with so much of it, relative to the largest force."""
    torn, start = quarter.torn, 0.8 * quarter.solution.multiplier
    held = torn.groups.slips.held(torn.decomposition.fixed)
    rows = torn.numbering.owned_index(torn.tangential_rows.ravel()[held])
    assert len(rows) == 6
    products = []
    for size in sizes:
        start[rows] = size * np.abs(start).max() * np.cos(np.arange(6.0))
        products.append(solve_dual(quarter.dual, FaceNewton(1e-6, max_products=200), start).products)
    return np.array(products)


@pytest.mark.parametrize("size", [1e-16, 1e-12, 1e-9, 1e-6, 1e-3])
def test_friction_along_held_tangents_in_a_start_costs_hardly_a_product(
    quarter: LinearState, size: float
) -> None:
    without, products = products_by_friction_along_held_tangents(quarter, [0.0, size])
    assert 10 < without < 25
    assert products <= without + 10


def test_more_friction_along_held_tangents_costs_less_than_where_its_discs_are_not_preconditioned(
    quarter: LinearState, monkeypatch: pytest.MonkeyPatch
) -> None:
    """How many steps turn that friction into slip depends on rounding: all of them are compared."""
    sizes = [0.0, 1e-6, 1e-3, 1e-2, 3e-2, 1e-1, 2e-1]
    products = products_by_friction_along_held_tangents(quarter, sizes)
    monkeypatch.setattr(Face, "offset_stiffness", property(lambda face: np.zeros(face.n_face)))
    plain = products_by_friction_along_held_tangents(quarter, sizes)
    assert products.sum() < 0.9 * plain.sum()


def test_points_that_slip_on_two_surfaces_at_once_cost_few_products() -> None:
    mesh = block((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), (3, 3, 3), "hexahedron")
    planes = {"z0": (0.0, 0.0, 1.0), "x0": (1.0, 0.0, 0.0)}
    contacts = [
        ContactPair(Surface("block", side), RigidPlane((0.0, 0.0, 0.0), normal), Coulomb(0.1))
        for side, normal in planes.items()
    ]
    pushed = Support("block", "z1", (-0.005, 0.02, -0.02))
    scene = Scene({"block": Body(mesh, IsotropicElasticity(1e3, 0.3))}, [pushed], contacts=contacts)
    state = ContactProblem(scene, MPI.COMM_SELF, tolerance=1e-6).solve()
    points = state.contact.points
    on_both = np.intersect1d(points.slave[points.pair == 0], points.slave[points.pair == 1])
    assert len(on_both) >= 3
    assert (np.linalg.norm(state.contact.slip, axis=1) > 0.0).sum() > 20
    assert state.solution.products <= 60  # 97 where a force that deforms nothing was not preconditioned
