"""Sheets in plane stress of rubber and metals, against formulas in principal stretches."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import ufl
from mpi4py import MPI
from scipy.optimize import brentq

from fenics_contact import (
    Body,
    Scene,
    Support,
    ThermalStrain,
    check_hyperelastic,
    quantity,
    solve_scene,
    solve_to,
)
from fenics_contact.design import Movement
from fenics_contact.errors import ConvergenceError, InvalidInputError
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import (
    FinitePlasticity,
    HistoryPlaneStress,
    Hyperelasticity,
    HyperelasticPlaneStress,
    Hyperfoam,
    J2Plasticity,
    Material,
    MooneyRivlin,
    NeoHooke,
    PlaneStress,
    StVenantKirchhoff,
)
from fenics_contact.output import write_frd
from tests.conftest import run_on_ranks
from tests.design import deformed_blocks
from tests.materials.deformed import derivative_errors, patch_of, rotation, skew_patch, smooth_field
from tests.materials.elements import whole
from tests.materials.sheets_on_ranks import disc_on_block
from tests.materials.stretches import MODELS, Energy, stress


@dataclass(frozen=True)
class Fibres(Hyperelasticity):
    """One's own energy: a matrix that hardly changes its volume, and fibres along a direction."""

    direction: tuple[float, float, float] = (0.8, 0.6, 0.0)
    shear: float = 1.0
    bulk: float = 40.0
    fibre: float = 3.0

    @property
    def parameters(self) -> tuple[float, ...]:
        return self.shear, self.bulk, self.fibre, *self.direction

    def energy(self, F: Any, parameters: Any) -> Any:
        shear, bulk, fibre, *direction = parameters
        J, a = ufl.det(F), ufl.as_vector(direction)
        matrix = shear / 2 * (J ** (-2 / 3) * ufl.inner(F, F) - 3) + bulk / 2 * (J - 1) ** 2
        return matrix + fibre / 2 * (ufl.dot(F * a, F * a) - 1) ** 2


def foam(x: np.ndarray) -> complex:
    terms = ((0.5, 2.0, -1.0), (0.02, -3.0, 1.5))
    return sum(f * ((x**a).sum() - 3 + 2 * (x.prod() ** b - 1)) for f, a, b in terms)


ALL: dict[str, tuple[Hyperelasticity, Energy]] = {
    **MODELS,
    "Hyperfoam": (Hyperfoam((1.0, 0.09), (2.0, -3.0), (0.25, 0.25)), foam),
}
#: Ogden's and Hyperfoam's sums of powers take long to compile.
NAMES = [
    *("NeoHooke", "StVenantKirchhoff"),
    *(pytest.param(name, marks=[pytest.mark.slow]) for name in ("MooneyRivlin", "Ogden", "Hyperfoam")),
]
RUBBER, STEEL = NeoHooke(10.0, 0.45), J2Plasticity(2e5, 0.3, 235.0, isotropic_hardening=2e3)


def across(energy: Energy, first: float, second: float) -> float:
    """The stretch normal to a sheet, by bisection."""
    return float(brentq(lambda a: stress(energy, np.array([first, second, a]), 2), 0.05, 5.0, xtol=1e-15))


def pulled(energy: Energy, first: float, second: float) -> np.ndarray:
    """Stresses of a sheet along its two stretches, force per undeformed area."""
    x = np.array([first, second, across(energy, first, second)])
    return np.array([stress(energy, x, 0), stress(energy, x, 1)])


def slack(energy: Energy, first: float) -> float:
    """The stretch across a strip in its plane, which is free there."""
    return float(brentq(lambda b: pulled(energy, first, b)[1], 0.75, 1.3, xtol=1e-15))


@pytest.mark.parametrize("name", NAMES)
def test_sheets_follow_the_formula_of_their_model(name: str) -> None:
    """Strips with free sides, sheets stretched alike in both directions, and others."""
    material, energy = ALL[name]
    sheet = patch_of(Body(rectangle((0, 0), (1, 1), (1, 1)), HyperelasticPlaneStress(material)))
    strips = [(first, slack(energy, first)) for first in (0.7, 1.4)]
    for stretches in (*strips, (0.75, 0.75), (1.3, 1.3), (0.7, 1.2), (1.5, 0.8)):
        force = sheet.at(sheet.deformed(np.diag(stretches))).force.reshape(-1, 2)
        found = [force[sheet.points[:, axis] > 0.5, axis].sum() for axis in (0, 1)]
        expected = pulled(energy, *stretches)
        assert np.abs(found - expected).max() < 1e-10 * np.abs(expected).max(), stretches


@pytest.mark.slow
@pytest.mark.parametrize("bulk", [1e3, 1e6])
def test_rubber_of_any_bulk_modulus_keeps_its_volume_and_does_not_lock(bulk: float) -> None:
    """2 (c10 + c01 λ²) (λ² − 1/λ⁴) / λ of one sheet stretched alike in both directions."""
    sheet = patch_of(
        Body(
            rectangle((0, 0), (1, 1), (1, 1)),
            HyperelasticPlaneStress(MooneyRivlin(0.3, 0.2, bulk)),
        )
    )
    for stretch in (0.6, 1.8, 2.5):
        force = sheet.at(sheet.deformed(stretch * np.eye(2))).force.reshape(-1, 2)
        found = force[sheet.points[:, 0] > 0.5, 0].sum()
        expected = 2 * (0.3 + 0.2 * stretch**2) * (stretch**2 - stretch**-4) / stretch
        assert found == pytest.approx(expected, rel=20.0 / bulk)


@pytest.mark.parametrize(
    ("material", "cell"),
    [
        (RUBBER, "quadrilateral"),
        pytest.param(RUBBER, "triangle", marks=[pytest.mark.slow]),
        pytest.param(Fibres(), "quadrilateral9", marks=[pytest.mark.slow]),
    ],
    ids=["rubber", "triangles", "fibres"],
)
def test_force_and_tangent_are_derivatives_and_feel_no_rotation(material: Hyperelasticity, cell: str) -> None:
    patch = patch_of(Body(skew_patch(cell), HyperelasticPlaneStress(material)))
    u = smooth_field(patch.points, 0.2)
    in_force, in_stiffness = derivative_errors(patch, u)
    assert in_force < 1e-8
    assert in_stiffness < 1e-8
    turned = patch.at((patch.points + u) @ rotation(2, 1.1).T - patch.points)
    assert turned.energy == pytest.approx(patch.at(u).energy, rel=1e-12)


def test_small_strains_are_those_of_linear_plane_stress() -> None:
    mesh = skew_patch("quadrilateral")
    expected = whole(Body(mesh, PlaneStress(10.0, 0.45))).stiffness
    for material in (RUBBER, StVenantKirchhoff(10.0, 0.45)):
        patch = patch_of(Body(mesh, HyperelasticPlaneStress(material)))
        for found in (patch.linear_stiffness(), patch.at(np.zeros(patch.mesh.size)).stiffness):
            assert np.abs(found - expected).max() < 1e-13 * np.abs(expected).max()
    steel = patch_of(Body(mesh, HistoryPlaneStress(J2Plasticity(10.0, 0.45, 1.0))))
    assert np.abs(steel.linear_stiffness() - expected).max() < 1e-13 * np.abs(expected).max()


def strip(material: Material, pull: float | None = None, warmer: float = 0.0) -> Scene:
    mesh = rectangle((0, 0), (2, 1), (4, 2))
    held = [Support("strip", "x0", (0.0, None)), Support("strip", "y0", (None, 0.0))]
    held += [] if pull is None else [Support("strip", "x1", (pull, None))]
    loads = [ThermalStrain("strip", warmer)] if warmer else []
    return Scene({"strip": Body(mesh, material)}, held, loads)


@pytest.mark.parametrize("kind", [pytest.param(NeoHooke, marks=[pytest.mark.slow]), StVenantKirchhoff])
def test_a_warm_sheet_grows_without_stress(kind: type[NeoHooke | StVenantKirchhoff]) -> None:
    sheet = HyperelasticPlaneStress(kind(10.0, 0.45, thermal_expansion=1e-3))
    state = solve_scene(strip(sheet, warmer=100.0), MPI.COMM_SELF, tolerance=1e-10)
    assert state.gather_displacement("strip").max(axis=0) == pytest.approx([0.2, 0.1], rel=1e-8)
    assert np.abs(state.gather_stress("strip")).max() < 1e-8


def test_stresses_are_true_ones_and_strains_normal_to_sheets_are_not_known(tmp_path: Path) -> None:
    material, energy = ALL["StVenantKirchhoff"]
    state = solve_scene(strip(HyperelasticPlaneStress(material), 0.6), MPI.COMM_SELF, tolerance=1e-10)
    wide = slack(energy, 1.3)
    expected = np.zeros((3, 3))
    expected[0, 0] = pulled(energy, 1.3, wide)[0] / (wide * across(energy, 1.3, wide))
    np.testing.assert_allclose(state.gather_stress("strip")[0], expected, atol=1e-8)
    text = write_frd(tmp_path / "strip.frd", state).read_text()
    assert "STRESS" in text
    assert "TOSTRAIN" not in text
    assert "nan" not in text.lower()
    strain = state.gather_at_points("strip").strain
    assert np.isnan(strain[..., 2, 2]).all()
    assert strain[0, 0, 0, 0] == pytest.approx((1.3**2 - 1) / 2)


def test_where_no_thickness_is_left_newtons_method_says_so() -> None:
    """E33 of St. Venant and Kirchhoff is below −1/2 where a sheet is stretched to twice its size."""
    sheet = HyperelasticPlaneStress(StVenantKirchhoff(10.0, 0.45))
    patch = patch_of(Body(rectangle((0, 0), (1, 1), (1, 1)), sheet))
    assert np.isnan(patch.at(patch.deformed(2.0 * np.eye(2))).force).any()
    with pytest.raises(ConvergenceError):
        solve_scene(strip(sheet, 2.2), MPI.COMM_SELF)


def test_a_stretch_that_has_not_settled_gives_no_stress() -> None:
    class Hasty(NeoHooke):
        def stretch_across(self, F: Any, parameters: Any, steps: int = 1) -> Any:
            return super().stretch_across(F, parameters, steps)

    with pytest.raises(InvalidInputError, match="must be finite at F = I and near it"):
        check_hyperelastic(HyperelasticPlaneStress(Hasty(10.0, 0.3)))


# Contact of sheets, and designs.


@pytest.mark.slow
@pytest.mark.parametrize("kind", [NeoHooke, StVenantKirchhoff])
def test_shape_derivatives_of_sheets_that_press_each_other(
    kind: type[NeoHooke | StVenantKirchhoff], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(deformed_blocks, "RUBBER", HyperelasticPlaneStress(kind(1.0, 0.4)))
    monkeypatch.setattr(deformed_blocks, "HARDER", HyperelasticPlaneStress(NeoHooke(2.0, 0.3)))
    scene = deformed_blocks.pressed("block", 0.3, 0.1)
    for objective in (deformed_blocks.PRESSURES, Movement("block", "x1", (1.0, 0.3))):
        problem = deformed_blocks.design_problem(scene, objective)
        assert (
            deformed_blocks.miss(problem, deformed_blocks.design_problem(scene, objective, tolerance=1e-12))
            < 1e-6
        )


@cache
def found(ranks: int) -> dict[str, Any]:
    answer: dict[str, Any] = json.loads(run_on_ranks(Path(__file__).with_name("sheets_on_ranks.py"), ranks))
    return answer


def test_two_sheets_press_each_other_in_balance_without_stress_normal_to_them() -> None:
    state = solve_scene(disc_on_block(), MPI.COMM_SELF, tolerance=1e-10)
    force = state.contact.force[:, 1].sum()
    assert force == pytest.approx(state.reactions()["block y0"].force[1], rel=1e-8)
    assert force == pytest.approx(0.0950, rel=0.02)
    assert np.abs(state.gather_stress("disc")[:, 2]).max() < 1e-12


@pytest.mark.slow
def test_two_sheets_press_each_other_alike_on_one_rank_and_on_two() -> None:
    for name, values in found(1).items():
        size = np.abs(values).max()
        np.testing.assert_allclose(found(2)[name], values, atol=1e-8 * size)


@pytest.mark.slow
def test_solve_to_knows_the_force_between_sheets() -> None:
    """Against three meshes, each of half the size, the last of 32 cells from the pole."""
    scene = disc_on_block(4)
    force = quantity("contact_force", scene, direction=(0, 1))
    near = solve_to(scene, force, 0.01, MPI.COMM_SELF)
    assert abs(near.value - 0.094938) <= near.error < 0.01 * near.value


# Metals in small strain.


def test_a_metal_sheet_flows_as_the_formulas_say() -> None:
    sheet, pull = HistoryPlaneStress(STEEL), 0.01
    state = solve_scene(strip(sheet, 2 * pull), MPI.COMM_SELF, tolerance=1e-10)
    alone = (235.0 + 2e3 * pull) / (1 + 2e3 / 2e5)
    np.testing.assert_allclose(state.gather_stress("strip")[:, 0, 0], alone, rtol=1e-9)
    gradient = np.zeros((1, 3, 3))
    gradient[0, 0, 0] = gradient[0, 1, 1] = pull
    end = sheet.answer(gradient, np.zeros((1, 8)), 1.0)
    both = (pull + 235.0 / 4e3) / (0.7 / 2e5 + 1 / 4e3)
    assert np.diag(end.stress[0]) == pytest.approx([both, both, 0.0], rel=1e-12)
    assert sheet.equivalent_plastic_strain(end.history) == pytest.approx((both - 235.0) / 2e3, rel=1e-9)


@pytest.mark.parametrize("poisson", [0.0, 0.3, 0.49])
@pytest.mark.parametrize("hardening", [0.0, 2e3])
def test_metal_sheets_have_consistent_tangents_loaded_and_unloaded(poisson: float, hardening: float) -> None:
    sheet = HistoryPlaneStress(J2Plasticity(2e5, poisson, 235.0, isotropic_hardening=hardening))
    gradient = np.zeros((400, 3, 3))
    gradient[:, :2, :2] = np.random.default_rng(0).standard_normal((400, 2, 2))
    gradient *= np.geomspace(1e-4, 0.1, 400)[:, None, None]
    first = sheet.answer(gradient, np.zeros((400, 8)), 1.0)
    end = sheet.answer(-0.5 * gradient, first.history, 1.0)
    assert (end.history[:, 6] > first.history[:, 6]).sum() > 100, "many flow back"
    assert np.abs(end.stress[:, 2]).max() < 1e-9
    errors = np.zeros(400)
    for k, m in np.ndindex(2, 2):
        step = np.zeros((3, 3))
        step[k, m] = 1e-7
        ahead, behind = (
            sheet.answer(-0.5 * gradient + sign * step, first.history, 1.0).stress for sign in (1, -1)
        )
        errors = np.maximum(errors, np.abs((ahead - behind) / 2e-7 - end.tangent[..., k, m]).max(axis=(1, 2)))
    assert np.sort(errors)[-5] < 1e-7 * 2e5, "all but where flow begins within the step"


# What cannot be.


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: HyperelasticPlaneStress(STEEL), "material must be a Hyperelasticity"),
        (lambda: HistoryPlaneStress(RUBBER), "material must be a HistoryMaterial"),
        (lambda: HyperelasticPlaneStress(HyperelasticPlaneStress(RUBBER)), "of bodies in space"),
        (lambda: HyperelasticPlaneStress(NeoHooke(1.0, 0.49, mean_dilatation=True)), "sheets do not lock"),
        (lambda: HyperelasticPlaneStress(Fibres((0.6, 0.0, 0.8))), "turn its axes into the plane"),
        (lambda: HistoryPlaneStress(FinitePlasticity(2e5, 0.3, 235.0)), "of small strain"),
        (lambda: HistoryPlaneStress(J2Plasticity(2e5, 0.3, 235.0, mean_dilatation=True)), "do not lock"),
        (lambda: Body(block((0, 0, 0), (1, 1, 1), (1, 1, 1)), HyperelasticPlaneStress(RUBBER)), "dimension"),
        (
            lambda: Body(
                rectangle((1, 0), (2, 1), (1, 1)), HyperelasticPlaneStress(RUBBER), axisymmetric=True
            ),
            "revolution",
        ),
    ],
)
def test_what_cannot_be_a_sheet_is_refused(make: Any, said: str) -> None:
    with pytest.raises(InvalidInputError, match=said):
        make()


def test_the_check_of_own_models_is_for_sheets_too() -> None:
    check_hyperelastic(HyperelasticPlaneStress(RUBBER))
