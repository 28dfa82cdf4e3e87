"""A material of a user's own that is not what the solver takes it for is told so."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import pytest

from fenics_contact import check_history_material
from fenics_contact.errors import InvalidInputError, UserCodeError
from fenics_contact.materials import FinitePlasticity, HistoryMaterial, J2Plasticity, MaterialResponse

UNIT = np.einsum("ik,jl->ijkl", np.eye(3), np.eye(3))
SYMMETRIC = 0.5 * (UNIT + UNIT.swapaxes(2, 3))


@dataclass(frozen=True)
class Damper(HistoryMaterial):
    """A spring beside a damper, σ = ε + 3 ε̇; what is `spoilt` is wrong."""

    spoilt: str = ""
    history_size: ClassVar[int] = 9

    def respond(self, gradient: Any, history: Any, duration: Any) -> Any:
        n, rate = len(gradient), 3.0 / duration if duration else 0.0
        strain = 0.5 * (gradient + gradient.swapaxes(1, 2))
        stress = strain + rate * (strain - history.reshape(-1, 3, 3))
        tangent = np.broadcast_to((1 + rate) * SYMMETRIC, (n, 3, 3, 3, 3)).copy()
        end = strain.reshape(-1, 9).copy()
        if duration and self.spoilt == "tangent":
            tangent[np.abs(strain[:, 0, 0]) > 5e-4, 0, 1, 2, 2] += 0.01
        if self.spoilt == "writing":
            history[:] = end
        if duration and self.spoilt == "mean":
            stress = stress + strain.mean(axis=0) * np.arange(n)[:, None, None]
        if duration and self.spoilt == "spin":
            stress = stress + 0.1 * (gradient - gradient.swapaxes(1, 2))
            tangent += 0.1 * (UNIT - UNIT.swapaxes(2, 3))
        if duration and self.spoilt == "jumps":
            stress = stress + 1e-3 * np.sin(1e12 * gradient[:, :1, :1] ** 2)
        if self.spoilt == "raises":
            raise ValueError("no such damper")
        return MaterialResponse(stress, tangent, end)


@dataclass(frozen=True)
class TurningDamper(Damper):
    """The same for large deformations, which it is not for."""

    finite: ClassVar[bool] = True


def test_sound_materials_pass() -> None:
    check_history_material(Damper())
    check_history_material(J2Plasticity(2e5, 0.3, 200.0, 1e3, 1e3, 300.0, 10.0), size=3e-3)
    check_history_material(FinitePlasticity(2e5, 0.3, 200.0, 1e3), size=0.1)


@pytest.mark.parametrize(
    ("spoilt", "message"),
    [
        ("tangent", r"at \d of 24 points: dP\[0,1\]/dH\[2,2\] is 0.01 in the tangent and 0 by difference"),
        ("writing", "respond of Damper must leave its arguments as they are"),
        ("mean", "respond of Damper must answer for each point by itself"),
        ("spin", r"the stress of Damper \(finite = False\) must depend on the symmetric part"),
        ("jumps", "the stress of Damper must be a continuous function"),
    ],
)
def test_what_is_wrong_is_named(spoilt: str, message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        check_history_material(Damper(spoilt))


def test_large_deformations_need_a_stress_that_turns() -> None:
    with pytest.raises(InvalidInputError, match=r"TurningDamper \(finite = True\) must turn with the"):
        check_history_material(TurningDamper())


def test_errors_of_the_users_own_name_their_source() -> None:
    with pytest.raises(UserCodeError, match="respond of material Damper failed with ValueError"):
        check_history_material(Damper("raises"))
