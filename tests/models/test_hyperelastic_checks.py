"""A hyperelastic model that contradicts itself is refused before a scene is solved, and told why."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import pytest
import ufl
from mpi4py import MPI

from fenics_contact import Body, Scene, check_hyperelastic
from fenics_contact._fem.forms import FormLibrary
from fenics_contact.errors import InvalidInputError, UserCodeError
from fenics_contact.gallery import rectangle
from fenics_contact.materials import Hyperelasticity, MooneyRivlin, Ogden
from tests.models.deformed import patch_of, skew_patch


@dataclass(frozen=True)
class Own(Hyperelasticity):
    """A neo-Hookean model with one mistake."""

    mistake: str = ""

    @property
    def parameters(self) -> tuple[float, float]:
        return 1.0, 2.0

    def energy(self, F: Any, parameters: Any) -> Any:
        shear, lame = parameters
        log_J = ufl.ln(ufl.det(F))
        W = shear / 2 * (ufl.inner(F, F) - 3 - 2 * log_J) + lame / 2 * log_J**2
        return W + {
            "stress": 1e-6 * shear * log_J,
            "root": ufl.sqrt(ufl.inner(F, F) - 3.0001),
            "rotation": shear * (ufl.tr(F) - 3) ** 2,
        }.get(self.mistake, 0)

    def first_piola(self, F: Any, parameters: Any) -> Any:
        P = super().first_piola(F, parameters)
        return P + 1e-3 * (F[0, 0] - 1) ** 2 * F if self.mistake == "slope" else P

    def tangent(self, u: Any, du: Any, v: Any, parameters: Any) -> Any:
        K = super().tangent(u, du, v, parameters)
        more = 1e-2 * ufl.grad(u)[0, 0] * ufl.grad(du)[0, 0] * ufl.grad(v)[0, 1]
        return K + more if self.mistake == "tangent" else K


@pytest.mark.parametrize(
    ("mistake", "message"),
    [
        (
            "stress",
            r"must be free of stress at F = I, the forces on an undeformed cell of Own are .*subtract",
        ),
        (
            "root",
            r"must be finite at F = I and at strains of a few per cent, those of Own are not: check its",
        ),
        ("rotation", r"rotation of the deformed body must not change .* that of Own changes by .* FᵀF"),
        (
            "slope",
            r"must be the derivatives of its energy, the stress of Own differs .*write the energy alone",
        ),
        pytest.param(
            "tangent",
            r"the tangent of Own differs from the difference quotient by",
            marks=(pytest.mark.slow, pytest.mark.claim),
        ),
    ],
)
def test_a_mistake_is_named(mistake: str, message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        check_hyperelastic(Own(mistake), "triangle")


def test_scenes_check_their_models_when_forms_are_prepared() -> None:
    patch_of(Body(skew_patch("triangle"), Own()))
    with pytest.raises(InvalidInputError, match="must be free of stress at F = I"):
        patch_of(Body(skew_patch("triangle"), Own("stress")))


@pytest.mark.parametrize(
    "material",
    [
        MooneyRivlin(1e9, 2e8, 1e14),
        MooneyRivlin(1e-9, 0.0, 1e-3, mean_dilatation=True),
        Ogden((2.0, -0.4), (1.3, -2.0), 1e4),
    ],
)
def test_models_of_the_package_pass_whatever_their_constants(material: Hyperelasticity) -> None:
    check_hyperelastic(material, "quadrilateral")


def test_an_energy_without_a_value_at_rest_is_named() -> None:
    @dataclass(frozen=True)
    class Singular(Own):
        def energy(self, F: Any, parameters: Any) -> Any:
            return parameters[0] / (ufl.det(F) - 1)

    body = Body(rectangle((0, 0), (1, 1), (1, 1)), Singular())
    with pytest.raises(
        InvalidInputError, match=r"stiffness, Singular, quadrilateral must be UFL.*Division by"
    ):
        FormLibrary(MPI.COMM_SELF).prepare(Scene({"body": body}))


def test_an_energy_that_raises_is_named() -> None:
    @dataclass(frozen=True)
    class Broken(Own):
        def energy(self, F: Any, parameters: Any) -> Any:
            return parameters[7] * ufl.tr(F)

    with pytest.raises(UserCodeError, match=r"the UFL of material Broken failed with IndexError"):
        check_hyperelastic(Broken(), "triangle")
