"""Materials with a history, and plastic bodies."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest
import scipy.sparse as sp
import scipy.sparse.linalg as spla
from mpi4py import MPI
from scipy.optimize import brentq

from fenics_contact import Body, Pressure, Scene, Traction
from fenics_contact._fem.composition import composition
from fenics_contact._fem.forms import FormLibrary
from fenics_contact._fem.kinematics import GaussPoints
from fenics_contact._fem.loads import as_tractions
from fenics_contact._fem.mechanics import History, MaterialStep, Mechanics, Response
from fenics_contact.errors import InvalidInputError
from fenics_contact.feti.subdomain import SubdomainMesh, assemble, cut_out
from fenics_contact.gallery import rectangle
from fenics_contact.materials import (
    FinitePlasticity,
    HistoryMaterial,
    IsotropicElasticity,
    J2Plasticity,
    NeoHooke,
)
from fenics_contact.mesh import quadratic
from tests.materials.bodies import box, in_halves
from tests.materials.deformed import Patch, patch_of, skew_patch, smooth_field
from tests.scene.material_points import in_tension

CELLS = ("triangle6", "quadrilateral", "tetrahedron", "hexahedron", "tetrahedron10")
SMALL = J2Plasticity(200.0, 0.3, 1.0, 2.0, 5.0)
LARGE = FinitePlasticity(200.0, 0.3, 1.0, 2.0)
MEAN = replace(SMALL, mean_dilatation=True)
BY_MEANS = ("triangle6", "quadrilateral", "hexahedron", "tetrahedron10")
BY_PROJECTIONS = (*BY_MEANS, "quadrilateral9", "hexahedron27")


def answer(patch: Patch, u: np.ndarray, history: np.ndarray | None = None) -> Response:
    return patch.mechanics.at(np.asarray(u).ravel(), MaterialStep(history))


@pytest.mark.parametrize(
    ("material", "cell"),
    [*((m, cell) for m in (SMALL, LARGE) for cell in CELLS), *((MEAN, cell) for cell in BY_PROJECTIONS)],
)
def test_stiffness_is_the_derivative_of_the_force(material: HistoryMaterial, cell: str) -> None:
    patch = patch_of(Body(skew_patch(cell), material))
    u = smooth_field(patch.points, 0.1)
    history = answer(patch, u).history
    assert (history[..., 6] > 1e-3).all()
    further = 1.4 * u + smooth_field(patch.points[:, ::-1], 0.03)
    here, direction = answer(patch, further, history), np.cos(np.arange(u.size) ** 1.5)
    ahead, behind = (answer(patch, further.ravel() + s * 1e-6 * direction, history) for s in (1, -1))
    quotient, exact = (ahead.force - behind.force) / 2e-6, here.stiffness @ direction
    assert np.abs(quotient - exact).max() < 1e-7 * np.abs(exact).max()
    assert here.energy is None
    assert 0 < here.least_jacobian < 1
    assert here.history.shape == (patch.body.mesh.n_cells, here.history.shape[1], 7)


@pytest.mark.parametrize("cell", CELLS)
def test_a_rotation_costs_only_what_stresses_take_to_turn_with_it(cell: str) -> None:
    """Materials do not resist it: K ω×x is that of the stresses, of whatever size these are."""
    patch = patch_of(Body(skew_patch(cell), LARGE))
    u = smooth_field(patch.points, 0.2)
    found, about_z = answer(patch, u), np.zeros(u.shape)
    about_z[:, 0], about_z[:, 1] = -(patch.points + u)[:, 1], (patch.points + u)[:, 0]
    whole, turning = (K @ about_z.ravel() for K in (found.stiffness, found.by_stress()))
    assert np.abs(turning).max() > 1e-3 * np.abs(found.stiffness).max()
    np.testing.assert_allclose(whole, turning, atol=1e-11 * np.abs(found.stiffness).max())
    small = answer(patch_of(Body(skew_patch(cell), SMALL)), u)
    assert small.by_stress().nnz == small.stiffness.nnz
    assert np.abs(small.by_stress()).max() == 0.0
    mixed = Body(in_halves(skew_patch(cell)), {"left": LARGE, "right": NeoHooke(1.0, 0.3)})
    assert answer(patch_of(mixed), u).by_stress is None


@pytest.mark.parametrize("cell", CELLS)
def test_the_unloaded_body_is_linearly_elastic_of_one_pattern(cell: str) -> None:
    patch = patch_of(Body(skew_patch(cell), LARGE))
    first, linear = answer(patch, np.zeros(patch.mesh.size)), patch.linear_stiffness()
    assert np.abs(first.force).max() == 0.0
    np.testing.assert_allclose(first.stiffness.toarray(), linear, atol=1e-12 * np.abs(linear).max())
    later = answer(patch, smooth_field(patch.points))
    np.testing.assert_array_equal(later.stiffness.indices, first.stiffness.indices)
    assert np.abs(later.stiffness.toarray() - linear).max() > 0.1 * np.abs(linear).max()


@pytest.mark.parametrize("cell", BY_MEANS)
def test_points_of_a_cell_feel_its_mean_change_of_volume(cell: str) -> None:
    whole, mean = (patch_of(Body(skew_patch(cell), material)) for material in (SMALL, MEAN))
    u = smooth_field(whole.points, 0.02)
    pressures = [np.trace(answer(patch, u).stress, axis1=2, axis2=3) for patch in (whole, mean)]
    assert np.ptp(pressures[0], axis=1).min() > 0.01 * np.abs(pressures[0]).max()
    # What quadratic tetrahedra keep of the variation at points has a bulk modulus of G/50.
    bulk, shear = 200.0 / 3 / 0.4, 200.0 / 2.6
    kept = np.sqrt(0.02 * shear / bulk) if cell == "tetrahedron10" else 0.0
    size = np.abs(pressures[1]).max()
    np.testing.assert_allclose(
        np.ptp(pressures[1], axis=1), kept * np.ptp(pressures[0], axis=1), atol=1e-12 * size
    )
    # Where the strain is the same everywhere, it is its own mean.
    even = whole.points @ np.full((whole.points.shape[1],) * 2, 0.01)
    forces = [answer(patch, even).force for patch in (whole, mean)]
    np.testing.assert_allclose(forces[1], forces[0], atol=1e-12 * np.abs(forces[0]).max())


def test_means_of_large_strain_and_of_cells_without_variation_are_refused() -> None:
    class Soft(J2Plasticity):
        finite = True

    with pytest.raises(InvalidInputError, match="needs small strain, Soft is for large ones"):
        Body(skew_patch("hexahedron"), Soft(200.0, 0.3, 1.0, mean_dilatation=True))
    with pytest.raises(InvalidInputError, match="got tetrahedra, which lock"):
        Body(skew_patch("tetrahedron"), MEAN)


def test_forces_are_in_equilibrium_and_turn_with_the_body() -> None:
    patch = patch_of(Body(skew_patch("hexahedron"), LARGE))
    u = smooth_field(patch.points, 0.2)
    first = answer(patch, u)
    Q = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    forces = first.force.reshape(-1, 3)
    size = np.abs(forces).max()
    np.testing.assert_allclose(forces.sum(axis=0), 0.0, atol=1e-12 * size)
    np.testing.assert_allclose(np.cross(patch.points + u, forces).sum(axis=0), 0.0, atol=1e-11 * size)
    turned = answer(patch, (patch.points + u) @ Q.T - patch.points, first.history)
    np.testing.assert_allclose(turned.force.reshape(-1, 3), forces @ Q.T, atol=1e-10 * size)
    np.testing.assert_allclose(turned.history, first.history, atol=1e-12)
    np.testing.assert_allclose(turned.stress, Q @ first.stress @ Q.T, atol=1e-9 * np.abs(first.stress).max())
    np.testing.assert_allclose(first.stress, first.stress.swapaxes(2, 3), atol=1e-12)
    deviator = first.stress - np.trace(first.stress, axis1=2, axis2=3)[..., None, None] / 3 * np.eye(3)
    F = np.eye(3) + GaussPoints(patch.mesh.space, patch.body.element, patch.points).gradient(u.ravel())
    equivalent = np.sqrt(1.5) * np.linalg.norm(deviator, axis=(2, 3)) * np.linalg.det(F)
    law = LARGE.yield_stress + LARGE.isotropic_hardening * first.history[..., 6]
    np.testing.assert_allclose(equivalent, law, rtol=1e-9)


@pytest.mark.parametrize(
    "other", [IsotropicElasticity(50.0, 0.2), NeoHooke(50.0, 0.2)], ids=["linear", "neo"]
)
def test_bodies_of_several_materials_add_them_up(other: IsotropicElasticity | NeoHooke) -> None:
    mesh = in_halves(skew_patch("hexahedron"))
    lower, upper = mesh.regions
    mixed = patch_of(Body(mesh, {lower: LARGE, upper: other}))
    u = smooth_field(mixed.points, 0.1)
    found = answer(mixed, u)
    alone = patch_of(Body(mesh, LARGE)).mechanics.at(u.ravel()).history
    here = np.isin(mixed.mesh.cells, mesh.regions[lower])
    assert 0 < here.sum() < len(here)
    np.testing.assert_allclose(found.history[here], alone[here], atol=1e-14)
    assert not found.history[~here].any()
    assert np.isnan(found.stress[~here]).all()
    assert np.isfinite(found.stress[here]).all()
    direction = np.cos(np.arange(u.size) ** 1.5)
    ahead, behind = (answer(mixed, u.ravel() + s * 1e-6 * direction) for s in (1, -1))
    exact = found.stiffness @ direction
    assert np.abs((ahead.force - behind.force) / 2e-6 - exact).max() < 1e-7 * np.abs(exact).max()
    swapped, whole = patch_of(Body(mesh, {lower: other, upper: LARGE})), patch_of(Body(mesh, LARGE))
    again, expected = (answer(each, -u, answer(each, u).history) for each in (swapped, whole))
    np.testing.assert_allclose(again.history[~here], expected.history[~here], atol=1e-14)
    one_and_other = patch_of(Body(mesh, {lower: LARGE, upper: replace(LARGE, yield_stress=0.5)}))
    more = answer(one_and_other, u)
    np.testing.assert_allclose(more.history[here], alone[here], atol=1e-14)
    assert (more.history[~here, :, 6] > alone[~here, :, 6]).all()


def parts_of(body: Body, halves: np.ndarray, forms: FormLibrary) -> list[tuple[SubdomainMesh, Mechanics]]:
    meshes = [cut_out(k, "body", body, np.flatnonzero(halves == k), {}) for k in range(2)]
    return [
        (
            mesh,
            forms.mechanics(
                composition(body, mesh.cells),
                body.element,
                mesh.space,
                body.mesh.points[np.sort(mesh.nodes)],
            ),
        )
        for mesh in meshes
    ]


@pytest.mark.parametrize("cell", ["hexahedron", "tetrahedron10", "triangle6"])
def test_the_history_does_not_depend_on_the_subdomains(cell: str) -> None:
    patch = patch_of(Body(skew_patch(cell), LARGE))
    scene = Scene({"body": patch.body})
    field = np.empty_like(patch.points)
    field[patch.mesh.nodes] = smooth_field(patch.points, 0.1)
    whole = answer(patch, field[patch.mesh.nodes])
    start = History.unloaded(scene)
    unloaded = start.values["body"]
    kept = start.advanced(MPI.COMM_SELF, [("body", patch.mesh.cells, whole.history)])
    for halves in (np.arange(patch.body.mesh.n_cells) % 2, np.arange(patch.body.mesh.n_cells) < 1):
        parts = parts_of(patch.body, halves, patch.forms)
        new = [
            (
                mesh.body,
                mesh.cells,
                mechanics.at(field[mesh.nodes].ravel(), MaterialStep(unloaded[mesh.cells])).history,
            )
            for mesh, mechanics in parts
        ]
        np.testing.assert_allclose(
            start.advanced(MPI.COMM_SELF, new).values["body"], kept.values["body"], atol=1e-13
        )
    assert kept.values["body"][..., 6].min() > 1e-3
    assert not start.values["body"].any()


def test_a_history_of_something_else_is_refused() -> None:
    body = Body(box("hexahedron", (2, 1, 1)), SMALL)
    patch = patch_of(body)
    with pytest.raises(InvalidInputError, match=r"must have shape \(2, 8, 7\).*got \(3, 8, 7\)"):
        patch.mechanics.at(np.zeros(patch.mesh.size), MaterialStep(np.zeros((3, 8, 7))))


def test_bodies_without_memory_have_no_history() -> None:
    scene = Scene({"body": Body(box("hexahedron", (1, 1, 1)), IsotropicElasticity(1.0, 0.3))})
    history = History.unloaded(scene)
    assert not history.values


# Plastic bodies against closed forms: a tube under pressure, and bars loaded, unloaded and reversed.
INNER, OUTER = 100.0, 200.0
METAL = J2Plasticity(210.0, 0.3, 0.24)
#: Yields from 0.1 on, collapses at 0.192.
PRESSURES = (0.1, 0.12, 0.14, 0.16, 0.18)


def quarter_of_a_tube(cells: int, order: int, metal: J2Plasticity) -> Patch:
    mesh = rectangle((0, 0), (1, 1), (cells, cells))
    mesh = mesh if order == 1 else quadratic(mesh)
    radius, angle = INNER + (OUTER - INNER) * mesh.points[:, 0], np.pi / 2 * mesh.points[:, 1]
    points = radius[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    return patch_of(Body(mesh.moved(points), metal))


@cache
def expansions(cells: int, order: int, metal: J2Plasticity = METAL) -> tuple[np.ndarray, Equilibrium | None]:
    """Radial displacement of the outer surface under each of the pressures, in succession."""
    patch = quarter_of_a_tube(cells, order, metal)
    surfaces = patch.body.mesh.surfaces
    scene = Scene({"body": patch.body}, loads=[Pressure("body", "x0", 1.0)])
    patch.forms.prepare(scene)
    load = assemble(patch.mesh, patch.body, as_tractions(scene), patch.forms).load
    held = {int(dof): 0.0 for dof in (*dofs_at(patch, surfaces["y0"], 1), *dofs_at(patch, surfaces["y1"], 0))}
    outer, found, last = dofs_at(patch, surfaces["x1"], 0) // 2, [], None
    for pressure in PRESSURES:
        last = equilibrium(patch, held, pressure * load, last)
        moved = last.displacement.reshape(-1, 2)[outer]
        found.append(float(np.mean(np.einsum("ni,ni->n", moved, patch.points[outer]) / OUTER)))
    return np.array(found), last


def by_hill(pressure: float) -> float:
    """The expansion after Hill, who takes Tresca's yield function."""
    E, nu, flow = METAL.young_modulus, METAL.poisson_ratio, 2 * METAL.yield_stress / np.sqrt(3)
    if pressure <= flow / 2 * (1 - (INNER / OUTER) ** 2):
        return 2 * pressure * OUTER * (1 - nu**2) / (E * ((OUTER / INNER) ** 2 - 1))

    def missing(front: float) -> float:
        return flow * (np.log(front / INNER) + 0.5 * (1 - (front / OUTER) ** 2)) - pressure

    front = brentq(missing, INNER, OUTER)
    return flow * front**2 * (1 - nu**2) / (E * OUTER)


@cache
def radial(cells: int = 400) -> np.ndarray:
    """The same expansions by linear elements along the radius alone."""
    r = np.linspace(INNER, OUTER, cells + 1)
    h, gauss = r[1] - r[0], np.array([0.5 - 0.5 / np.sqrt(3), 0.5 + 0.5 / np.sqrt(3)])
    at = r[:-1, None] + h * gauss
    # Radial and hoop strain by the two displacements of a cell, (cells, points, 2, 2).
    B = np.stack(
        [np.broadcast_to([-1 / h, 1 / h], (cells, 2, 2)), np.stack([1 - gauss, gauss], -1) / at[..., None]],
        axis=2,
    )
    dofs = np.arange(cells)[:, None] + [0, 1]
    u, history, found = np.zeros(cells + 1), np.zeros((2 * cells, 7)), []
    for pressure in PRESSURES:
        for _ in range(25):
            gradient = np.zeros((cells, 2, 3, 3))
            gradient[..., [0, 1], [0, 1]] = np.einsum("cqsa,ca->cqs", B, u[dofs])
            end = METAL.answer(gradient.reshape(-1, 3, 3), history, 0.0)
            stress = end.stress.reshape(cells, 2, 3, 3)[..., [0, 1], [0, 1]]
            moduli = end.tangent[:, [[0], [1]], [[0], [1]], [0, 1], [0, 1]].reshape(cells, 2, 2, 2)
            weight = at * h / 2
            rest = -np.bincount(dofs.ravel(), np.einsum("cq,cqs,cqsa->ca", weight, stress, B).ravel())
            rest[0] += pressure * INNER
            if np.abs(rest).max() < 1e-11 * INNER:
                break
            K = np.einsum("cq,cqsa,cqst,cqtb->cab", weight, B, moduli, B)
            rows, columns = np.repeat(dofs, 2, axis=1).ravel(), np.tile(dofs, 2).ravel()
            u = u + spla.spsolve(sp.csc_matrix((K.ravel(), (rows, columns))), rest)
        else:
            raise AssertionError("no equilibrium along the radius")
        history = end.history
        found.append(u[-1])
    return np.array(found)


def test_a_tube_under_pressure_expands_as_hill_says() -> None:
    found, last = expansions(4, 2)
    expected = np.array([by_hill(pressure) for pressure in PRESSURES])
    np.testing.assert_allclose(found, expected, rtol=0.006)
    flows = last.response.history[..., 6]
    assert 0.5 < np.mean(flows > 0) < 0.7
    assert found[-1] > 1.4 * found[0] * PRESSURES[-1] / PRESSURES[0]


def test_the_expansion_of_the_tube_converges_with_order_two() -> None:
    exact = radial()
    errors = np.array([np.abs(expansions(cells, 1)[0] / exact - 1).max() for cells in (4, 8, 16)])
    assert errors[0] < 0.08
    assert np.log2(errors[0] / errors[2]) / 2 > 1.7
    assert np.abs(expansions(8, 2)[0] / exact - 1).max() < 1e-3


def cook(material: HistoryMaterial, cells: int, order: int = 1) -> float:
    """How far the upper corner of Cook's membrane moves under a shear force of 1."""
    mesh = rectangle((0, 0), (1, 1), (cells, cells))
    x, y = mesh.points.T
    mesh = mesh.moved(np.column_stack([48 * x, 44 * x + y * (44 - 28 * x)]))
    patch = patch_of(Body(mesh if order == 1 else quadratic(mesh), material))
    scene = Scene({"body": patch.body}, loads=[Traction("body", "x1", (0.0, 1 / 16))])
    patch.forms.prepare(scene)
    load = assemble(patch.mesh, patch.body, as_tractions(scene), patch.forms).load
    held = {int(dof): 0.0 for c in (0, 1) for dof in dofs_at(patch, patch.body.mesh.surfaces["x0"], c)}
    tip = 2 * int(np.argmin(np.linalg.norm(patch.points - [48.0, 60.0], axis=1))) + 1
    return float(equilibrium(patch, held, load).displacement[tip])


def test_mean_dilatations_do_not_lock() -> None:
    stiff = J2Plasticity(1.0, 0.4999, 1e9)
    means = replace(stiff, mean_dilatation=True)
    expected = cook(stiff, 16, 2)
    assert cook(stiff, 16) < 0.35 * expected
    errors = [1 - cook(means, cells) / expected for cells in (4, 8, 16)]
    assert errors[0] < 0.15
    assert errors[1] < 0.04
    assert abs(errors[2]) < 0.01


def test_mean_dilatations_halve_the_error_of_plastic_flow() -> None:
    metal, exact = replace(METAL, mean_dilatation=True), radial()
    points, means = (np.abs(expansions(8, 1, each)[0] / exact - 1).max() for each in (METAL, metal))
    assert means < 0.6 * points


def test_newton_converges_quadratically_on_the_consistent_tangent() -> None:
    *_, before, last = expansions(8, 2)[1].residuals
    assert before < 1e-3
    assert last < max(100 * before**2, 1e-11)


@pytest.mark.parametrize(
    ("material", "size"),
    [
        (J2Plasticity(200.0, 0.3, 0.2, 2.0, 10.0, 0.3, 50.0), 0.01),
        (FinitePlasticity(200.0, 0.3, 0.2, 2.0, 0.3, 50.0), 0.2),
    ],
    ids=["small", "large"],
)
def test_a_bar_loaded_unloaded_and_reversed_follows_the_point_in_tension(
    material: HistoryMaterial, size: float
) -> None:
    path = size * np.array([0.05, 1.0, 0.99, 0.5, -0.5])
    mesh = box("hexahedron", (2, 2, 2))
    points = mesh.points.copy()
    inside = np.setdiff1d(
        np.arange(mesh.n_nodes), np.concatenate([facets.ravel() for facets in mesh.surfaces.values()])
    )
    points[inside] += [0.1, -0.08, 0.05]
    patch = patch_of(Body(mesh.moved(points), material))
    surfaces, length = mesh.surfaces, np.ptp(points, axis=0)
    sides = [
        int(dof)
        for axis, name in enumerate(("x0", "y0", "z0"))
        for dof in dofs_at(patch, surfaces[name], axis)
    ]
    pulled = dofs_at(patch, surfaces["x1"], 0)
    expected, histories = in_tension(material, path)
    last = None
    for stretch, stress, history in zip(path, expected, histories, strict=True):
        held = dict.fromkeys(sides, 0.0) | {int(dof): stretch * length[0] for dof in pulled}
        last = equilibrium(patch, held, start=last, tolerance=1e-12)
        force = last.response.force[pulled].sum() / (length[1] * length[2])
        assert force == pytest.approx(stress, rel=1e-8)
        np.testing.assert_allclose(last.response.history, np.broadcast_to(history, (8, 8, 7)), atol=1e-9)
    assert len(inside) == 1
    assert expected[1] > 0 > expected[-1]


# Newton's method on one mesh as a whole: reference solutions of bodies with nonlinear materials.
@dataclass(frozen=True)
class Equilibrium:
    """Displacement by dof, what the body answers to it, and the residual of each Newton step."""

    displacement: np.ndarray
    response: Response
    residuals: list[float]


def dofs_at(patch: Patch, nodes: np.ndarray, component: int) -> np.ndarray:
    """Dofs of one component at nodes of the body."""
    return patch.mesh.components * np.flatnonzero(np.isin(patch.mesh.nodes, nodes)) + component


def equilibrium(
    patch: Patch,
    prescribed: dict[int, float],
    load: np.ndarray | float = 0.0,
    start: Equilibrium | None = None,
    tolerance: float = 1e-10,
) -> Equilibrium:
    """Find the displacement after a step from ``start``.

    Args:
        patch: The body.
        prescribed: Dof to displacement.
        load: External force by dof.
        start: The last step, None for the unloaded body.
        tolerance: Of the residual, relative to the internal forces.
    """
    free = np.setdiff1d(np.arange(patch.mesh.size), list(prescribed))
    u = np.zeros(patch.mesh.size) if start is None else start.displacement.copy()
    history = None if start is None else start.response.history
    change = np.zeros_like(u)
    for dof, value in prescribed.items():
        change[dof] = value - u[dof]
    residuals: list[float] = []
    for _ in range(25):
        found = patch.mechanics.at(u, MaterialStep(history))
        rest = load - found.force - found.stiffness @ change
        size = max(np.abs(found.force).max(), np.abs(load).max(), np.abs(rest).max())
        residuals.append(float(np.abs(rest[free]).max(initial=0.0) / size))
        if residuals[-1] < tolerance and not change.any():
            return Equilibrium(u, found, residuals)
        inner = found.stiffness[free][:, free].tocsc()
        change[free] = spla.spsolve(inner, rest[free])
        u, change = u + change, np.zeros_like(u)
    raise AssertionError(f"no equilibrium: {residuals}")
