"""Deformation plasticity: a bar, and the tangent."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from fenics_contact import check_history_material
from fenics_contact.errors import InvalidInputError
from fenics_contact.materials import RambergOsgood
from tests.scene.material_points import at_rest, deformations, in_tension, tangent_error

E, NU, YIELD, POWER, OFFSET = 1.9e5, 0.34, 900.0, 12.0, 0.45
METAL = RambergOsgood(E, NU, YIELD, POWER, OFFSET)


def test_a_bar_has_the_strain_of_its_stress_in_terms_of_almansi() -> None:
    stretches = np.array([0.001, 0.005, 0.02, 0.1, -0.05])
    nominal, _ = in_tension(METAL, stretches)
    for stretch, force in zip(stretches, nominal, strict=True):
        strain = 0.5 * (1 - (1 + stretch) ** -2)

        def missing(stress: float, strain: float = strain) -> float:
            return float(stress + OFFSET * stress * (abs(stress) / YIELD) ** (POWER - 1) - E * strain)

        stress = brentq(missing, -2000.0, 2000.0, xtol=1e-12)
        plastic = OFFSET * stress / E * (abs(stress) / YIELD) ** (POWER - 1)
        across = (1 - 2 * (-NU * stress / E - 0.5 * plastic)) ** -0.5
        assert force == pytest.approx(stress * across**2, rel=1e-9)


def test_it_unloads_as_it_loads_and_remembers_nothing() -> None:
    nominal, history = in_tension(METAL, np.array([0.004, 0.02, 0.004]))
    assert nominal[0] == pytest.approx(nominal[2], rel=1e-8)
    assert history.shape == (3, 0)


@pytest.mark.parametrize("size", [1e-3, 1e-2, 0.1])
def test_the_tangent_is_that_of_the_stress(size: float) -> None:
    assert tangent_error(METAL, deformations(size), at_rest(METAL, 20), 1e-5 * size) < 1e-6


def test_it_turns_with_the_body_and_is_hookes_law_in_the_small() -> None:
    check_history_material(METAL, 0.05)
    linear = replace(METAL, offset=0.0)
    gradient = 1e-6 * deformations(1.0)
    one, other = (metal.answer(gradient, at_rest(metal, 20), 0.0).stress for metal in (METAL, linear))
    np.testing.assert_allclose(one, other, atol=1e-9 * np.abs(other).max())
    first, shear = E * NU / ((1 + NU) * (1 - 2 * NU)), E / (2 * (1 + NU))
    np.testing.assert_allclose(METAL.moduli[:3, :3], first + 2 * shear * np.eye(3), rtol=1e-12)


@pytest.mark.parametrize("wrong", [{"yield_stress": 0.0}, {"exponent": 0.5}, {"offset": -1.0}])
def test_constants_without_a_unique_stress_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(InvalidInputError, match="yield_stress > 0, exponent >= 1 and offset >= 0 are needed"):
        replace(METAL, **wrong)
