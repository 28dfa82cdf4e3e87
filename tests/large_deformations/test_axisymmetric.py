"""Bodies of revolution under large deformations: exact states, exact tangents, contact that follows."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI
from scipy.integrate import quad
from scipy.optimize import brentq

from fenics_contact import (
    Body,
    Pressure,
    Scene,
    State,
    Support,
    _dolfinx,
    solve_scene,
)
from fenics_contact._fem.composition import Composition
from fenics_contact._fem.forms import FormLibrary
from fenics_contact._fem.mechanics import HistoryMechanics
from fenics_contact._kinematics.element import Element
from fenics_contact._kinematics.revolution import Revolution, RevolvedMeasure
from fenics_contact._pairing.coupling_derivatives import CouplingDerivatives
from fenics_contact._pairing.mortar.coupling import MortarCoupling, mortar_coupling
from fenics_contact._pairing.mortar.derivatives import mortar_pulled_back, weight_derivatives
from fenics_contact._surfaces.facets import FacetedSurface, faceted_surface
from fenics_contact.gallery import rectangle
from fenics_contact.materials import FinitePlasticity, HistoryMaterial, J2Plasticity, MooneyRivlin, NeoHooke
from fenics_contact.materials.elastic import lame
from fenics_contact.mesh import bisection_partition, quadratic
from tests.kinematics.revolved import KINDS, Kind, section, squeezed_ring, stacked

RUBBER = NeoHooke(10.0, 0.3)


def solved(scene: Scene, **given: Any) -> State:
    return solve_scene(scene, MPI.COMM_SELF, **given)


def force_of_uniaxial(stretch: float, section: float) -> float:
    """The axial force of `RUBBER` that is free to bulge."""
    first, shear = lame(RUBBER.young_modulus, RUBBER.poisson_ratio)

    def lateral(across: float) -> float:
        return shear * (across**2 - 1) + first * np.log(across**2 * stretch)

    across = brentq(lateral, 0.5, 2.0)
    return section * (shear * (stretch**2 - 1) + first * np.log(across**2 * stretch)) / stretch


@pytest.mark.parametrize("kind", KINDS)
def test_uniform_compression_is_exact(kind: Kind) -> None:
    body = Body(section((0, 0), (3, 2), (3, 2), kind), RUBBER, axisymmetric=True)
    supports = [Support("disc", "y0", (None, 0.0)), Support("disc", "y1", (None, -0.6))]
    state = solved(Scene({"disc": body}, supports))
    stress = state.gather_stress("disc")
    assert np.abs(stress[:, [0, 2, 0], [0, 2, 1]]).max() < 1e-7
    assert state.reactions()[0].force[1] == pytest.approx(-force_of_uniaxial(0.7, 9 * np.pi), rel=1e-8)


@pytest.mark.parametrize(
    ("kind", "by", "counts"),
    [(kind, "node", (4, 4)) for kind in KINDS] + [(kind, "mortar", (4, 7)) for kind in KINDS[:2]],
)
def test_pressure_is_transmitted_exactly(kind: Kind, by: Any, counts: tuple[int, int]) -> None:
    scene = stacked(kind, by, counts, material=RUBBER, friction=0.3)
    supports = [Support("lower", "y0", (None, 0.0)), Support("upper", "y1", (None, -0.5))]
    state = solved(replace(scene, loads=[], supports=supports))
    stress = np.concatenate([state.gather_stress(name) for name in scene.bodies])
    assert np.abs(stress[:, [0, 2], [0, 2]]).max() < 1e-6
    assert np.ptp(stress[:, 1, 1]) < 1e-6
    np.testing.assert_allclose(state.contact.pressure, -stress[0, 1, 1], rtol=1e-6)
    force = state.resultants().contacts[0].force[1]
    assert force == pytest.approx(-force_of_uniaxial(0.75, 9 * np.pi), rel=1e-7)


@pytest.mark.parametrize("kind", ["quadrilateral", "quadrilateral9"])
def test_pressure_that_follows_inflates_a_tube_as_theory_says(kind: Kind) -> None:
    """Incompressible neo-Hookean tube in plane strain: p = ∫ μ (r²/R² − R²/r²) dr/r."""
    inner, outer, shear, opened = 2.0, 4.0, 1.0, 0.8
    mesh = rectangle((inner, 0), (outer, 1), (24, 2) if kind == "quadrilateral" else (6, 2))
    mesh = quadratic(mesh) if kind == "quadrilateral9" else mesh
    rubber = MooneyRivlin(shear / 2, 0.0, bulk_modulus=2e4, mean_dilatation=True)
    grown = (inner + opened) ** 2 - inner**2

    def share(R: float) -> float:
        r2 = R**2 + grown
        return shear * (r2 / R**2 - R**2 / r2) * R / r2

    inside = quad(share, inner, outer)[0]
    supports = [Support("tube", side, (None, 0.0)) for side in ("y0", "y1")]
    state = solved(
        Scene({"tube": Body(mesh, rubber, axisymmetric=True)}, supports, [Pressure("tube", "x0", inside)])
    )
    moved = state.gather_displacement("tube")[mesh.points[:, 0] == inner, 0]
    np.testing.assert_allclose(moved, opened, rtol={"quadrilateral": 5e-3, "quadrilateral9": 3e-4}[kind])


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    "metal",
    [
        FinitePlasticity(10.0, 0.3, 0.05, isotropic_hardening=1.0),
        J2Plasticity(10.0, 0.3, 0.05, isotropic_hardening=1.0),
        J2Plasticity(10.0, 0.3, 0.05, isotropic_hardening=1.0, mean_dilatation=True),
    ],
    ids=["finite", "small", "mean"],
)
def test_tangent_of_metal_is_that_of_its_force(kind: Kind, metal: HistoryMaterial) -> None:
    if getattr(metal, "mean_dilatation", False) and kind == "triangle":
        pytest.skip("refused")
    mesh = section((1.0, 0.0), (3.0, 1.0), (2, 1), kind)
    own = _dolfinx.local_mesh(mesh.points, mesh.cells, mesh.cell_type)
    space = _dolfinx.coefficient(own, "u").function_space
    element = Element(mesh.cell_type, Revolution())
    mechanics = HistoryMechanics(Composition((metal,)), element, space, mesh.points)
    u = 0.05 * np.sin(1.7 * np.arange(mesh.points.size) ** 1.3)
    way = np.cos(np.arange(u.size) ** 1.5)
    ahead, behind = (mechanics.at(u + sign * 1e-6 * way).force for sign in (1, -1))
    slope = (ahead - behind) / 2e-6
    np.testing.assert_allclose(mechanics.at(u).stiffness @ way, slope, atol=1e-5 * np.abs(slope).max())


def test_force_of_metal_without_yield_is_that_of_the_linear_form() -> None:
    mesh = section((0.5, 0.0), (3.0, 1.0), (2, 2), "quadrilateral")
    metal = J2Plasticity(10.0, 0.3, 1e6)
    own = _dolfinx.local_mesh(mesh.points, mesh.cells, mesh.cell_type)
    space = _dolfinx.coefficient(own, "u").function_space
    element = Element(mesh.cell_type, Revolution())
    mechanics = HistoryMechanics(Composition((metal,)), element, space, mesh.points)
    scene = Scene({"disc": Body(mesh, metal, axisymmetric=True)})
    forms = FormLibrary(MPI.COMM_SELF)
    forms.prepare(scene)
    _dolfinx.update_coordinates(own, mesh.points)
    indptr, indices, data = _dolfinx.assemble_csr(forms.stiffness(Composition((metal,)), element, space))
    stiffness = mechanics.at(np.zeros(mesh.points.size)).stiffness.toarray()
    expected = np.zeros_like(stiffness)
    expected[np.repeat(np.arange(len(expected)), np.diff(indptr)), indices] = data
    np.testing.assert_allclose(stiffness, expected, atol=1e-12 * np.abs(expected).max())


def turned(points: np.ndarray, facets: np.ndarray) -> FacetedSurface:
    surface = replace(faceted_surface(points, facets), measure=RevolvedMeasure())
    return replace(surface, areas=surface.areas_at(surface.points))


def test_mortar_derivatives_around_an_axis_are_those_of_difference_quotients() -> None:
    def wavy(count: int, low: float, high: float) -> np.ndarray:
        radii = np.linspace(low, high, count + 1)
        return np.column_stack([radii, 0.02 * np.sin(3 * radii)])

    def edges(count: int) -> np.ndarray:
        return np.column_stack([np.arange(count), np.arange(1, count + 1)])

    places, facets = (wavy(5, 0.1, 3.0), wavy(7, 0.0, 3.3)), (edges(5), edges(7)[:, ::-1])
    ways = tuple(np.random.default_rng(1).standard_normal(each.shape) for each in places)

    def at(step: float) -> tuple[FacetedSurface, FacetedSurface]:
        one, two = (turned(p + step * w, f) for p, w, f in zip(places, ways, facets, strict=True))
        return one, two

    slave, master = at(0.0)
    now = mortar_coupling(slave, master)
    ahead, behind = (mortar_coupling(*at(sign * 1e-6)) for sign in (1, -1))
    found = weight_derivatives(slave, master, now, np.ones(len(now.node), dtype=bool))
    ours = np.zeros(now.weight.shape)
    np.add.at(ours, (found.point, found.node), found.rows @ np.concatenate([way.ravel() for way in ways]))
    slopes = (ahead.weight - behind.weight).toarray() / 2e-6
    np.testing.assert_allclose(ours, slopes, atol=1e-6 * np.abs(slopes).max())
    count = len(now.node)
    by = CouplingDerivatives(
        area=np.cos(np.arange(count)),
        left=np.zeros((count, 0)),
        right=np.zeros((len(master.nodes), 0)),
        normal=np.zeros(now.normal.shape),
        gap=np.sin(np.arange(count)),
    )

    def value(coupling: MortarCoupling) -> float:
        return float(by.area @ coupling.area + by.gap @ coupling.gap)

    parts = mortar_pulled_back(slave, master, now, by)
    normals = (at(1e-6)[0].normals - at(-1e-6)[0].normals) / 2e-6
    total = sum(float((part.points * way).sum()) for part, way in zip(parts, ways, strict=True))
    total += float((parts[0].normals * normals).sum())
    assert total == pytest.approx((value(ahead) - value(behind)) / 2e-6, rel=1e-6)


def test_ring_squeezed_with_friction_converges_and_is_the_same_however_cut() -> None:
    """Contact by nodes, friction, a following pressure from inside."""
    scene = squeezed_ring()
    found = []
    for cuts in (1, 3):
        parts = {name: bisection_partition(body.mesh, cuts) for name, body in scene.bodies.items()}
        state = solved(scene, partitions=parts, tolerance=1e-10)
        assert len(state.solution.history) < 12 * cuts
        found.append((state.gather_displacement("ring"), state.resultants().contacts[0].force))
    np.testing.assert_allclose(found[1][0], found[0][0], atol=1e-7)
    np.testing.assert_allclose(found[1][1], found[0][1], rtol=1e-7)


RANKS = """
    import numpy as np
    from mpi4py import MPI
    from fenics_contact import solve_scene
    from tests.kinematics.revolved import squeezed_ring

    comm, scene = MPI.COMM_WORLD, squeezed_ring()
    state = solve_scene(scene, comm, partitions=scene.partition(4), tolerance=1e-10)
    moved = state.gather_displacement("ring")
    if comm.rank == 0:
        print(*(f"{x:.17g}" for x in (*moved.ravel(), *state.contact.pressure)))
"""


@pytest.mark.slow
def test_all_ranks_have_the_answer_of_one(mpirun: Callable[..., str]) -> None:
    one, two, four = (np.array(mpirun(RANKS, ranks).split(), dtype=float) for ranks in (1, 2, 4))
    for other in (two, four):
        np.testing.assert_allclose(other, one, atol=1e-7 * np.abs(one).max())
