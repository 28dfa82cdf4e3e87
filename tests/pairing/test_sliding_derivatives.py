"""Derivatives of contact points in the current configuration agree with central differences."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from fenics_contact import Body, ContactPair, DistanceObstacle, RigidCylinder, RigidSphere, Scene, Surface
from fenics_contact._pairing.sliding.contact import SlidingContact
from fenics_contact._pairing.sliding.points import SlidingPoints
from fenics_contact._pairing.sliding.stiffness import spread
from fenics_contact.mesh import quadratic
from tests.pairing.sliding_scenes import KINDS, on_arch, ring, same_points, shaken, sliding

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


def error(found: np.ndarray, plus: np.ndarray, minus: np.ndarray) -> float:
    """Return the largest error relative to the difference quotient."""
    quotient = (plus - minus) / (2 * STEP)
    size = np.abs(quotient).max()
    assert size > 1e-2
    return float(np.abs(found - quotient).max() / size)


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
