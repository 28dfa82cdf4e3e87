"""Materials, supports, loads and contact pairs refuse what makes no sense, and say what would."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from fenics_contact import (
    Body,
    BodyForce,
    ContactPair,
    Coulomb,
    RigidPlane,
    Scene,
    Support,
    Surface,
    TotalForce,
    Traction,
    Tresca,
)
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import block
from fenics_contact.materials import IsotropicElasticity, Material, NeoHooke, rigid_body_modes


@pytest.mark.parametrize("modulus", [-2.1e5, 0.0, math.nan, math.inf])
def test_a_young_modulus_must_be_positive(modulus: float) -> None:
    message = r"young_modulus must be a positive number, got .*: give E in force per area"
    with pytest.raises(InvalidInputError, match=message):
        IsotropicElasticity(modulus, 0.3)


@pytest.mark.parametrize("ratio", [0.5, 0.7, -1.0, math.nan, math.inf])
def test_a_poisson_ratio_must_leave_the_energy_positive(ratio: float) -> None:
    message = r"poisson_ratio must lie between -1 and 0.5 \(excluded\), got .*: use 0.3 for steel"
    with pytest.raises(InvalidInputError, match=message):
        IsotropicElasticity(2.1e5, ratio)


def test_a_friction_coefficient_must_not_be_negative() -> None:
    for value in (-0.3, math.nan, math.inf):
        with pytest.raises(InvalidInputError, match=r"friction_coefficient must be zero or positive, got"):
            Coulomb(value)
    assert Coulomb(0.0).friction_coefficient == 0.0


@pytest.mark.parametrize("value", [-1.0, math.nan, math.inf])
def test_a_slip_bound_must_not_be_negative(value: float) -> None:
    with pytest.raises(InvalidInputError, match=r"Tresca.traction must be zero or positive, got .*: give"):
        Tresca(value)


@pytest.mark.parametrize(
    "value", [(), (0.0,), (None, None, None), (0.0, 0.0, math.nan), (math.inf, None, None), (0, 0, 0, 0)]
)
def test_a_support_must_prescribe_something(value: Any) -> None:
    message = r"Support.value must hold three entries \(two for a plane body\), .* got .*: use"
    with pytest.raises(InvalidInputError, match=message):
        Support("body", "side", value)


@pytest.mark.parametrize("value", [1.0, (0.0, math.nan, 0.0), (0.0, 0.0, -math.inf), (1, 2, 3, 4), "xyz"])
@pytest.mark.parametrize(
    ("name", "make"),
    [
        ("Traction", lambda value: Traction("body", "side", value)),
        ("TotalForce", lambda value: TotalForce("body", "side", value)),
        ("BodyForce", lambda value: BodyForce("body", value)),
    ],
)
def test_a_load_must_be_a_vector(name: str, make: Callable[[Any], Any], value: Any) -> None:
    message = rf"{name}.value must be three finite numbers \(two for a plane body\), got .*: give one for x"
    with pytest.raises(InvalidInputError, match=message):
        make(value)


@pytest.mark.parametrize(
    ("point", "normal"),
    [
        ((0, 0, 0), (0, 0, 0)),
        ((0, 0, 0), (0, math.nan, 1)),
        ((math.inf, 0, 0), (0, 0, 1)),
        ((0, 0, 0), (0, 1)),
        ((0, 0), (0, 0, 1)),
    ],
)
def test_a_plane_needs_a_direction(point: Any, normal: Any) -> None:
    message = (
        r"RigidPlane(\.normal| must be placed by 2 or 3 finite numbers).* got .*: (for a floor|give the)"
    )
    with pytest.raises(InvalidInputError, match=message):
        RigidPlane(point, normal)


def test_the_normal_of_a_plane_gets_unit_length() -> None:
    assert RigidPlane((1, 2, 3), (0, 3, 4)).normal == pytest.approx((0, 0.6, 0.8))


def test_only_a_body_that_may_deform_much_can_touch_itself() -> None:
    mesh = block((0, 0, 0), (1, 1, 1), (2, 2, 2))
    pair = ContactPair(Surface("seal", "z0"), Surface("seal", "z1"))
    assert pair.within_body
    own = replace(pair, master=pair.slave)
    Scene({"seal": Body(mesh, NeoHooke(1.0, 0.3))}, contacts=[pair, own])
    message = "contact of body 'seal' with itself needs a material for large deformations"
    for material, wrong in (
        (IsotropicElasticity(1.0, 0.3), pair),
        (IsotropicElasticity(1.0, 0.3), own),
        (NeoHooke(1.0, 0.3), replace(pair, discretisation="mortar")),
        (NeoHooke(1.0, 0.3), replace(pair, gap=0.1)),
    ):
        with pytest.raises(InvalidInputError, match=message):
            Scene({"seal": Body(mesh, material)}, contacts=[wrong])


def test_elasticity_hands_out_the_parameters_of_lame() -> None:
    lame, shear = IsotropicElasticity(210.0, 0.25).parameters
    assert lame == pytest.approx(84.0)
    assert shear == pytest.approx(84.0)
    assert isinstance(IsotropicElasticity(210.0, 0.25), Material)


def test_rigid_body_modes_are_six_and_move_no_point_nearer_to_another() -> None:
    points = np.random.default_rng(1).uniform(-1e3, 1e3, (9, 3)) + 1e5
    modes = rigid_body_modes(points)
    assert modes.shape == (9, 3, 6)
    size = np.linalg.svd(modes.reshape(27, 6), compute_uv=False)
    assert size.min() > 0.1 * size.max(), "translations and rotations should be of one size"
    apart = points[:, None] - points[None]
    stretch = np.einsum("ijd,ijdm->ijm", apart, modes[:, None] - modes[None])
    assert np.abs(stretch).max() < 1e-9 * np.abs(apart).max()
