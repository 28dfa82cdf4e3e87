"""Materials with a history of a user's own: what they need, and what they are told."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from fenics_contact import Body
from fenics_contact.errors import InvalidInputError, UserCodeError
from fenics_contact.gallery import block
from fenics_contact.materials import HistoryMaterial, IsotropicElasticity, J2Plasticity, MaterialResponse
from tests.scene.material_points import at_rest

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
        ("stressed", "Kelvin must have no stress at zero displacement and history, got 1"),
        ("tangent", "the tangent of Kelvin at zero displacement and history must be that of linear"),
    ],
)
def test_a_linear_part_that_is_none_is_refused(spoilt: str, message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        _ = Kelvin(spoilt=spoilt).parameters


@pytest.mark.parametrize(
    ("spoilt", "message"),
    [
        ("shape", r"respond of Kelvin must return tangent of shape \(4, 3, 3, 3, 3\) for 4 points and 6"),
        ("infinite", "respond of Kelvin must return finite numbers, stress has NaN or infinity at 1 of 4"),
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
    with pytest.raises(InvalidInputError, match="must define respond, Hasty defines answer, which checks"):

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
