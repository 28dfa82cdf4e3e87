"""Derivatives of contact on surfaces that slide, and Newton's method with them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import dolfinx.fem
import dolfinx.fem.petsc
import numpy as np
import pytest
import scipy.sparse as sp
import scipy.sparse.linalg
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    DistanceObstacle,
    RigidCylinder,
    RigidSphere,
    Scene,
    Surface,
    _dolfinx,
)
from fenics_contact._pairing.sliding.contact import SlidingContact
from fenics_contact._pairing.sliding.points import SlidingPoints
from fenics_contact._pairing.sliding.stiffness import spread
from fenics_contact.gallery import rectangle
from fenics_contact.materials import NeoHooke
from fenics_contact.mesh import quadratic
from tests.conftest import run_on_ranks
from tests.fem.monolithic import _forms
from tests.pairing.sliding_on_ranks import collect
from tests.pairing.sliding_scenes import (
    KINDS,
    derivative_error,
    free,
    on_arch,
    ring,
    same_points,
    shaken,
    sliding,
)

STEP = 2e-6
OBSTACLES = {
    "cylinder": RigidCylinder((0.0, 0.0, -2.0), (0.0, 1.0, 0.2), 2.0),
    "sphere": RigidSphere((0.1, 0.0, -2.0), 2.0),
    "distance": DistanceObstacle(lambda x: np.linalg.norm(x - np.array([0.0, 0.0, -2.0]), axis=1) - 2.0),
}
#: Larger errors of difference quotients: the curvatures of a distance given by a function are differences
#: themselves, where a body meets itself some points lie near the centre of a patch's curvature, and third
#: derivatives of patches are large near their corners.
LIMITS = {"distance": 1e-4, "itself": 1e-5, "quadratic": 1e-6}
CASES = (*KINDS, *OBSTACLES, "facets", "itself", "quadratic")


@cache
def case(name: str) -> tuple[SlidingContact, np.ndarray]:
    """Return contact, and coordinates of bodies out of shape."""
    if name == "itself":
        scene = ring("hexahedron")
        return sliding(scene), shaken(scene, 0.005) * [1.2, 1.0, 0.3]
    if name == "quadratic":
        linear = on_arch("tetrahedron")
        bodies = {key: Body(quadratic(body.mesh), body.material) for key, body in linear.bodies.items()}
        scene = Scene(bodies, contacts=linear.contacts)
        return sliding(scene), shaken(scene, 0.005)
    if name in OBSTACLES:
        body = on_arch("hexahedron").bodies["high"]
        pair = ContactPair(Surface("high", "z0"), OBSTACLES[name])
        scene = Scene({"high": Body(body.mesh, body.material)}, contacts=[pair])
    else:
        kind = "hexahedron" if name == "facets" else name
        scene = on_arch(kind, geometry="faceted" if name == "facets" else "best")
    return sliding(scene), shaken(scene)


def normal_force(now: SlidingPoints, multiplier: np.ndarray) -> np.ndarray:
    """Return Bᵀ λ of the rows −n·(u_s − Σ w_j u_j)."""
    return np.asarray(-spread(now.points.normal, now.points.jump).T @ np.maximum(multiplier, 0.0))


def friction_force(now: SlidingPoints, friction: np.ndarray) -> np.ndarray:
    """Return Bᵀ τ of the rows t_a·(u_s − Σ w_j u_j)."""
    points = now.points
    rows = [spread(points.tangents[:, a], points.jump) for a in range(friction.shape[1])]
    return np.asarray(sum(row.T @ friction[:, a] for a, row in enumerate(rows)))


@cache
def beside(name: str) -> tuple[SlidingPoints, SlidingPoints, SlidingPoints, np.ndarray]:
    """Return the points, those a step away in a random direction on both sides, and the direction."""
    contact, x = case(name)
    way = np.random.default_rng(1).standard_normal(x.shape)
    now = contact.at(x)
    plus, minus = contact.at(x + STEP * way, now), contact.at(x - STEP * way, now)
    assert same_points(now, plus)
    assert same_points(now, minus)
    assert now.points.count >= 6
    assert len(now.lost) == 0
    return now, plus, minus, way.ravel()


error = partial(derivative_error, STEP)


@pytest.mark.parametrize("name", CASES)
def test_rows_are_the_derivative_of_the_gap(name: str) -> None:
    now, plus, minus, way = beside(name)
    rows = spread(now.points.normal, now.points.jump)
    assert error(rows @ way, plus.points.gap, minus.points.gap) < 1e-7


@pytest.mark.parametrize("name", CASES)
def test_stiffness_is_the_derivative_of_the_normal_forces(name: str) -> None:
    now, plus, minus, way = beside(name)
    multiplier = np.random.default_rng(2).uniform(-0.3, 1.0, now.points.count)
    found = now.stiffness(multiplier)
    limit = LIMITS.get(name, 1e-7)
    product = found.assembled() @ way
    assert error(product, normal_force(plus, multiplier), normal_force(minus, multiplier)) < limit


@pytest.mark.parametrize("name", KINDS)
def test_factors_of_the_stiffness_are_few_and_orthonormal(name: str) -> None:
    now = beside(name)[0]
    multiplier = np.where(np.arange(now.points.count) % 2, 1.0, 0.0)
    found = now.stiffness(multiplier)
    assert np.array_equal(np.unique(found.point), np.flatnonzero(multiplier))
    assert np.bincount(found.point).max() <= 2 * (now.points.normal.shape[1] - 1)
    first = found.columns[:, found.point == found.point[0]]
    assert (first.T @ first).toarray() == pytest.approx(np.eye(first.shape[1]), abs=1e-12)
    assert found.values.min() < 0 < found.values.max()
    assert len(found.block_node) == 0


@pytest.mark.parametrize("name", OBSTACLES)
def test_stiffness_of_obstacles_stays_on_the_slave_nodes(name: str) -> None:
    now = beside(name)[0]
    found = now.stiffness(np.ones(now.points.count))
    assert found.columns.shape[1] == 0
    assert np.array_equal(found.block_node, now.points.slave)
    # A round obstacle pushes less straight, the farther a node goes aside: a negative stiffness.
    assert np.linalg.eigvalsh(found.blocks)[:, 0] == pytest.approx(-0.5, rel=0.1)


@pytest.mark.parametrize("name", CASES)
def test_friction_stiffness_is_the_derivative_of_the_friction_forces(name: str) -> None:
    now, plus, minus, way = beside(name)
    friction = np.random.default_rng(4).standard_normal((now.points.count, now.points.normal.shape[1] - 1))
    found = now.friction_stiffness(friction)
    limit = LIMITS.get(name, 1e-7)
    product = found.left @ (found.right.T @ way)
    assert error(product, friction_force(plus, friction), friction_force(minus, friction)) < limit


@pytest.mark.parametrize("name", CASES)
def test_slip_rows_are_the_derivative_of_slip(name: str) -> None:
    now, plus, minus, way = beside(name)
    contact, x = case(name)
    aside = x.copy()
    if name == "itself":
        aside[:, 0] -= 0.1 * (aside[:, 2] > 0)
    else:
        aside[: contact.scene.bodies["high"].mesh.n_nodes, 0] -= 0.1
    start = contact.at(aside).material_points().extended(now.material_points())
    assert np.median(np.linalg.norm(now.slip(start), axis=1)) == pytest.approx(0.1, rel=0.2)
    limit = LIMITS.get(name, 1e-7)
    found = now.slip_rows(start) @ way
    assert error(found, plus.slip(start).ravel(), minus.slip(start).ravel()) < limit


# Newton's method on contact of moved bodies converges quadratically with all derivatives, else linearly.
def residuals(coefficient: float, terms: Terms) -> tuple[list[float], Dragged]:
    """Drag the block by most of its length over several facets; residuals of the last load step."""
    dragged = Dragged(on_arch("hexahedron", master_cells=10), coefficient, terms)
    facets = dragged.points.points.facet
    steps = [dragged.advance(way) for way in WAY]
    assert (dragged.points.points.facet != facets).mean() > 0.5
    assert np.count_nonzero(dragged.force) >= 8
    return steps[-1], dragged


@pytest.mark.parametrize("coefficient", [0.0, 0.3])
def test_newton_converges_quadratically(coefficient: float) -> None:
    found, _ = residuals(coefficient, Terms())
    assert found[-1] < 1e-10
    assert len(found) <= 8
    assert found[-2] < 20.0 * found[-3] ** 2 + 1e-11


def test_without_the_turning_of_normal_forces_it_converges_linearly() -> None:
    whole, _ = residuals(0.0, Terms())
    found, _ = residuals(0.0, Terms(normal=False))
    assert len(found) >= len(whole) + 4


def test_without_the_turning_of_friction_forces_it_needs_more_steps() -> None:
    whole, exact = residuals(0.3, Terms())
    found, other = residuals(0.3, Terms(friction=False))
    assert found[-1] < 1e-10
    assert len(found) > len(whole)
    assert other.u == pytest.approx(exact.u, abs=1e-8)


# A block dragged over an arched one by Newton's method on one mesh, contact where the bodies lie.

#: Prescribed motion of the upper block's upper side in each load step: down, then along the arch.
WAY = np.array([[0.02, 0.0, -0.02], [0.12, 0.03, -0.02], [0.12, 0.03, -0.004]])


@dataclass(frozen=True)
class Terms:
    """Which derivatives of the contact forces Newton's method knows."""

    normal: bool = True
    friction: bool = True


def stiffness(scene: Scene) -> sp.csr_matrix:
    """Return the stiffness of all bodies, linear elastic."""
    blocks = []
    for name, body in scene.bodies.items():
        mesh = _dolfinx.local_mesh(body.mesh.points, body.mesh.cells, body.mesh.cell_type)
        V = _dolfinx.coefficient(mesh, "u").function_space
        nodes, dofs = _dolfinx.node_dofs(V)
        matrix = dolfinx.fem.petsc.assemble_matrix(dolfinx.fem.form(_forms(scene, name, V)[0]))
        matrix.assemble()
        start, column, value = matrix.getValuesCSR()
        place = np.empty(body.mesh.n_nodes, dtype=np.int64)
        place[nodes] = dofs
        dof = (3 * place[:, None] + np.arange(3)).ravel()
        blocks.append(sp.csr_matrix((value, column, start))[dof][:, dof])
    return sp.block_diag(blocks, format="csr")


class Dragged:
    """Displacements and multipliers of the scene while it is dragged; all closed points slip."""

    def __init__(self, scene: Scene, coefficient: float, terms: Terms) -> None:
        self.scene, self.coefficient, self.terms = scene, coefficient, terms
        first = scene.bodies["high"].mesh.n_nodes
        self.driven = np.unique(scene.bodies["high"].mesh.surfaces["z1"])
        self.fixed = np.zeros(scene.points.shape, dtype=bool)
        self.fixed[self.driven] = True
        self.fixed[first + np.unique(scene.bodies["low"].mesh.surfaces["z0"])] = True
        self.matrix, self.contact = stiffness(scene), SlidingContact.of(scene, self.fixed)
        self.u = np.zeros(scene.points.shape)
        self.points = self.contact.at(scene.points)
        self.force = np.zeros(self.points.points.count)

    def advance(self, way: np.ndarray, most: int = 25) -> list[float]:
        """Move the driven side on and find the equilibrium; return the residual of each iterate."""
        self.u[self.driven] += way
        start, residuals = self.points.material_points(), []
        while len(residuals) < most:
            now = self.contact.at(self.scene.points + self.u, self.points)
            self.force, self.points = now.carry(self.force, self.points), now
            start = start.extended(now.material_points())
            residuals.append(self._step(now, now.slip(start), now.slip_rows(start)))
            if residuals[-1] < 1e-10:
                break
        return residuals

    def _step(self, now: SlidingPoints, slip: np.ndarray, slip_rows: sp.csr_matrix) -> float:
        points, free = now.points, np.flatnonzero(~self.fixed.ravel())
        closed = np.flatnonzero(self.force - 2.0 * points.gap > 0)
        force = np.zeros(points.count)
        force[closed] = self.force[closed]
        length = np.maximum(np.linalg.norm(slip, axis=1), 1e-12)[:, None]
        way = slip / length
        friction = self.coefficient * force[:, None] * way
        normal = -spread(points.normal, points.jump)
        along = [spread(points.tangents[:, a], points.jump) for a in range(2)]
        rubbing = sp.vstack(along).T.tocsr()
        rest = self.matrix @ self.u.ravel() + normal.T @ force + rubbing @ friction.T.ravel()
        error = max(np.abs(rest[free]).max(), np.abs(points.gap[closed]).max(initial=0.0))
        matrix = self.matrix
        if self.terms.normal:
            matrix = matrix + now.stiffness(force).assembled()
        if self.terms.friction:
            turned = now.friction_stiffness(friction)
            matrix = matrix + turned.left @ turned.right.T
        across = np.eye(2) - way[:, :, None] * way[:, None]
        bent = (self.coefficient * force[:, None] / length)[:, :, None] * across
        by_slip = sp.bmat([[sp.diags(bent[:, a, b]) for b in range(2)] for a in range(2)])
        matrix = matrix + rubbing @ by_slip @ sp.vstack([slip_rows[a::2] for a in range(2)])
        columns = normal.T + rubbing @ sp.vstack([sp.diags(self.coefficient * way[:, a]) for a in range(2)])
        system = [[matrix[free][:, free], columns.tocsr()[free][:, closed]], [normal[closed][:, free], None]]
        right = np.concatenate([-rest[free], points.gap[closed]])
        change = scipy.sparse.linalg.splu(sp.bmat(system, format="csc")).solve(right)
        self.u.ravel()[free] += change[: len(free)]
        force[closed] += change[len(free) :]
        self.force = force
        return float(error)


# Contact of moved bodies is the same on any number of ranks, and all ranks raise what one of them meets.
SCRIPT = Path(__file__).with_name("sliding_on_ranks.py")


@pytest.mark.parametrize("ranks", [2, 4])
def test_points_and_errors_do_not_depend_on_the_number_of_ranks(ranks: int, tmp_path: Path) -> None:
    run_on_ranks(SCRIPT, ranks, tmp_path / "numbers.npz", timeout=60)
    with np.load(tmp_path / "numbers.npz") as stored:
        parallel = dict(stored)
    messages = parallel.pop("messages")
    serial = collect(MPI.COMM_SELF)
    assert parallel.keys() == serial.keys()
    for name, values in serial.items():
        assert np.array_equal(parallel[name], values), name
    assert all("no idea" in message for message in messages)


# Gaps that pairs give in place of measured ones, between bodies that move far.
DISCRETISATIONS = ("node", "mortar")


def with_pair(scene: Scene, **given: Any) -> Scene:
    (pair,) = scene.contacts
    return replace(scene, contacts=[replace(pair, **given)])


def from_beside(**given: Any) -> tuple[SlidingContact, np.ndarray]:
    """A slider that overhangs the end of its bed, and coordinates that bring all of it onto the bed."""
    bed, slider = rectangle((0, 0), (4, 1), (16, 4)), rectangle((-1, 1), (0.6, 1.6), (8, 3))
    scene = Scene(
        {"bed": Body(bed, NeoHooke(1.0, 0.3)), "slider": Body(slider, NeoHooke(1.0, 0.3))},
        contacts=[ContactPair(Surface("slider", "y0"), Surface("bed", "y1"), **given)],
    )
    moved = scene.points.copy()
    moved[bed.n_nodes :, 0] += 1.5
    return sliding(scene), moved


@pytest.mark.parametrize("discretisation", DISCRETISATIONS)
@pytest.mark.parametrize("kind", ["hexahedron", "quadrilateral"])
def test_the_given_gap_is_that_of_the_undeformed_bodies(kind: str, discretisation: str) -> None:
    """Also where distances are means over facets, which differ from those of the true surfaces."""
    scene = with_pair(on_arch(kind), discretisation=discretisation)
    measured = sliding(scene).at(scene.points).points
    assert np.ptp(measured.gap) > (1e-3 if discretisation == "mortar" else 1e-10), "not even by itself"
    for given, wanted in (({"gap": 0.02}, 0.02), ({"interference": 0.01, "adjust": 0.1}, -0.01)):
        points = sliding(with_pair(scene, **given)).at(scene.points).points
        assert points.gap == pytest.approx(np.full(measured.count, wanted), abs=1e-15)
        assert np.array_equal(points.distance, measured.distance)
        assert points.given.all()
    apart = sliding(with_pair(scene, gap=0.02, adjust=0.01)).at(scene.points).points
    assert np.array_equal(apart.gap, measured.gap), "no node lies within adjust"
    assert not apart.given.any()


@pytest.mark.parametrize("discretisation", DISCRETISATIONS)
def test_nodes_that_meet_their_master_later_have_the_gap_of_those_beside_them(discretisation: str) -> None:
    for given, wanted in (({"interference": 0.02}, -0.02), ({"gap": 0.03}, 0.03), ({"adjust": 0.01}, 0.0)):
        contact, moved = from_beside(discretisation=discretisation, **given)
        now, then = contact.at(contact.scene.points), contact.at(moved)
        assert now.points.count < then.points.count == 9
        assert then.points.gap == pytest.approx(np.full(9, wanted), abs=1e-13)
        declared = True if "adjust" not in given else np.isin(then.key, now.key)
        assert np.array_equal(then.points.given, np.full(9, True) & declared)
    contact, moved = from_beside(discretisation=discretisation, gap=lambda x: 0.01 * (2.0 + x[:, 0]))
    points = contact.at(moved).points
    assert points.gap == pytest.approx(0.01 * (2.0 + contact.scene.points[points.slave, 0]), abs=1e-13)


def test_what_a_design_moves_is_added_to_the_given_gap() -> None:
    scene = with_pair(on_arch("quadrilateral"), gap=0.02, discretisation="mortar")
    mesh = scene.bodies["high"].mesh
    moved = scene.reshaped({"high": mesh.points + 0.01 * np.sin(3.0 * mesh.points[:, :1])})
    before, after = (SlidingContact.of(each, free(each)).at(each.points).points for each in (scene, moved))
    change = after.distance - before.distance
    assert np.abs(change).max() > 1e-3
    assert after.gap - before.gap == pytest.approx(change, abs=1e-14)
