"""The adjoint solves the transposed equations of the linearised state, or says why it does not."""

from __future__ import annotations

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
    PressureNorm,
    PressureUnevenness,
    StrainEnergy,
    WeakChoice,
)
from fenics_contact.design.adjoint import LinearisedFace, linearise_face, solve_adjoint
from fenics_contact.errors import ConvergenceError
from fenics_contact.gallery import rectangle
from fenics_contact.materials import Material, NeoHooke, PlaneStrain
from tests.shape.blocks import block_on_floor, problem
from tests.shape.chains import line
from tests.shape.objectives import objectives


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
        with pytest.raises(ConvergenceError, match=r"changes along a rigid motion that meets no resistance"):
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
    value, gradient = lower_side(scene, PressureUnevenness(0))(np.zeros(4))
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
