"""Checks of material models, elastic, hyperelastic and with history."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import pytest
import ufl
from mpi4py import MPI

from fenics_contact import Body, Scene, check_history_material, check_hyperelastic
from fenics_contact._fem.forms import FormLibrary
from fenics_contact._fem.model_checks import check_kernel, check_model
from fenics_contact._kinematics.element import plain_element
from fenics_contact.errors import InvalidInputError, UserCodeError
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import (
    AnisotropicElasticity,
    Elasticity,
    EnergyModel,
    FinitePlasticity,
    HistoryMaterial,
    Hyperelasticity,
    IsotropicElasticity,
    J2Plasticity,
    Material,
    MaterialResponse,
    MooneyRivlin,
    Ogden,
    OrthotropicElasticity,
    PlaneStrain,
    rigid_body_modes,
    strain,
)
from tests.materials.deformed import patch_of, skew_patch
from tests.materials.elements import (
    CELLS,
    PLANE,
    by_node,
    element_stiffness,
    isotropic_matrix,
    one_cell,
    whole,
)
from tests.materials.materials import Foundation

Kernel = Callable[[np.ndarray], np.ndarray]


def prepare(material: Material, cell: str) -> FormLibrary:
    mesh = (
        rectangle((0, 0), (1, 1), (1, 1), cell)
        if cell in PLANE
        else block((0,) * 3, (1,) * 3, (1,) * 3, cell)
    )
    forms = FormLibrary(MPI.COMM_SELF)
    forms.prepare(Scene({"body": Body(mesh, material)}))
    return forms


@dataclass(frozen=True)
class Model(Elasticity):
    """Elasticity with a claim about its kernel, and parts of the stress that should not be there."""

    claim: Kernel = rigid_body_modes
    bulk: float = 1.0
    shear: float = 1.0
    one_sided: float = 0.0

    @property
    def parameters(self) -> tuple[float, float, float]:
        return self.bulk, self.shear, self.one_sided

    def stress(self, u: Any, parameters: Any) -> Any:
        bulk, shear, one_sided = parameters
        e, dim = strain(u), len(u)
        unsymmetric = ufl.as_tensor(
            [[e[1, 1] if i == j == 0 else 0 * e[0, 0] for j in range(dim)] for i in range(dim)]
        )
        return bulk * ufl.tr(e) * ufl.Identity(dim) + 2 * shear * ufl.dev(e) + one_sided * unsymmetric

    def kernel(self, points: np.ndarray) -> np.ndarray:
        return self.claim(points)


def one_too_few(points: np.ndarray) -> np.ndarray:
    return rigid_body_modes(points)[..., :-1]


def one_too_many(points: np.ndarray) -> np.ndarray:
    return np.concatenate([rigid_body_modes(points), points[..., None]], axis=-1)


def one_wrong(points: np.ndarray) -> np.ndarray:
    modes = rigid_body_modes(points)
    modes[:, 0, -1] += points[:, 0]
    return modes


def one_twice(points: np.ndarray) -> np.ndarray:
    modes = rigid_body_modes(points)
    return np.concatenate([modes, modes[..., :1] + 2 * modes[..., 1:2]], axis=-1)


def flat(points: np.ndarray) -> np.ndarray:
    return rigid_body_modes(points).reshape(points.size, -1)


def no_numbers(points: np.ndarray) -> np.ndarray:
    return np.nan * rigid_body_modes(points)


@pytest.mark.parametrize("cell", CELLS)
def test_a_consistent_model_passes(cell: str) -> None:
    assert prepare(Model(), cell).compiled == (("stiffness", Model, cell),)


@pytest.mark.parametrize("cell", CELLS)
@pytest.mark.parametrize(
    ("claim", "message"),
    [
        (
            one_too_few,
            r"the kernel of Model has [25] modes, a \w+ [36]: complete kernel",
        ),
        (
            one_too_many,
            r"of material Model must hold motions without energy, .*annihilates",
        ),
        (one_wrong, r"of material Model must hold motions without energy, .*annihilates"),
        (one_twice, r"modes of Model must be independent: leave out"),
        (flat, r"kernel\(points\) of Model must return finite modes \(\d+, \d\) \+ \(n_modes,\), got \("),
        (no_numbers, r"kernel\(points\) of Model must return finite modes"),
    ],
)
def test_a_wrong_kernel_is_refused(claim: Kernel, message: str, cell: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        prepare(Model(claim), cell)


@pytest.mark.parametrize("cell", CELLS)
def test_a_stress_without_an_energy_is_refused(cell: str) -> None:
    with pytest.raises(InvalidInputError, match=r"stiffness of Model must be symmetric, is not by"):
        prepare(Model(one_sided=1e-6), cell)


@pytest.mark.parametrize("cell", CELLS)
def test_a_negative_energy_is_refused(cell: str) -> None:
    with pytest.raises(InvalidInputError, match=r"energy of Model must not be negative, got eigenvalue -0"):
        prepare(Model(shear=-0.1), cell)


@pytest.mark.parametrize("cell", CELLS)
def test_a_motion_that_the_material_does_not_resist_must_be_in_the_kernel(cell: str) -> None:
    """Without shear stiffness a body has more than rigid motions."""
    with pytest.raises(InvalidInputError, match=r"the kernel of Model has [36] modes, a"):
        prepare(Model(shear=0.0), cell)


def test_a_material_without_stiffness_is_refused() -> None:
    @dataclass(frozen=True)
    class Limp(HistoryMaterial):
        history_size = 1

        def respond(self, gradient: Any, history: Any, duration: float) -> MaterialResponse:
            return MaterialResponse(gradient * 0.0, np.zeros((len(gradient), 3, 3, 3, 3)), history)

    bar = Body(block((0, 0, 0), (1, 1, 1), (1, 1, 1)), Limp())
    with pytest.raises(InvalidInputError, match="the stiffness of Limp must not be zero: check"):
        FormLibrary(MPI.COMM_SELF).prepare(Scene({"bar": bar}))


def test_parameters_must_be_a_sequence() -> None:
    @dataclass(frozen=True)
    class Single(PlaneStrain):
        @property
        def parameters(self) -> Any:
            return 1.0

    with pytest.raises(
        InvalidInputError, match=r"parameters of Single must be a sequence .* got 1.0: return a"
    ):
        Body(rectangle((0, 0), (1, 1), (1, 1)), Single(1.0, 0.3))


def test_an_infinite_stiffness_is_refused() -> None:
    with pytest.raises(
        InvalidInputError, match=r"the stiffness of IsotropicElasticity must be finite, got NaN: check"
    ):
        prepare(IsotropicElasticity(1e308, 0.49), "hexahedron")


def test_a_process_checks_a_material_once_and_an_odd_one_every_time(monkeypatch: pytest.MonkeyPatch) -> None:
    checked = list[Material]()

    def noted(material: Material, *others: Any) -> None:
        checked.append(material)
        check_model(material, *others)

    monkeypatch.setattr("fenics_contact._fem.forms.check_model", noted)
    one, other, odd = IsotropicElasticity(123.0, 0.27), IsotropicElasticity(321.0, 0.27), Model(shear=-0.2)
    element = plain_element("hexahedron")
    first = [prepare(each, "hexahedron").typical_modulus(each, element) for each in (one, other, one)]
    assert checked == [one, other]
    assert first == pytest.approx([first[0], first[0] * 321 / 123, first[0]], rel=1e-12)
    for _ in range(2):
        with pytest.raises(InvalidInputError, match="the energy of Model must not be negative"):
            prepare(odd, "hexahedron")
    assert checked == [one, other, odd, odd]


@pytest.mark.parametrize("cell", ["quadrilateral", "hexahedron"])
def test_a_kernel_may_be_empty(cell: str) -> None:
    assert prepare(Foundation(1.0), cell).compiled


@pytest.mark.parametrize(
    "density",
    [
        lambda e: ufl.tr(e) ** 3 + ufl.inner(e, e),
        lambda e: ufl.inner(e, e) ** 2,
        lambda e: ufl.sqrt(1 + ufl.inner(e, e)),
        lambda e: ufl.inner(e, e) + ufl.tr(e),
        lambda e: ufl.inner(e, e) + 1,
        lambda e: ufl.sqrt(ufl.inner(e, e)) ** 2,
    ],
    ids=["cubic", "quartic", "root", "prestressed", "not zero at rest", "hidden"],
)
def test_an_energy_that_is_not_quadratic_is_refused(density: Callable[[Any], Any]) -> None:
    @dataclass(frozen=True)
    class Odd(EnergyModel):
        @property
        def parameters(self) -> tuple[float, ...]:
            return ()

        def energy(self, strain: Any, parameters: Any) -> Any:
            return density(strain)

    for cell in ("triangle", "hexahedron"):
        with pytest.raises(InvalidInputError, match=r"Odd.energy must be a quadratic function of the strain"):
            prepare(Odd(), cell)


def test_a_kernel_that_a_subdomain_resists_is_refused_with_its_name() -> None:
    vertices = np.array([[0, 0], [1, 0], [1, 1], [0, 1.0]])
    K = element_stiffness(vertices, "quadrilateral", isotropic_matrix(1.0, 0.3, 2))
    R = rigid_body_modes(vertices).reshape(8, 3)
    check_kernel(K, R, "subdomain 3 of body 'plate'")
    with pytest.raises(
        InvalidInputError, match="the kernel of subdomain 3 of body 'plate' must hold motions without"
    ):
        check_kernel(K, R + 1e-6 * vertices.reshape(8, 1), "subdomain 3 of body 'plate'")


def wrong_on_many_points(points: np.ndarray) -> np.ndarray:
    return rigid_body_modes(points) if len(points) <= 8 else one_wrong(points)


def test_the_kernel_is_checked_on_every_subdomain() -> None:
    mesh = block((0,) * 3, (1,) * 3, (2, 1, 1))
    with pytest.raises(
        InvalidInputError, match=r"the kernel of subdomain 0 of body 'cell' must hold .*annihilates"
    ):
        whole(Body(mesh, Model(wrong_on_many_points)))


def test_a_material_that_lacks_a_member_is_refused() -> None:
    class Nothing:
        dims = (3,)

    mesh = block((0,) * 3, (1,) * 3, (1,) * 3)
    with pytest.raises(
        InvalidInputError, match=r"must have dims, .* Nothing lacks \['parameters', 'stress', 's"
    ):
        Body(mesh, Nothing())  # type: ignore[arg-type]


def test_a_material_must_be_hashable() -> None:
    @dataclass(frozen=True)
    class WithArray(Model):
        table: Any = None

    mesh = block((0,) * 3, (1,) * 3, (1,) * 3)
    with pytest.raises(InvalidInputError, match=r"WithArray must be hashable .*frozen datacl"):
        Body(mesh, WithArray(table=np.zeros(3)))


def test_a_material_must_suit_the_dimension_of_the_mesh() -> None:
    message = (
        r"must be made for the dimension of the mesh, {} is for \({},\) and the mesh has {}: use PlaneSt"
    )
    plane, space = rectangle((0, 0), (1, 1), (1, 1)), block((0,) * 3, (1,) * 3, (1,) * 3)
    with pytest.raises(InvalidInputError, match=message.format("IsotropicElasticity", 3, 2)):
        Body(plane, IsotropicElasticity(1.0, 0.3))
    with pytest.raises(InvalidInputError, match=message.format("PlaneStrain", 2, 3)):
        Body(space, PlaneStrain(1.0, 0.3))


def test_orthotropic_constants_must_give_a_positive_energy() -> None:
    with pytest.raises(
        InvalidInputError, match=r"young_moduli .* give no positive energy: reduce the Poisson"
    ):
        OrthotropicElasticity((1.0, 1.0, 1.0), (0.6, 0.6, 0.6), (1.0, 1.0, 1.0))
    with pytest.raises(
        InvalidInputError, match=r"young_moduli and shear_moduli must be a positive number, got -1"
    ):
        OrthotropicElasticity((1.0, -1.0, 1.0), (0.1, 0.1, 0.1), (1.0, 1.0, 1.0))
    with pytest.raises(
        InvalidInputError, match=r"young_moduli must be 3 finite numbers, got .*: give those of the"
    ):
        OrthotropicElasticity((1.0, 1.0), (0.1, 0.1, 0.1), (1.0, 1.0, 1.0))  # type: ignore[arg-type]


def test_moduli_of_an_anisotropic_body_must_be_symmetric_and_give_a_positive_energy() -> None:
    def crystal(moduli: np.ndarray) -> AnisotropicElasticity:
        return AnisotropicElasticity(moduli)  # type: ignore[arg-type]

    good = np.eye(6) + 0.1
    assert crystal(good).moduli[0] == (1.1, 0.1, 0.1, 0.1, 0.1, 0.1)
    one_sided, negative, indefinite = good.copy(), good.copy(), good.copy()
    one_sided[1, 3] = 0.3
    negative[2, 2] = -1.0
    indefinite[4, 5] = indefinite[5, 4] = 1.2
    with pytest.raises(InvalidInputError, match=r"symmetric, got \[1\]\[3\] = 0.3, \[3\]\[1\] = 0.1"):
        crystal(one_sided)
    for bad in (negative, indefinite, np.zeros((6, 6))):
        with pytest.raises(InvalidInputError, match=r"moduli must give a positive energy, a scaled"):
            crystal(bad)
    with pytest.raises(InvalidInputError, match=r"moduli must be 6 x 6 finite numbers"):
        crystal(np.eye(5))


def test_an_orientation_must_be_a_rotation() -> None:
    with pytest.raises(InvalidInputError, match=r"orientation must be three orthonormal rows, got"):
        OrthotropicElasticity((1.0,) * 3, (0.1,) * 3, (1.0,) * 3, ((1, 0, 0), (0, 1, 0), (0, 0, 2)))


@pytest.mark.parametrize("cell", CELLS)
def test_the_typical_modulus_is_the_mean_diagonal_of_a_unit_cell(cell: str) -> None:
    dim = 2 if cell in PLANE else 3
    sides = {
        "triangle": np.vstack([np.zeros(2), np.eye(2)]),
        "tetrahedron": np.vstack([np.zeros(3), np.eye(3)]),
        "quadrilateral": np.array([[0, 0], [1, 0], [1, 1], [0, 1.0]]),
        "hexahedron": block((0,) * 3, (1,) * 3, (1,) * 3).points[
            block((0,) * 3, (1,) * 3, (1,) * 3).cells[0]
        ],
    }[cell]
    material = PlaneStrain(7.0, 0.3) if dim == 2 else IsotropicElasticity(7.0, 0.3)
    expected = np.diag(element_stiffness(sides, cell, isotropic_matrix(7.0, 0.3, dim))).mean()
    found = prepare(material, cell).typical_modulus(material, plain_element(cell))
    assert found == pytest.approx(expected, rel=1e-12)
    assert expected == pytest.approx(np.diag(by_node(one_cell(material, cell, sides))).mean(), rel=1e-12)


# A material of a user's own that is not what the solver takes it for is told so.
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
        ("tangent", r"dP\[0,1\]/dH\[2,2\] is 0.01, not 0 \(\d points\)"),
        ("writing", "respond of Damper must not write into its arguments"),
        ("mean", "respond of Damper must answer each point alone"),
        ("spin", r"the stress of Damper must depend on the symmetric part"),
        ("jumps", "the stress of Damper must be continuous, it jumps"),
    ],
)
def test_what_is_wrong_is_named(spoilt: str, message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        check_history_material(Damper(spoilt))


def test_large_deformations_need_a_stress_that_turns() -> None:
    with pytest.raises(InvalidInputError, match=r"the stress of TurningDamper must turn with the"):
        check_history_material(TurningDamper())


def test_errors_of_the_users_own_name_their_source() -> None:
    with pytest.raises(UserCodeError, match="respond of material Damper failed with ValueError"):
        check_history_material(Damper("raises"))


# A hyperelastic model that contradicts itself is refused before a scene is solved, and told why.
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
            r"Own must have no stress at F = I, forces are .*subtract",
        ),
        (
            "root",
            r"tangent of Own must be finite at F = I and near it: check its",
        ),
        ("rotation", r"rotation must not change the energy of Own, off by .* FᵀF"),
        (
            "slope",
            r"must be derivatives of energy, stress of Own is off by",
        ),
        pytest.param(
            "tangent",
            r"tangent of Own is off by",
            marks=(pytest.mark.slow, pytest.mark.claim),
        ),
    ],
)
def test_a_mistake_is_named(mistake: str, message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        check_hyperelastic(Own(mistake), "triangle")


def test_scenes_check_their_models_when_forms_are_prepared() -> None:
    patch_of(Body(skew_patch("triangle"), Own()))
    with pytest.raises(InvalidInputError, match="Own must have no stress at F = I"):
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
