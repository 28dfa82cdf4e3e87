"""Materials that yield, and those with a history of their own."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from fenics_contact import Body
from fenics_contact.errors import InvalidInputError, UserCodeError
from fenics_contact.gallery import block
from fenics_contact.materials import (
    FinitePlasticity,
    HistoryMaterial,
    IsotropicElasticity,
    J2Plasticity,
    MaterialResponse,
)
from tests.scene.material_points import TURN, at_rest, deformations, in_tension, tangent_error

E, NU, YIELD = 2e5, 0.3, 200.0
SMALL = J2Plasticity(E, NU, YIELD, 2e3, 5e3, 300.0, 30.0)
LARGE = FinitePlasticity(E, NU, YIELD, 2e3, 300.0, 30.0)
EITHER = pytest.mark.parametrize(("material", "size"), [(SMALL, 3e-3), (LARGE, 0.1)], ids=["small", "large"])


@EITHER
def test_the_tangent_is_that_of_the_stress_when_loading_unloading_and_reversing(
    material: HistoryMaterial, size: float
) -> None:
    loaded = deformations(size)
    first = material.answer(loaded, at_rest(material, 20), 0.0)
    elastic = 1e-4 * deformations(1.0)
    assert (first.history[:, 6] > 0).all()
    states = {
        "elastic": (elastic, at_rest(material, 20), False),
        "plastic": (loaded, at_rest(material, 20), True),
        "further": (1.3 * loaded, first.history, True),
        "turning": (loaded + deformations(size, seed=2), first.history, True),
        "unloaded": (loaded * (1 - 1e-4 / size), first.history, False),
        "reversed": (-loaded, first.history, True),
    }
    for name, (gradient, history, flows) in states.items():
        end = material.answer(gradient, history, 0.0)
        assert ((end.history[:, 6] > history[:, 6]) == flows).all(), name
        assert tangent_error(material, gradient, history, 1e-5 * size) < 1e-7, name


def test_the_tangent_is_exact_where_principal_stretches_are_equal() -> None:
    for gradient in (np.zeros((3, 3)), np.diag([0.1, 0.1, 0.1]), np.diag([0.2, -0.1, -0.1])):
        assert tangent_error(LARGE, gradient[None], at_rest(LARGE), 1e-6) < 1e-7
        for apart in (1e-9, 2e-4):
            nearly = gradient + np.diag([0.0, apart, -apart])
            assert tangent_error(LARGE, nearly[None], at_rest(LARGE), 1e-6) < 1e-7


def test_a_bar_in_tension_follows_the_hardening_law() -> None:
    strains = np.linspace(0.0, 0.02, 21)[1:]
    linear = J2Plasticity(E, NU, YIELD, 2e3, 5e3)
    stress, history = in_tension(linear, strains)
    H = 2e3 + 5e3
    plastic = np.maximum(strains - YIELD / E, 0.0) * E / (E + H)
    np.testing.assert_allclose(stress, E * (strains - plastic), rtol=1e-10)
    np.testing.assert_allclose(history[:, 0], plastic, atol=1e-14)
    np.testing.assert_allclose(history[:, 6], plastic, atol=1e-14)
    stress, history = in_tension(SMALL, strains)
    alpha = history[:, 6]
    law = YIELD + (2e3 + 5e3) * alpha + 100.0 * (1 - np.exp(-30.0 * alpha))
    assert (alpha > 0).sum() > 10
    np.testing.assert_allclose(stress[alpha > 0], law[alpha > 0], rtol=1e-10)


def test_perfect_plasticity_and_softening_keep_to_the_yield_stress() -> None:
    strains = np.array([0.5e-3, 2e-3, 0.01, 0.05, 0.15])
    stress, _ = in_tension(J2Plasticity(E, NU, YIELD), strains)
    np.testing.assert_allclose(stress, [100.0, 200.0, 200.0, 200.0, 200.0], rtol=1e-10)
    soft = J2Plasticity(E, NU, YIELD, isotropic_hardening=-1e3)
    stress, history = in_tension(soft, strains)
    np.testing.assert_allclose(stress[1:], YIELD - 1e3 * history[1:, 6], rtol=1e-9)
    spent = soft.answer(np.diag([0.6, -0.3, -0.3])[None], at_rest(soft), 0.0)
    assert np.abs(spent.stress).max() < 1e-9
    assert spent.history[0, 6] == pytest.approx(0.6)


def test_the_tangent_of_metal_that_has_lost_its_yield_stress_is_exact() -> None:
    metal, loaded = J2Plasticity(E, NU, YIELD, -1e4, 2e4), deformations(0.05)
    end = metal.answer(loaded, at_rest(metal, 20), 0.0)
    assert (end.history[:, 6] > YIELD / 1e4).all()
    assert (metal.hardening.at(end.history[:, 6])[0] == 0.0).all()
    assert tangent_error(metal, loaded, at_rest(metal, 20), 1e-7) < 1e-6


def test_large_tension_follows_the_law_in_logarithmic_strain() -> None:
    stretches = np.array([0.0005, 0.1, 0.3, 0.6])
    nominal, history = in_tension(LARGE, stretches)
    alpha = history[:, 6]
    law = YIELD + 2e3 * alpha + 100.0 * (1 - np.exp(-30.0 * alpha))
    kirchhoff = nominal * (1 + stretches)
    assert kirchhoff[0] == pytest.approx(E * np.log(1.0005), rel=1e-9)
    np.testing.assert_allclose(kirchhoff[1:], law[1:], rtol=1e-9)
    np.testing.assert_allclose(alpha[1:], np.log(1 + stretches[1:]) - law[1:] / E, rtol=1e-9)
    volume = np.linalg.det(np.eye(3) + np.diag(history[-1, :3]))
    assert volume == pytest.approx(1.0, abs=1e-12)


def test_kinematic_hardening_yields_earlier_in_the_other_direction() -> None:
    path = np.concatenate([np.linspace(0, 0.01, 11)[1:], np.linspace(0.01, -0.01, 201)[1:]])

    def yields_back_at(material: J2Plasticity) -> tuple[float, float, float]:
        stress, history = in_tension(material, path)
        flows = np.flatnonzero(np.diff(history[9:, 6]) > 1e-12)
        return stress[9], stress[9 + flows[0]], stress[-1]

    peak, back, last = yields_back_at(J2Plasticity(E, NU, YIELD, kinematic_hardening=1e4))
    assert peak > YIELD + 80
    assert back == pytest.approx(peak - 2 * YIELD, abs=20.0)  # a step
    assert last == pytest.approx((1e4 * path[-1] - YIELD) / (1 + 1e4 / E), rel=1e-10)
    peak, back, _ = yields_back_at(J2Plasticity(E, NU, YIELD, isotropic_hardening=1e4))
    assert back == pytest.approx(-peak, abs=20.0)  # a step


def test_a_rotation_after_yielding_rotates_the_stress_and_nothing_flows() -> None:
    gradient = deformations(0.2)
    first = LARGE.answer(gradient, at_rest(LARGE, 20), 0.0)
    assert (first.history[:, 6] > 0.05).all()
    turned = TURN @ (np.eye(3) + gradient) - np.eye(3)
    second = LARGE.answer(turned, first.history, 0.0)
    np.testing.assert_allclose(second.stress, TURN @ first.stress, atol=1e-9 * np.abs(first.stress).max())
    np.testing.assert_allclose(second.history, first.history, atol=1e-12)
    third = LARGE.answer(1.3 * gradient, first.history, 0.0)
    other = LARGE.answer(TURN @ (np.eye(3) + 1.3 * gradient) - np.eye(3), first.history, 0.0)
    np.testing.assert_allclose(other.stress, TURN @ third.stress, atol=1e-9 * np.abs(third.stress).max())
    moved = np.einsum("ia,najkl,kb->nijbl", TURN, third.tangent, TURN.T)
    np.testing.assert_allclose(other.tangent, moved, atol=1e-9 * np.abs(moved).max())


def test_large_and_small_agree_in_the_small() -> None:
    small = J2Plasticity(E, NU, 0.2, 2e3)
    large = FinitePlasticity(E, NU, 0.2, 2e3)
    gradient = deformations(3e-6)
    one, other = (material.answer(gradient, at_rest(material, 20), 0.0) for material in (small, large))
    assert (one.history[:, 6] > 0).all()
    np.testing.assert_allclose(one.stress, other.stress, atol=2e-5 * np.abs(one.stress).max())
    np.testing.assert_allclose(one.tangent, other.tangent, atol=1e-4 * np.abs(one.tangent).max())


@EITHER
def test_plastic_strain_accumulates(material: HistoryMaterial, size: float) -> None:
    history, flowed = at_rest(material, 20), 0
    for seed in range(12):
        end = material.answer(deformations(size, seed=seed), history, 0.0)
        assert (end.history[:, 6] >= history[:, 6]).all()
        flowed += np.count_nonzero(end.history[:, 6] > history[:, 6])
        history = end.history
    assert flowed > 100


@EITHER
def test_a_cycle_of_deformation_that_ends_where_it_began_costs_work(
    material: HistoryMaterial, size: float
) -> None:
    steps = np.sin(np.linspace(0, 2 * np.pi, 201))
    history, work, last, gradient = at_rest(material, 20), np.zeros(20), None, deformations(size)
    for share, previous in zip(steps[1:], steps, strict=False):
        end = material.answer(share * gradient, history, 0.0)
        mean = end.stress if last is None else 0.5 * (end.stress + last)
        work += (share - previous) * np.einsum("nij,nij->n", mean, gradient)
        last, history = end.stress, end.history
    assert (work > 1e-6 * material.moduli[3, 3] * size**2).all()


def test_turned_inside_out_there_is_no_stress() -> None:
    gradient = np.stack([np.diag([-2.0, 0.0, 0.0]), np.diag([0.01, 0.0, 0.0])])
    end = LARGE.answer(gradient, at_rest(LARGE, 2), 0.0)
    assert np.isnan(end.stress[0]).all()
    assert np.isfinite(end.stress[1]).all()


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"yield_stress": 0.0}, "yield_stress must be a positive number, got 0.0"),
        ({"yield_stress": np.inf}, "yield_stress must be a positive number"),
        ({"isotropic_hardening": -E}, r"isotropic_hardening must exceed .*= -200000, got"),
        ({"kinematic_hardening": -1.0}, "kinematic_hardening must be a number of at least 0"),
        ({"saturation_stress": 100.0}, "saturation_stress must be at least the yield_stress 200.0"),
        ({"saturation_rate": -1.0}, "saturation_rate at least 0"),
        (
            {"saturation_stress": 300.0},
            "saturation_stress and saturation_rate must be given together, got 300",
        ),
        ({"saturation_rate": 9.0}, "must be given together, got None and 9.0: give both"),
        ({"young_modulus": -1.0}, "young_modulus must be a positive number"),
        ({"poisson_ratio": 0.5}, "poisson_ratio must lie between"),
    ],
)
def test_constants_without_a_unique_answer_are_refused(wrong: dict[str, float], message: str) -> None:
    right = {"young_modulus": E, "poisson_ratio": NU, "yield_stress": YIELD}
    with pytest.raises(InvalidInputError, match=message):
        J2Plasticity(**right | wrong)
    if "kinematic_hardening" not in wrong:
        with pytest.raises(InvalidInputError, match=message):
            FinitePlasticity(**right | wrong)


# Materials with a history of a user's own: what they need, and what they are told.
SYMMETRIC = 0.5 * (
    np.einsum("ik,jl->ijkl", np.eye(3), np.eye(3)) + np.einsum("il,jk->ijkl", np.eye(3), np.eye(3))
)


@dataclass(frozen=True)
class Kelvin(HistoryMaterial):
    """A spring beside a damper; what is `spoilt` is wrong."""

    modulus: float = 2.0
    viscosity: float = 3.0
    spoilt: str = ""

    @property
    def history_size(self) -> int:
        return 6

    def respond(self, gradient: Any, history: Any, duration: Any) -> Any:
        n = len(gradient)
        strain = 0.5 * (gradient + gradient.swapaxes(1, 2))
        i, j = np.transpose([(0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1)])
        before = np.empty_like(strain)
        before[:, i, j] = before[:, j, i] = history
        damping = self.viscosity / duration if duration else 0.0
        stress = self.modulus * strain + damping * (strain - before)
        tangent = np.broadcast_to((self.modulus + damping) * SYMMETRIC, (n, 3, 3, 3, 3)).copy()
        if self.spoilt == "stressed":
            stress = stress + np.eye(3)
        if self.spoilt == "tangent":
            tangent[:, 0, 0, 1, 1] += 1.0
        if self.spoilt == "infinite":
            stress[-1] = np.nan
        if self.spoilt == "shape":
            tangent = tangent[0]
        return MaterialResponse(stress, tangent, strain[:, i, j])


def test_a_model_of_ones_own_needs_two_members() -> None:
    model = Kelvin()
    gradient = np.zeros((4, 3, 3))
    gradient[:, 0, 1] = 0.1
    end = model.answer(gradient, at_rest(model, 4), 0.5)
    np.testing.assert_allclose(end.stress[:, 0, 1], 0.05 * (2.0 + 3.0 / 0.5))
    np.testing.assert_allclose(model.answer(gradient, end.history, 0.5).stress[:, 0, 1], 0.05 * 2.0)
    np.testing.assert_allclose(model.moduli, np.diag([2.0, 2.0, 2.0, 1.0, 1.0, 1.0]))
    assert model.nonlinear
    assert model.dims == (2, 3)


@pytest.mark.parametrize(
    ("spoilt", "message"),
    [
        ("stressed", "Kelvin must have no stress at rest, got 1"),
        ("tangent", "the tangent of Kelvin at rest must satisfy C_ijkl = C_klij = C_jikl"),
    ],
)
def test_a_linear_part_that_is_none_is_refused(spoilt: str, message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        _ = Kelvin(spoilt=spoilt).parameters


@pytest.mark.parametrize(
    ("spoilt", "message"),
    [
        ("shape", r"respond of Kelvin must return tangent of shape \(4, 3, 3, 3, 3\), got \(3, 3, 3, 3\)"),
        ("infinite", "respond of Kelvin must return finite numbers, stress is not at 1 of 4"),
    ],
)
def test_answers_of_another_form_are_refused(spoilt: str, message: str) -> None:
    model = Kelvin(spoilt=spoilt)
    with pytest.raises(InvalidInputError, match=message):
        model.answer(np.zeros((4, 3, 3)), at_rest(model, 4), 1.0)


def test_the_linear_part_is_elastic() -> None:
    steel = J2Plasticity(2e5, 0.3, 200.0, 1e3)
    first, shear = 2e5 * 0.3 / (1.3 * 0.4), 2e5 / 2.6
    expected = np.diag([2 * shear] * 3 + [shear] * 3)
    expected[:3, :3] += first
    np.testing.assert_allclose(steel.moduli, expected, rtol=1e-12)
    assert len(steel.parameters) == 21
    assert hash(steel) == hash(J2Plasticity(2e5, 0.3, 200.0, 1e3))


def test_a_model_that_replaces_the_checks_of_its_answer_is_refused() -> None:
    with pytest.raises(InvalidInputError, match="Hasty must define respond, not answer, which checks"):

        class Hasty(J2Plasticity):
            def answer(self, *given: Any) -> Any:
                return super().answer(*given)


def test_parameters_that_raise_are_told_with_their_material() -> None:
    @dataclass(frozen=True)
    class Unknown(IsotropicElasticity):
        @property
        def parameters(self) -> tuple[float, ...]:
            raise OSError("no table")

    with pytest.raises(UserCodeError, match=r"reading .* of material Unknown failed with OSError: no"):
        Body(block((0, 0, 0), (1, 1, 1), (1, 1, 1)), Unknown(1.0, 0.3))


CURVE = ((0.002, 260.0), (0.01, 300.0), (0.03, 300.0), (0.04, 280.0))


def test_tension_follows_a_curve_and_stays_at_its_last_stress() -> None:
    """Small strain in terms of σ, large in terms of τ by the logarithmic strain."""
    strains = np.array([5e-4, 1.5e-3, 2.5e-3, 0.007, 0.02, 0.035, 0.06, 0.061, 0.1])
    known = np.array([[0.0, YIELD], *CURVE]).T
    small = J2Plasticity(E, NU, YIELD, hardening_curve=CURVE)
    stress, history = in_tension(small, strains)
    alpha = history[:, 6]
    assert set(np.searchsorted(known[0], alpha[1:], side="right")) == {1, 2, 3, 4, 5}
    np.testing.assert_allclose(stress[1:], np.interp(alpha[1:], *known), rtol=1e-10)
    np.testing.assert_allclose(alpha[1:], (strains - stress / E)[1:], atol=1e-12)
    large = FinitePlasticity(E, NU, YIELD, hardening_curve=CURVE)
    nominal, history = in_tension(large, strains)
    kirchhoff, alpha = nominal * (1 + strains), history[:, 6]
    np.testing.assert_allclose(kirchhoff[1:], np.interp(alpha[1:], *known), rtol=1e-9)
    np.testing.assert_allclose(alpha[1:], (np.log(1 + strains) - kirchhoff / E)[1:], atol=1e-11)


def test_one_step_over_several_slopes_is_as_exact_as_many() -> None:
    strains = np.linspace(0.0, 0.05, 101)[1:]
    for metal in (
        J2Plasticity(E, NU, YIELD, hardening_curve=CURVE, kinematic_curve=((0.005, 30.0), (0.02, 60.0))),
        FinitePlasticity(E, NU, YIELD, hardening_curve=CURVE),
    ):
        many, few = in_tension(metal, strains), in_tension(metal, strains[-1:])
        assert few[0][-1] == pytest.approx(many[0][-1], rel=1e-9)
        np.testing.assert_allclose(few[1][-1], many[1][-1], atol=1e-8)


def test_the_back_stress_follows_its_curve_when_the_load_turns() -> None:
    """Reverse yielding at β − σ_0, and later slopes are those of all plastic strain there was."""
    rise = ((0.004, 40.0), (0.02, 80.0))
    metal = J2Plasticity(E, NU, YIELD, kinematic_curve=rise)
    path = np.concatenate([np.linspace(0, 0.008, 41)[1:], np.linspace(0.008, -0.03, 381)[1:]])
    stress, history = in_tension(metal, path)
    alpha, known = history[:, 6], np.array([(0.0, 0.0), *rise]).T
    turn = 39
    first = np.interp(alpha[turn], *known)
    assert stress[turn] == pytest.approx(YIELD + first, rel=1e-10)
    later = np.flatnonzero(alpha > alpha[turn] + 1e-12)
    back = first - (np.interp(alpha[later], *known) - first)
    np.testing.assert_allclose(stress[later], back - YIELD, rtol=1e-9)
    assert stress[later[0] - 1] > first - YIELD > stress[later[0]]
    assert alpha[-1] > 0.02  # beyond the last point
    assert 1.5 * history[-1, 7] == pytest.approx(stress[-1] + YIELD, rel=1e-9)


def test_one_slope_is_the_same_in_words_and_as_a_curve() -> None:
    plain = J2Plasticity(E, NU, YIELD, 2e3, 5e3)
    curves = J2Plasticity(E, NU, YIELD, hardening_curve=((1.0, YIELD + 2e3),), kinematic_curve=((1.0, 5e3),))
    first, second = deformations(0.01), deformations(0.01, seed=2)
    pairs = []
    for metal in (plain, curves):
        end = metal.answer(first, at_rest(metal, 20), 0.0)
        pairs.append(metal.answer(second, end.history, 0.0))
    np.testing.assert_allclose(pairs[0].stress, pairs[1].stress, atol=1e-9 * YIELD)
    np.testing.assert_allclose(pairs[0].tangent, pairs[1].tangent, atol=1e-9 * E)
    np.testing.assert_allclose(pairs[0].history, pairs[1].history[:, :7], atol=1e-12)
    assert tangent_error(curves, second, end.history, 1e-7) < 1e-6


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (
            {"hardening_curve": ((0.0, 250.0),)},
            r"hardening_curve must have ascending strains above 0",
        ),
        ({"hardening_curve": ((0.2, 250.0), (0.1, 300.0))}, r"hardening_curve must have ascending strains"),
        ({"hardening_curve": ((0.2, -1.0),)}, r"and no negative stress"),
        (
            {"hardening_curve": (0.2, 250.0)},
            r"hardening_curve must be pairs \(plastic strain, stress\)",
        ),
        (
            {"hardening_curve": ((0.2, 300.0),), "isotropic_hardening": 1.0},
            r"got isotropic_hardening as well",
        ),
        ({"kinematic_curve": ((0.2, 30.0),), "kinematic_hardening": 1.0}, r"got kinematic_hardening as well"),
        (
            {"kinematic_curve": ((0.1, 30.0), (0.2, 20.0))},
            r"kinematic_hardening must be a number of at least",
        ),
        ({"hardening_curve": ((1e-4, 100.0),)}, r"isotropic_hardening must exceed −E"),
    ],
)
def test_curves_that_say_no_hardening_are_refused(given: dict[str, Any], message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        J2Plasticity(E, NU, YIELD, **given)
