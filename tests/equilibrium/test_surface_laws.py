"""Laws of surfaces against closed forms: friction that pressure changes or a shear limit cuts off."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from fenics_contact import Coulomb, FrictionCurve, FrictionTable, Status
from fenics_contact.errors import InvalidInputError
from fenics_contact.qp.cones import CoulombLaw, Strengths
from fenics_contact.qp.layout import ContactLayout
from tests.equilibrium.law_cases import AREA, LAWS, TABLE, Saturating, dragged_block, solved


@pytest.mark.parametrize("pressure", [1.0, 6.0, 20.0])
@pytest.mark.parametrize("name", LAWS)
def test_a_dragged_block_is_held_by_the_strength_at_its_mean_pressure(name: str, pressure: float) -> None:
    # Bending moves pressure to the front: where the law is curved, the sum of the points' strengths counts.
    law, strength = LAWS[name]
    contact = solved(dragged_block(law, pressure)).contact
    assert contact.count(Status.SLIP) == contact.points.count
    friction = np.linalg.norm(contact.friction_force, axis=1)
    expected = [a * strength(p) for a, p in zip(contact.area, contact.pressure, strict=True)]
    np.testing.assert_allclose(friction, expected, rtol=1e-6)
    assert contact.normal_force.sum() == pytest.approx(pressure * AREA, rel=1e-6)


def test_a_limit_that_is_never_reached_and_a_constant_table_change_nothing() -> None:
    plain = solved(dragged_block(Coulomb(0.3), 6.0, shift=0.004))
    assert 0 < plain.contact.count(Status.SLIP)
    for law in (Coulomb(0.3, shear_limit=1e3), Coulomb(FrictionTable((0.0, 9.0), (0.3, 0.3)))):
        other = solved(dragged_block(law, 6.0, shift=0.004))
        np.testing.assert_allclose(other.contact.friction_force, plain.contact.friction_force, atol=1e-7)
        assert other.solution.products <= plain.solution.products + 1


def test_a_limit_by_place_acts_where_it_is() -> None:
    law = Coulomb(0.4, shear_limit=lambda x: np.where(x[:, 0] < 1.2, 0.7, 2.0))
    state = solved(dragged_block(law, 20.0))
    contact = state.contact
    traction = np.linalg.norm(contact.traction, axis=1)
    place = state.scene.points[contact.points.slave, 0]
    np.testing.assert_allclose(traction, np.where(place < 1.2, 0.7, 2.0), rtol=1e-6)


@pytest.mark.parametrize(
    "curve", [FrictionTable((0.0, 10.0), (0.2, 0.3)), FrictionTable((5.0, 20.0), (0.5, 0.3)), Saturating()]
)
def test_growth_is_the_derivative_of_the_strength(curve: FrictionCurve) -> None:
    p = np.linspace(0.3, 30.0, 57)
    slope = (curve.strength(p + 1e-6) - curve.strength(p - 1e-6)) / 2e-6
    np.testing.assert_allclose(curve.growth(p), slope, atol=1e-8)


def test_admitted_forces_are_the_nearest_of_a_cone_with_a_limit() -> None:
    rng = np.random.default_rng(0)
    layout = ContactLayout.build(3, normal=[0], tangential=[[1, 2]])
    strengths = Strengths(np.array([0.5]), np.array([1.0]), np.ones(1), np.array([-1]))
    law = CoulombLaw(layout, strengths, 0.2)
    normal, radius = np.meshgrid(np.linspace(0.0, 6.0, 1201), np.linspace(0.0, 1.2, 241))
    inside = radius <= 0.2 + np.minimum(0.5 * normal, 1.0)
    for x in rng.uniform(-3.0, 5.0, (200, 3)):
        found, length = law.admit(x), float(np.hypot(x[1], x[2]))
        best = np.min(np.hypot(normal[inside] - x[0], radius[inside] - length))
        assert np.linalg.norm(found - x) == pytest.approx(best, abs=6e-3)
        assert law.feasible(found).violation(found) < 1e-12


def test_bounds_of_scaled_multipliers_are_scaled() -> None:
    strengths = Strengths(
        np.array([0.4, 0.4]), np.array([3.0, np.inf]), np.array([0.5, 2.0]), np.array([-1, 0]), (TABLE,)
    )
    normal, factor = np.array([9.0, 8.0]), np.array([3.0, 0.2])
    scaled = strengths.scaled(factor)
    np.testing.assert_allclose(scaled.bound(normal / factor) * factor, strengths.bound(normal))
    np.testing.assert_allclose(scaled.growth(normal / factor), strengths.growth(normal))


def test_laws_that_fall_are_refused() -> None:
    with pytest.raises(
        InvalidInputError,
        match=r"of a FrictionTable must not fall, got μ = 0.4 at p = 1 and 0.1 at 2: spread",
    ):
        FrictionTable((0.0, 1.0, 2.0), (0.4, 0.4, 0.1))
    with pytest.raises(InvalidInputError, match="two or more pressures of at least zero in ascending order"):
        FrictionTable((1.0, 0.0), (0.1, 0.2))

    class Falling(Saturating):
        def strength(self, pressure: np.ndarray) -> np.ndarray:
            return pressure * np.exp(-pressure)

    with pytest.raises(
        InvalidInputError, match="Falling must be zero without pressure and must not fall, got"
    ):
        Coulomb(Falling())

    class Steep(Saturating):
        largest_coefficient = 0.2

    with pytest.raises(
        InvalidInputError, match=r"largest_coefficient of Steep must be at least .* got 0.2 but 0.4"
    ):
        Coulomb(Steep())

    class Shapeless(Saturating):
        def growth(self, pressure: np.ndarray) -> np.ndarray:
            return np.ones(1)

    with pytest.raises(
        InvalidInputError, match="strength and growth of Shapeless must return a finite number"
    ):
        Coulomb(Shapeless())
    with pytest.raises(InvalidInputError, match="shear_limit must be positive and finite, got 0"):
        Coulomb(0.3, shear_limit=0.0)


def test_the_plan_and_the_effects_name_the_law() -> None:
    scene = dragged_block(LAWS["limit"][0], 1.0)
    assert [effect.name.value for effect in scene.effects()][-1] == "friction that pressure limits or changes"
    plain = replace(scene, contacts=[replace(scene.contacts[0], friction=Coulomb(0.4))])
    assert scene.plan().multipliers == plain.plan().multipliers
    assert [effect.name.value for effect in plain.effects()][-1] == "Coulomb friction"


ON_RANKS = """
from mpi4py import MPI
from tests.equilibrium.law_cases import LAWS, dragged_block
from fenics_contact import solve_scene

scene = dragged_block(LAWS["table and limit"][0], 6.0, shift=0.004)
state = solve_scene(scene, MPI.COMM_WORLD, tolerance=1e-9)
if MPI.COMM_WORLD.rank == 0:
    print(*state.contact.friction_force.sum(axis=0), *state.contact.slip_bound)
"""


def test_laws_are_the_same_on_two_ranks(mpirun: Callable[..., str]) -> None:
    one = solved(dragged_block(LAWS["table and limit"][0], 6.0, shift=0.004)).contact
    found = np.array(mpirun(ON_RANKS, 2).split(), dtype=float)
    np.testing.assert_allclose(found, [*one.friction_force.sum(axis=0), *one.slip_bound], rtol=1e-6)
