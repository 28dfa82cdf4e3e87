"""Adjoints, the terms they consist of, and contrasts of stiffness."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    ContactProblem,
    Coulomb,
    RigidPlane,
    Scene,
    ShapeProblem,
    Support,
    Surface,
    SurfaceDesign,
    Traction,
)
from fenics_contact.design import (
    Adjoint,
    Objective,
    Partials,
    PressureNonuniformity,
    PressureNorm,
    StrainEnergy,
    WeakChoice,
)
from fenics_contact.design.adjoint import LinearisedFace, linearise_face, solve_adjoint
from fenics_contact.errors import ConvergenceError
from fenics_contact.gallery import rectangle
from fenics_contact.materials import IsotropicElasticity, Material, NeoHooke, PlaneStrain
from tests.design import moved_blocks as blocks
from tests.design.aims import aims
from tests.design.blocks import block_on_block, block_on_floor, problem
from tests.design.chains import line
from tests.design.left_out import (
    TERMS,
    without_areas,
    without_growth_of_friction,
    without_own,
    without_stiffness,
    without_turning_of_friction,
    without_weight,
)
from tests.design.objectives import objectives
from tests.design.quotients import Line, Patch, miss_without


@cache
def solved(regime: str, objective: str) -> tuple[Partials, LinearisedFace, Adjoint]:
    here = line(regime)
    state = here.state()
    partials = objectives("link1")[objective].partials(state, here.problem.geometry.forms)
    linearised = linearise_face(state, WeakChoice.RELEASED)
    return partials, linearised, solve_adjoint(state, partials, linearised)


@pytest.mark.parametrize("objective", ["energy", "stress", "friction forces"])
@pytest.mark.parametrize("regime", ["slip", "mixed", "stick"])
def test_bodies_are_in_equilibrium_with_the_adjoint_multiplier(regime: str, objective: str) -> None:
    partials, _, adjoint = solved(regime, objective)
    system = line(regime).state().system
    start, internal = 0, np.zeros_like(adjoint.displacement)
    for subdomain in system.torn.subdomains:
        part = slice(start, start + subdomain.mesh.size)
        internal[part] = subdomain.stiffness @ adjoint.displacement[part]
        start = part.stop
    force = system.force(adjoint.multiplier)
    assert np.abs(force).max() > 0.0
    rest = internal + force - partials.by_displacement
    assert np.abs(rest).max() < 1e-6 * max(np.abs(force).max(), np.abs(partials.by_displacement).max())


@pytest.mark.parametrize("objective", ["stress", "friction forces"])
@pytest.mark.parametrize("regime", ["slip", "mixed", "stick"])
def test_moving_directions_see_the_derivative_by_the_multiplier(regime: str, objective: str) -> None:
    partials, linearised, adjoint = solved(regime, objective)
    system = line(regime).state().system
    # Z_s has orthonormal columns: z comes back from ζ = Z_s z.
    z = linearised.tested.T @ adjoint.multiplier
    assert linearised.tested @ z == pytest.approx(adjoint.multiplier, abs=1e-9 * np.abs(z).max())
    left = linearised.moving.T @ system.jump(adjoint.displacement) - linearised.face.curvature * z
    right = linearised.moving.T @ partials.by_multiplier
    size = max(np.abs(linearised.face.curvature * z).max(), np.abs(system.jump(adjoint.displacement)).max())
    assert size > 0.0
    assert np.abs(left - right).max() < 1e-6 * max(size, np.abs(right).max())


def test_the_two_bases_differ_where_friction_grows_with_the_normal_force() -> None:
    for regime, friction in (("slip", 0.1), ("mixed", 0.3)):
        _, linearised, _ = solved(regime, "stress")
        growth = (linearised.moving - linearised.tested).tocoo()
        lengths = np.sqrt(np.bincount(growth.col, growth.data**2))
        assert lengths[lengths > 0] == pytest.approx(
            np.full(np.count_nonzero(linearised.face.slip), friction)
        )
    _, linearised, _ = solved("stick", "stress")
    assert abs(linearised.moving - linearised.tested).max() == 0.0


def test_without_slip_the_adjoint_of_the_energy_is_known() -> None:
    _, _, adjoint = solved("stick", "energy")
    multiplier = line("stick").state().solution.multiplier
    assert adjoint.multiplier == pytest.approx(-multiplier, abs=1e-6 * np.abs(multiplier).max())
    assert adjoint.iterations < 10


def test_too_few_iterations_are_an_error() -> None:
    partials, linearised, _ = solved("mixed", "stress")
    with pytest.raises(ConvergenceError, match=r"after 3 iterations .*: raise max_iterations or loosen"):
        solve_adjoint(line("mixed").state(), partials, linearised, max_iterations=3)


SLIDING = {"energy": True, "stress": True, "normal forces": True, "displacement": False}


@pytest.mark.parametrize("judge", SLIDING)
def test_where_a_body_lies_that_can_slide_must_not_matter(judge: str) -> None:
    """Along the floor nothing holds or pushes the block: it stays, and only some objectives do not care."""
    sliding = problem(block_on_floor(None, load=(0.0, 0.0, -2.0)))
    objective, design = objectives("block")[judge], 0.005 * np.random.default_rng(1).standard_normal(6)
    assert len(sliding.state_of(design).unheld) == 3
    if not SLIDING[judge]:
        with pytest.raises(ConvergenceError, match=r"must not change along free motions"):
            sliding.evaluate_by(objective, design)
        return
    direction, step = np.random.default_rng(2).standard_normal(6), 1e-5
    ahead, behind = (sliding.value_by(objective, design + sign * step * direction) for sign in (1, -1))
    slope = sliding.evaluate_by(objective, design).gradient @ direction
    assert slope == pytest.approx((ahead - behind) / (2 * step), rel=1e-6)


def test_a_body_that_friction_alone_holds_has_an_adjoint() -> None:
    held = problem(block_on_floor(Coulomb(0.3), load=(0.0, 0.0, -2.0)))
    assert np.abs(held.evaluate(np.zeros(6)).gradient).max() > 0.1


@pytest.mark.parametrize("objective", ["energy", "stress"])
def test_discs_that_are_next_to_rigid_across_their_force_cost_little(objective: str) -> None:
    """Beside a switch a disc has next to no radius, and the curvature of its circle is next to infinite."""
    partials, linearised, usual = solved("slip", objective)
    overshoot = np.where(linearised.face.slip, 9e5, 1.0)
    rigid = replace(linearised, face=replace(linearised.face, overshoot=overshoot))
    found = solve_adjoint(line("slip").state(), partials, rigid, tolerance=1e-11)
    assert found.iterations < 4 * usual.iterations
    across = np.abs(rigid.face.restrict(found.multiplier)[rigid.face.curvature > 0.0])
    assert 0.0 < across.max() < 1e-3 * np.abs(found.multiplier).max()


STEEL = PlaneStrain(1000.0, 0.3)


def pad_on_floor(law: Coulomb | None, material: Material) -> Scene:
    """A pad with an even pressure under it."""
    pad = rectangle((0.0, 0.0), (2.0, 1.0), (4, 2))
    supports, loads = [Support("pad", "x0", (0.0, None))], [Traction("pad", "y1", (0.0, -0.2))]
    pair = ContactPair(Surface("pad", "y0"), RigidPlane((0.0, 0.0), (0.0, 1.0)), law)
    return Scene({"pad": Body(pad, material)}, supports, loads, [pair])


def two_pads() -> Scene:
    """A narrow pad on a wide one, whose meshes do not match, without friction."""
    bodies = {"pad": Body(rectangle((0.4, 1.0), (1.6, 2.0), (9, 4)), STEEL)}
    bodies["lower"] = Body(rectangle((0.0, 0.0), (2.0, 1.0), (10, 4)), STEEL)
    supports = [Support("pad", "x0", (0.0, None)), Support("lower", "y0")]
    pair = ContactPair(Surface("pad", "y0"), Surface("lower", "y1"), discretisation="node")
    return Scene(bodies, supports, [Traction("pad", "y1", (0.0, -10.0))], [pair])


def lower_side(scene: Scene, objective: Objective) -> ShapeProblem:
    contact = ContactProblem(scene, MPI.COMM_SELF, tolerance=1e-8)
    return ShapeProblem(contact, SurfaceDesign("pad", "y0", net=4), objective)


EVEN: dict[str, tuple[Material, Coulomb | None]] = {
    "frictionless": (PlaneStrain(100.0, 0.0), None),
    "friction": (PlaneStrain(100.0, 0.0), Coulomb(0.3)),
}


@pytest.mark.parametrize("p", [2.0, 8.0])
@pytest.mark.parametrize("case", EVEN)
def test_a_norm_of_an_even_pressure_is_stationary(case: str, p: float) -> None:
    material, law = EVEN[case]
    value, gradient = lower_side(pad_on_floor(law, material), PressureNorm(0, p))(np.zeros(4))
    assert value == pytest.approx(0.2, rel=1e-6)
    assert np.abs(gradient).max() < 1e-6 * value


def test_the_unevenness_of_an_even_pressure_under_rubber_is_stationary() -> None:
    """Its norm is not: the true pressure falls where a design widens the deformed surface."""
    scene = pad_on_floor(None, NeoHooke(1.0, 0.3))
    value, gradient = lower_side(scene, PressureNonuniformity(0))(np.zeros(4))
    assert abs(value) < 1e-9
    assert np.abs(gradient).max() < 1e-6


def test_the_elastic_energy_of_bodies_pressed_together_has_a_gradient() -> None:
    """Without friction the contact forces do no work: what the adjoint is solved for is rounding."""
    scene = two_pads()
    problem = lower_side(scene, StrainEnergy())
    design, way, step = np.full(4, 1e-3), np.array([0.5, -1.0, 0.7, 0.3]), 1e-4
    ahead, behind = (problem.value_of(design + sign * step * way) for sign in (1.0, -1.0))
    _, gradient = problem(design)
    assert gradient @ way == pytest.approx((ahead - behind) / (2.0 * step), rel=1e-3)


# Every term of the derivative counts: leave one out, and the adjoint misses the difference quotient.
OBJECTIVES, AIMS = objectives("link1"), aims("link1", "contact")


def slanted(regime: str) -> Line:
    """Another way, along which all terms show in the energy."""
    here = line(regime)
    return replace(here, direction=np.random.default_rng(54).standard_normal(here.alpha.size))


@pytest.mark.parametrize("term", TERMS)
@pytest.mark.parametrize("objective", ["stress", "normal forces"])
def test_every_term_of_a_chain_with_sticking_and_slipping_points_counts(objective: str, term: str) -> None:
    here, judge = line("mixed"), OBJECTIVES[objective]
    assert here.miss(judge) < 1e-5
    assert miss_without(TERMS[term], here, judge) > 1e-3


@pytest.mark.parametrize(
    "term", ["gap", "slopes", "normals", "weights", "growth of friction", "turning of friction"]
)
def test_the_energy_alone_shows_most_of_them(term: str) -> None:
    here, judge = slanted("mixed"), OBJECTIVES["energy"]
    assert here.miss(judge) < 1e-5
    assert miss_without(TERMS[term], here, judge) > 1e-3


@pytest.mark.parametrize("term", [without_stiffness, without_own("by_shape")])
def test_the_shape_derivatives_of_integrals_count(term: Callable[[Patch], None]) -> None:
    assert miss_without(term, line("mixed"), OBJECTIVES["stress"]) > 1e-3


@pytest.mark.parametrize(
    ("derivative", "aim"),
    [
        ("by_area", "largest pressure"),
        ("by_area", "pressure norm"),
        ("by_area", "unevenness"),
        ("by_area", "area"),
        ("by_jump", "friction work"),
        ("by_shape", "largest stress"),
        ("by_shape", "movement"),
        ("by_shape", "strain energy"),
    ],
)
def test_derivatives_of_objectives_by_the_geometry_count(derivative: str, aim: str) -> None:
    here, judge = line("mixed"), AIMS[aim]
    assert here.miss(judge) < 1e-5
    assert miss_without(without_own(derivative), here, judge) > 1e-3


def test_where_every_point_slips_friction_must_grow_with_its_normal_force() -> None:
    for objective in ("energy", "stress", "normal forces", "friction forces"):
        assert miss_without(without_growth_of_friction, line("slip"), OBJECTIVES[objective]) > 1e-3


def test_where_no_point_slips_friction_neither_grows_nor_turns() -> None:
    here, judge = line("stick"), OBJECTIVES["stress"]
    for term in (without_growth_of_friction, without_turning_of_friction):
        assert miss_without(term, here, judge) < 1e-5


def test_the_slip_bound_of_tresca_friction_changes_with_the_nodal_area() -> None:
    here = slanted("Tresca")
    for objective in ("energy", "stress", "normal forces", "friction forces"):
        assert here.miss(OBJECTIVES[objective]) < 1e-5
        assert miss_without(without_areas, here, OBJECTIVES[objective]) > 1e-3


def test_the_weight_of_a_body_changes_with_its_shape() -> None:
    here, judges = blocks.line("weight alone"), blocks.OBJECTIVES["weight alone"]
    for objective in ("energy", "normal forces"):
        assert here.miss(judges[objective]) < 1e-5
        assert miss_without(without_weight, here, judges[objective]) > 1e-3


def test_nothing_stays_patched() -> None:
    assert miss_without(lambda patch: None, line("mixed"), OBJECTIVES["energy"]) < 1e-5


# A design between bodies of very different stiffness: right derivatives at an even cost.
LOAD = (0.6, 0.12, -2.0)


@pytest.mark.parametrize("stiffness", [1e3, 1e5])
def test_subgradients_are_right_and_take_few_products_on_a_stiff_foundation(stiffness: float) -> None:
    scene = block_on_block(Coulomb(0.38), load=LOAD)
    even = problem(scene)
    bodies = {
        **scene.bodies,
        "lower": replace(scene.bodies["lower"], material=IsotropicElasticity(stiffness, 0.3)),
    }
    uneven = problem(replace(scene, bodies=bodies))
    alpha = 0.005 * np.random.default_rng(1).standard_normal(uneven.size)
    direction, h = np.random.default_rng(2).standard_normal(uneven.size), 1e-5
    point = uneven.evaluate(alpha)
    assert point.state.dual.problem.scaling
    ahead, behind = (uneven.value_of(alpha + sign * h * direction) for sign in (1, -1))
    slope = (ahead - behind) / (2 * h)
    assert abs(slope) > 1e-3
    assert point.gradient @ direction == pytest.approx(slope, rel=1e-5)
    assert point.adjoint_iterations < 1.5 * even.evaluate(alpha).adjoint_iterations + 5
