"""Plastic bodies against closed forms: a tube under pressure, and bars loaded, unloaded and reversed."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import scipy.sparse as sp
import scipy.sparse.linalg as spla
from scipy.optimize import brentq

from fenics_contact import Body, Pressure, Scene, Traction
from fenics_contact._fem.loads import as_tractions
from fenics_contact.feti.subdomain import assemble
from fenics_contact.gallery import rectangle
from fenics_contact.materials import FinitePlasticity, HistoryMaterial, J2Plasticity
from fenics_contact.mesh import quadratic
from tests.models.bodies import box
from tests.models.deformed import Patch, patch_of
from tests.models.monolithic import Equilibrium, dofs_at, equilibrium
from tests.scene.material_points import in_tension

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
