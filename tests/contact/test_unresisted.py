"""Nonlinear bodies that something does not hold are named with their motion before Newton's method begins."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    Coulomb,
    RigidPlane,
    RigidSurface,
    Scene,
    Support,
    Surface,
    TotalForce,
    solve_scene,
)
from fenics_contact._fem.mechanics import HyperelasticMechanics
from fenics_contact._large_deformations.newton import NotHeldError
from fenics_contact._scene.pairs import Friction
from fenics_contact.errors import ConvergenceError, InfeasibleError, InvalidInputError, LoadStepError
from fenics_contact.gallery import block, half_disc, rectangle
from fenics_contact.materials import J2Plasticity, Material, NeoHooke

RUBBER = NeoHooke(3.0, 0.45)
FLAT = RigidPlane((0.0, 0.0), (0.0, 1.0))


@pytest.fixture
def no_newton(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let Newton's method fail at once."""

    def begun(*arguments: object, **options: object) -> None:
        raise AssertionError("Newton's method has begun")

    monkeypatch.setattr("fenics_contact.TangentNewton.solve", begun)


def pressed_disc(*supports: Support, friction: Friction = None) -> Scene:
    disc = Body(half_disc(5.0, 4), RUBBER)
    pair = ContactPair(Surface("roll", "contact"), FLAT, friction)
    return Scene({"roll": disc}, supports, contacts=[pair])


def cube(material: Material = RUBBER, **given: object) -> Scene:
    body = Body(block((0, 0, 0), (1, 1, 1), (2, 2, 2)), material)
    return Scene({"cube": body}, **given)  # type: ignore[arg-type]


def test_a_forgotten_plane_of_symmetry_is_named_before_newtons_method(no_newton: None) -> None:
    with pytest.raises(InfeasibleError, match=r"nothing resists body 'roll': translation \(1, 0\): support"):
        solve_scene(pressed_disc(Support("roll", "top", (None, -0.4))), MPI.COMM_SELF)


def test_it_is_named_too_where_a_force_presses(no_newton: None) -> None:
    scene = pressed_disc()
    pushed = Scene(scene.bodies, [], [TotalForce("roll", "top", (0.0, -1.0))], scene.contacts)
    with pytest.raises(InfeasibleError, match=r"nothing resists body 'roll': translation \(1, 0\)"):
        solve_scene(pushed, MPI.COMM_SELF)


@pytest.mark.parametrize("material", [RUBBER, J2Plasticity(3.0, 0.3, 0.1, 0.1)], ids=["rubber", "metal"])
def test_every_motion_of_a_body_between_rollers_is_named(material: Material, no_newton: None) -> None:
    rollers = [Support("cube", side, (None, None, z)) for side, z in (("z0", 0.0), ("z1", -0.1))]
    with pytest.raises(InfeasibleError) as caught:
        solve_scene(cube(material, supports=rollers), MPI.COMM_SELF)
    for motion in ("translation (1, 0, 0)", "translation (0, 1, 0)", "rotation (0, 0, 1)"):
        assert f"body 'cube': {motion}" in str(caught.value)


def test_friction_and_supports_hold_what_is_pressed() -> None:
    rubbing = solve_scene(
        pressed_disc(Support("roll", "top", (None, -0.1)), friction=Coulomb(0.5)), MPI.COMM_SELF
    )
    guided = solve_scene(
        pressed_disc(Support("roll", "top", (None, -0.1)), Support("roll", "x0", (0.0, None))), MPI.COMM_SELF
    )
    assert rubbing.contact.normal_force.sum() > 0.0
    assert guided.contact.normal_force.sum() > 0.0


def test_a_wall_that_is_met_later_holds() -> None:
    wall = RigidPlane((1.05, 0.0, 0.0), (-1.0, 0.0, 0.0))
    guides = [Support("cube", "z0", (None, None, 0.0)), Support("cube", "y0", (None, 0.0, None))]
    pair = ContactPair(Surface("cube", "x1"), wall)
    pushed = cube(supports=guides, loads=[TotalForce("cube", "x0", (0.01, 0.0, 0.0))], contacts=[pair])
    assert solve_scene(pushed, MPI.COMM_SELF).contact.normal_force.sum() == pytest.approx(0.01, rel=1e-6)


def two_squares(gap: float) -> Scene:
    """A square that is moved towards one that nothing but the floor holds, without friction."""
    low, high = rectangle((0, 0), (1, 1), (2, 2)), rectangle((0.2, 1 + gap), (0.8, 1.5 + gap), (2, 2))
    pair = ContactPair(Surface("high", "y0"), Surface("low", "y1"), discretisation="node")
    floor = ContactPair(Surface("low", "y0"), FLAT)
    return Scene(
        {"low": Body(low, RUBBER), "high": Body(high, RUBBER)},
        [Support("high", "y1", (0.0, -0.1))],
        contacts=[pair, floor],
    )


def test_a_body_at_which_nothing_happens_may_wait() -> None:
    state = solve_scene(two_squares(0.2), MPI.COMM_SELF)
    np.testing.assert_allclose(state.gather_displacement("high"), [[0.0, -0.1]] * 9, atol=1e-9)


def test_a_body_that_another_one_meets_is_named_once_newtons_method_finds_it_loose(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    tried = []

    def loose(*arguments: object, **options: object) -> None:
        tried.append(arguments)
        raise NotHeldError("nothing holds some body")

    monkeypatch.setattr("fenics_contact.TangentNewton.solve", loose)
    with pytest.raises(InfeasibleError, match=r"nothing resists body 'low': translation \(1, 0\)") as caught:
        solve_scene(two_squares(0.05), MPI.COMM_SELF)
    assert isinstance(caught.value.__cause__, NotHeldError)
    assert len(tried) == 1


def test_a_load_step_that_ends_points_at_flat_sides_on_which_nothing_acts(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def ends(*arguments: object, **options: object) -> None:
        raise ConvergenceError("no way on")

    monkeypatch.setattr("fenics_contact.TangentNewton.solve", ends)
    top, sides = Support("roll", "top", (0.0, -1.0)), Support("roll", "x0", (0.0, None))
    with pytest.raises(LoadStepError, match=r"plane of symmetry .* see surface 'x0' of body 'roll', on"):
        solve_scene(pressed_disc(top), MPI.COMM_SELF)
    with pytest.raises(LoadStepError) as caught:
        solve_scene(pressed_disc(top, sides), MPI.COMM_SELF)
    assert "symmetry" not in str(caught.value)


def test_a_rigid_surface_that_forces_move_is_refused_with_other_ways() -> None:
    pushed = RigidSurface("cube", "z1", (0.5, 0.5, 1.0), force=(0.0, 0.0, -0.1))
    message = r"surface 'z1' of body 'cube' components are left free.*NeoHooke.*reactions.*TotalForce.*tied"
    with pytest.raises(InvalidInputError, match=message):
        solve_scene(cube(supports=[Support("cube", "z0"), pushed]), MPI.COMM_SELF)


def test_tangents_that_are_not_finite_cut_the_step_and_end_in_words(monkeypatch: pytest.MonkeyPatch) -> None:
    stiffness = HyperelasticMechanics._stiffness

    def broken(self: HyperelasticMechanics, u: np.ndarray, origin: np.ndarray | None) -> sp.csr_matrix:
        return stiffness(self, u, origin) * (np.nan if np.abs(u).max() > 0.05 else 1.0)

    monkeypatch.setattr(HyperelasticMechanics, "_stiffness", broken)
    scene = cube(supports=[Support("cube", "z0"), Support("cube", "z1", (0.0, 0.0, -0.1))])
    message = "followed up to 0.4.* tangents must be finite, got NaN or infinity in body 'cube' at"
    with pytest.raises(LoadStepError, match=message):
        solve_scene(scene, MPI.COMM_SELF)
