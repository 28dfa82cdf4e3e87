"""Metals in large deformations by Simo's theory of 1988, in true stresses, with a back stress."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

from fenics_contact import Body
from fenics_contact._fem.mechanics import MaterialStep
from fenics_contact.materials import NeoHookeanPlasticity
from tests.materials.deformed import patch_of, skew_patch, smooth_field
from tests.scene.material_points import TURN, at_rest, deformations, in_tension, tangent_error

E, NU, YIELD = 2e5, 0.3, 200.0
G, K = E / 2.6, E / 1.2
CURVE, RISE = ((0.01, 260.0), (0.2, 400.0)), ((0.02, 60.0), (0.3, 120.0))
BOTH = NeoHookeanPlasticity(E, NU, YIELD, hardening_curve=CURVE, kinematic_curve=RISE)
ISOTROPIC = NeoHookeanPlasticity(E, NU, YIELD, 2e3, 0.0, 300.0, 30.0)
EITHER = pytest.mark.parametrize("metal", [BOTH, ISOTROPIC], ids=["both", "isotropic"])


@EITHER
def test_the_tangent_is_that_of_the_stress_when_loading_unloading_and_reversing(
    metal: NeoHookeanPlasticity,
) -> None:
    loaded = deformations(0.1)
    first = metal.answer(loaded, at_rest(metal, 20), 0.0)
    states = {
        "elastic": (1e-4 * deformations(1.0), at_rest(metal, 20), False),
        "plastic": (loaded, at_rest(metal, 20), True),
        "turning": (loaded + deformations(0.1, seed=2), first.history, True),
        "unloaded": (loaded * (1 - 1e-3), first.history, False),
        "reversed": (-loaded, first.history, True),
    }
    for name, (gradient, history, flows) in states.items():
        end = metal.answer(gradient, history, 0.0)
        assert ((end.history[:, 6] > history[:, 6]) == flows).all(), name
        assert tangent_error(metal, gradient, history, 1e-6) < 1e-8, name


@EITHER
def test_a_rotation_of_the_deformed_body_turns_its_stress(metal: NeoHookeanPlasticity) -> None:
    gradient = deformations(0.2)
    first = metal.answer(gradient, at_rest(metal, 20), 0.0)
    turned = TURN @ (np.eye(3) + gradient) - np.eye(3)
    second = metal.answer(turned, first.history, 0.0)
    np.testing.assert_allclose(second.stress, TURN @ first.stress, atol=1e-9 * np.abs(first.stress).max())
    np.testing.assert_allclose(second.history[:, 6], first.history[:, 6], atol=1e-12)


class Bar:
    """The equations of one step in uniaxial stress, of numbers instead of tensors."""

    def __init__(self) -> None:
        self.plastic, self.back, self.alpha = np.ones(2), np.zeros(2), 0.0  # across and along

    def step(self, along: float) -> float:
        """Return the Kirchhoff stress after a stretch, with the lateral one that has no stress."""
        across = brentq(lambda x: self.at(x, along)[0][0], 0.5, 1.5, xtol=1e-15)
        stress, self.plastic, self.back, self.alpha = self.at(across, along)
        return float(stress[1])

    def at(self, across: float, along: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
        C, J = np.array([across, along]) ** 2, across**2 * along
        weight, size = np.array([2.0, 1.0]), J ** (-2 / 3)
        b, q = size * C * self.plastic, size * C * self.back
        mean, pulled = weight @ b / 3, weight @ q / 3
        xi = G * (b - mean) - (q - pulled)
        length, modulus = np.sqrt(weight @ xi**2), G * mean - pulled
        (x, y), (u, v) = np.array([(0.0, YIELD), *CURVE]).T, np.array([(0.0, 0.0), *RISE]).T
        root = np.sqrt(2 / 3)

        def rise(gamma: float) -> float:
            return float(np.interp(self.alpha + root * gamma, u, v) - np.interp(self.alpha, u, v))

        def excess(gamma: float) -> float:
            yields = np.interp(self.alpha + root * gamma, x, y) + modulus / G * rise(gamma)
            return float(length - 2 * modulus * gamma - root * J * yields)

        gamma = brentq(excess, 0.0, 1.0, xtol=1e-16) if excess(0.0) > 0 else 0.0
        n = xi / length
        stress = K / 2 * (J**2 - 1) + G * (b - mean) - 2 * modulus * gamma * n
        plastic = self.plastic - 2 * modulus * gamma / G / size * n / C
        back = self.back + root * J * modulus / G * rise(gamma) / size * n / C
        return stress, plastic, back, self.alpha + root * gamma


def test_a_bar_pulled_and_pressed_follows_the_equations_of_the_step() -> None:
    stretches = np.array([5e-4, 0.02, 0.05, 0.048, -0.01, -0.06, 0.2])
    nominal, history = in_tension(BOTH, stretches)
    bar = Bar()
    known = []
    for stretch in stretches:
        stress = bar.step(1 + stretch)
        known.append([stress / (1 + stretch), bar.alpha, bar.plastic[1] - 1, bar.back[1]])
    table = np.array(known).T
    np.testing.assert_allclose(nominal, table[0], rtol=1e-9)
    np.testing.assert_allclose(history[:, [6, 0, 7]].T, table[1:], rtol=1e-8, atol=1e-12)
    assert nominal[5] < 0 < nominal[6]


def test_stiff_metals_follow_their_curves_of_true_stress_as_steps_become_short() -> None:
    """Elastic strains of 1e-6, logarithmic strain e: σ = σ_y + β, and after the turn β − σ_y.

    Deformation carries the back stress q along: q_z' = 2 q_z + ⅔ C and q_x' = −q_x − ⅓ C.
    """
    C, last, errors = 500.0, 0.25, []
    stiff = NeoHookeanPlasticity(1e3 * E, NU, YIELD, hardening_curve=CURVE, kinematic_hardening=C)
    for n in (50, 200):
        logarithm = np.concatenate([np.linspace(0, last, n + 1)[1:], np.linspace(last, 0.0, n + 1)[1:]])
        nominal, history = in_tension(stiff, np.exp(logarithm) - 1)
        true, alpha = nominal * np.exp(logarithm), np.append(logarithm[:n], 2 * last - logarithm[n:])
        hard = np.interp(alpha, *np.array([(0.0, YIELD), *CURVE]).T)
        pull = C / 3 * (np.exp(2 * logarithm) - np.exp(-logarithm))
        theory = pull + np.where(np.arange(2 * n) < n, hard, -hard)
        errors.append([np.abs(history[:, 6] - alpha).max(), np.abs(true - theory).max() / YIELD])
    assert (np.array(errors[1]) < 3e-3).all()
    np.testing.assert_allclose(np.divide(*errors), 4.0, rtol=0.1)


def test_newtons_matrix_is_the_symmetric_part_of_the_tangent() -> None:
    patch = patch_of(Body(skew_patch("hexahedron"), BOTH))
    u = smooth_field(patch.points, 0.1).ravel()
    here = patch.mechanics.at(u, MaterialStep())
    matrix, direction = here.stiffness.toarray(), np.cos(np.arange(u.size) ** 1.5)
    assert np.abs(matrix - matrix.T).max() < 1e-12 * np.abs(matrix).max()
    ahead, behind = (patch.mechanics.at(u + s * 1e-6 * direction, MaterialStep()) for s in (1, -1))
    quotient = direction @ (ahead.force - behind.force) / 2e-6
    assert quotient == pytest.approx(direction @ matrix @ direction, rel=1e-7)
    assert np.abs((ahead.force - behind.force) / 2e-6 - matrix @ direction).max() > 1e-5 * matrix.max()
