"""At default tolerances gradients are right whatever the units, also those of objectives of small value."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
import pytest
import ufl
from mpi4py import MPI

from fenics_contact import (
    Body,
    BodyForce,
    ContactPair,
    ContactProblem,
    Coulomb,
    Scene,
    ShapeProblem,
    State,
    Status,
    Support,
    Surface,
    SurfaceDesign,
    Traction,
)
from fenics_contact.design import (
    ContactForces,
    DesignPoint,
    FrictionWork,
    LargestPressure,
    LargestStress,
    Movement,
    Objective,
    PressureNonuniformity,
    PressureNorm,
    StrainEnergy,
    TotalPotential,
    VolumeIntegral,
)
from fenics_contact.design.adjoint import linearise_face, solve_adjoint
from fenics_contact.design.adjoint_starts import adjoint_tolerance
from fenics_contact.design.sensitivity import by_nodes
from fenics_contact.gallery import block
from fenics_contact.materials import IsotropicElasticity
from fenics_contact.results import ContactResult
from tests.design.blocks import side
from tests.design.objectives import friction_forces, normal_forces
from tests.scenes import crowned, partitions

Array = np.ndarray

#: Of force and length, in those of the numbers below.
UNITS = {"N and mm": (1.0, 1.0), "N and m": (1.0, 1e-3), "kN and um": (1e-3, 1e3)}
#: Factors of an objective that mean nothing.
FACTORS = (1e6, 1e-2, 1e-4, 1e-6, 1e-8)
STEP, STRICT = 5e-5, 1e-11
DESIGN = 0.01 * np.random.default_rng(1).standard_normal(12)
DIRECTION = np.random.default_rng(6).standard_normal(12)


def share_of_forces(contact: ContactResult) -> tuple[float, Array, Array]:
    """One over the number of points that share the load evenly: a small number without a unit."""
    force, total = contact.normal_force, contact.normal_force.sum()
    value = float(force @ force / total**2)
    return value, 2 * force / total**2 - 2 * value / total, np.zeros_like(contact.friction_force)


def motion(u: Any, x: Any, stress: Any) -> Any:
    return (u[0] - 0.01 * x[1]) ** 2


def squared_stress(u: Any, x: Any, stress: Any) -> Any:
    return ufl.inner(stress, stress)


#: What is judged, and the powers of force and length in its unit.
OBJECTIVES: dict[str, tuple[Objective, int, int]] = {
    "energy": (TotalPotential(), 1, 1),
    "stress": (VolumeIntegral("stress in units", squared_stress, "upper"), 2, -1),
    "displacement": (VolumeIntegral("motion in units", motion, "upper"), 0, 5),
    "normal forces": (ContactForces(normal_forces), 2, 0),
    "friction forces": (ContactForces(friction_forces), 2, 0),
    "share of forces": (ContactForces(share_of_forces), 0, 0),
    "strain energy": (StrainEnergy(), 1, 1),
    "pressure": (LargestPressure(), 1, -2),
    "pressure norm": (PressureNorm(), 1, -2),
    "unevenness": (PressureNonuniformity(), 0, 0),
    "work of friction": (FrictionWork(), 1, 1),
    "largest stress": (LargestStress("upper"), 1, -2),
    "movement": (Movement("upper", "z1", (1.0, 0.0, 0.0)), 0, 1),
}


def scene_in(force: float, length: float) -> Scene:
    """Two blocks of odd meshes that stick, slip and lift off."""
    lower = block((0.0, 0.0, -1.0), (2.0, 1.2, 0.0), (5, 3, 2))
    upper = crowned(block((0.13, 0.07, 0.0), (1.87, 1.09, 0.8), (7, 3, 2)), 0.04)
    lower, upper = (mesh.moved(length * mesh.points) for mesh in (lower, upper))
    stress = force / length**2
    push = (0.6 * stress, 0.12 * stress, -2.0 * stress)
    return Scene(
        {
            "lower": Body(lower, IsotropicElasticity(300.0 * stress, 0.2)),
            "upper": Body(upper, IsotropicElasticity(100.0 * stress, 0.3)),
        },
        [Support("lower", "z0")],
        [Traction("upper", "z1", push), BodyForce("upper", (0.1 * stress / length, 0.0, -stress / length))],
        [ContactPair(Surface("upper", "z0"), Surface("lower", "z1"), Coulomb(0.38), discretisation="node")],
    )


@dataclass
class Measured:
    """A problem as a user poses it, beside one with strict states.

    Attributes:
        units: Of force and length.
        usual: All tolerances are the default ones.
        strict: The same with strict states.
    """

    units: tuple[float, float]
    usual: ShapeProblem
    strict: ShapeProblem

    def __post_init__(self) -> None:
        """Solve the states on both sides of the design once for all objectives."""
        step = self.units[1] * STEP * DIRECTION
        self.sides = {
            kind: [problem.state_of(self.alpha + sign * step) for sign in (1.0, -1.0)]
            for kind, problem in (("usual", self.usual), ("strict", self.strict))
        }

    @property
    def alpha(self) -> Array:
        return self.units[1] * DESIGN

    def unit(self, objective: str) -> float:
        _, of_force, of_length = OBJECTIVES[objective]
        return self.units[0] ** of_force * self.units[1] ** of_length

    def point(self, objective: str) -> DesignPoint:
        self.usual.objective = OBJECTIVES[objective][0]
        return self.usual.evaluate(self.alpha)

    def gradient(self, objective: str) -> Array:
        """The gradient in the units of the numbers above."""
        return np.asarray(self.point(objective).gradient * self.units[1] / self.unit(objective))

    def quotient(self, objective: str, kind: str) -> float:
        judge = OBJECTIVES[objective][0]
        ahead, behind = (judge.value(state, self.usual.geometry.forms) for state in self.sides[kind])
        return (ahead - behind) / (2 * STEP) / self.unit(objective)


def posed(units: str, **more: Any) -> ShapeProblem:
    scene = scene_in(*UNITS[units])
    designs = tuple(
        SurfaceDesign(body, side(scene.bodies[body].mesh, face), (3, 2))
        for body, face in (("upper", "z0"), ("lower", "z1"))
    )
    return ShapeProblem(
        ContactProblem(scene, MPI.COMM_SELF, partitions=partitions(scene), **more), designs, TotalPotential()
    )


@cache
def measured(units: str) -> Measured:
    return Measured(UNITS[units], posed(units), posed(units, tolerance=STRICT))


def apart(found: Array, expected: Array) -> float:
    return float(np.linalg.norm(found - expected) / np.linalg.norm(expected))


@pytest.mark.parametrize("units", UNITS)
def test_the_scene_has_points_of_every_kind_and_default_tolerances(units: str) -> None:
    here = measured(units)
    assert here.usual.contact.solver is None
    contact = here.point("energy").state.contact
    assert all(contact.count(status) > 1 for status in Status)
    for states in here.sides.values():
        assert all(np.array_equal(state.contact.status, contact.status) for state in states)


@pytest.mark.parametrize("objective", OBJECTIVES)
@pytest.mark.parametrize("units", UNITS)
def test_gradients_at_default_tolerances_agree_with_difference_quotients(units: str, objective: str) -> None:
    here = measured(units)
    slope = here.gradient(objective) @ DIRECTION
    assert abs(slope) > 0.1 * np.linalg.norm(here.gradient(objective))
    # Of strict states: the tolerance of the gradient alone is seen.
    stated = 2.0 * adjoint_tolerance(1e-6, here.point(objective).weak)
    assert slope == pytest.approx(here.quotient(objective, "strict"), rel=stated)
    # Of the user's own states, whose tolerance the quotient magnifies.
    assert slope == pytest.approx(here.quotient(objective, "usual"), rel=1e-3)


@pytest.mark.parametrize("objective", OBJECTIVES)
@pytest.mark.parametrize("units", list(UNITS)[1:])
def test_gradients_are_the_same_in_all_units(units: str, objective: str) -> None:
    found, expected = (measured(name).gradient(objective) for name in (units, "N and mm"))
    assert apart(found, expected) < 1e-5


@cache
def one_state() -> State:
    """One for all multiples: another evaluation starts from this one, and ends within a tolerance of it."""
    return measured("N and mm").point("energy").state


@cache
def factored(objective: str, factor: float) -> tuple[Array, int]:
    """Multiplier of the adjoint of a multiple of an objective, divided by it, and the products it takes."""
    here = measured("N and mm").usual
    state = one_state()
    partials = OBJECTIVES[objective][0].partials(state, here.geometry.forms)
    partials = replace(
        partials,
        by_displacement=factor * partials.by_displacement,
        by_multiplier=factor * partials.by_multiplier,
    )
    found = solve_adjoint(state, partials, linearise_face(state, here.choice), tolerance=1e-7)
    return found.multiplier / factor, found.iterations


@pytest.mark.parametrize("factor", FACTORS)
@pytest.mark.parametrize("objective", OBJECTIVES)
def test_the_adjoint_of_a_multiple_is_that_multiple_of_the_adjoint(objective: str, factor: float) -> None:
    (found, products), (expected, as_many) = factored(objective, factor), factored(objective, 1.0)
    assert apart(found, expected) < 1e-10
    assert products == as_many


def test_the_gradient_of_a_small_multiple_is_that_multiple_of_the_gradient() -> None:
    here, objective = measured("N and mm"), "normal forces"
    here.point(objective)  # so that all that follow start from its state, which they keep
    expected = here.gradient(objective)
    for factor in FACTORS:

        def small(contact: ContactResult, factor: float = factor) -> tuple[float, Array, Array]:
            value, by_normal, by_friction = normal_forces(contact)
            return factor * value, factor * by_normal, factor * by_friction

        here.usual.objective = ContactForces(small)
        assert apart(here.usual.evaluate(here.alpha).gradient / factor, expected) < 1e-10


@pytest.mark.parametrize("units", UNITS)
@pytest.mark.parametrize("objective", OBJECTIVES)
def test_the_gradient_at_default_tolerance_is_as_accurate_as_stated(objective: str, units: str) -> None:
    """It costs fewer products than an exact one, and is another one, by less than twice the residual."""
    here, point = measured(units), measured(units).point(objective)
    partials = OBJECTIVES[objective][0].partials(point.state, here.usual.geometry.forms)
    linearised = linearise_face(point.state, here.usual.choice)
    assert point.weak.count == 0
    exact = solve_adjoint(point.state, partials, linearised, tolerance=STRICT)
    assert point.adjoint_iterations < exact.iterations
    at_nodes = by_nodes(point.state, exact, partials, linearised, here.usual.geometry.forms)
    off = apart(point.gradient, here.usual.geometry.pull_back(at_nodes))
    assert 0.0 < off < 2.0 * adjoint_tolerance(point.tolerance, point.weak) == pytest.approx(2e-5)
