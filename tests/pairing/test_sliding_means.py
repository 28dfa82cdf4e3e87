"""Mortar contact where bodies lie now: derivatives of gaps and forces, slip, and turned scenes."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from fenics_contact._pairing.sliding.contact import SlidingContact
from fenics_contact._pairing.sliding.points import SlidingPoints
from fenics_contact._pairing.sliding.stiffness import spread
from tests.pairing.sliding_scenes import KINDS, on_arch, rotation, shaken, sliding

STEP = 1e-6


@cache
def by_mortar(kind: str) -> tuple[SlidingContact, np.ndarray]:
    scene = on_arch(kind)
    scene = replace(scene, contacts=[replace(scene.contacts[0], discretisation="mortar")])
    return sliding(scene), shaken(scene)


@cache
def beside(kind: str) -> tuple[SlidingPoints, SlidingPoints, SlidingPoints, np.ndarray]:
    """Return the points, those a step away in a random direction on both sides, and the direction."""
    contact, x = by_mortar(kind)
    way = np.random.default_rng(1).standard_normal(x.shape)
    now, plus, minus = (contact.at(x + sign * STEP * way) for sign in (0, 1, -1))
    assert np.array_equal(now.key, plus.key)
    assert now.points.count >= 6
    return now, plus, minus, way.ravel()


def forces(now: SlidingPoints) -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng(2)
    count, dim = now.points.normal.shape
    return random.uniform(0.3, 1.0, count), random.uniform(-1.0, 1.0, (count, dim - 1))


def error(found: np.ndarray, plus: np.ndarray, minus: np.ndarray) -> float:
    """Return the largest error relative to the difference quotient."""
    quotient = (plus - minus) / (2 * STEP)
    size = np.abs(quotient).max()
    assert size > 1e-2
    return float(np.abs(found - quotient).max() / size)


@pytest.mark.parametrize("kind", KINDS)
def test_rows_and_what_they_lack_are_the_derivative_of_the_gap(kind: str) -> None:
    now, plus, minus, way = beside(kind)
    rows = spread(now.points.normal, now.points.jump)
    lacking = now.mean_tangents(*forces(now), now.material_points())
    assert error((rows + lacking.gap) @ way, plus.points.gap, minus.points.gap) < 1e-7
    assert error(rows @ way, plus.points.gap, minus.points.gap) > 1e-3


@pytest.mark.parametrize("kind", KINDS)
def test_stiffness_is_the_derivative_of_the_forces(kind: str) -> None:
    now, plus, minus, way = beside(kind)
    normal, friction = forces(now)
    found = now.mean_tangents(normal, friction, now.material_points()).stiffness

    def force(at: SlidingPoints) -> np.ndarray:
        total = np.einsum("na,nad->nd", friction, at.points.tangents) - normal[:, None] * at.points.normal
        return (at.points.jump.T @ total).ravel()

    assert error(found.left @ (found.right.T @ way), force(plus), force(minus)) < 1e-7


@pytest.mark.parametrize("kind", KINDS)
def test_rows_of_slip_are_its_derivative(kind: str) -> None:
    contact, x = by_mortar(kind)
    before = x.copy()
    before[: contact.scene.bodies["high"].mesh.n_nodes, 0] -= 0.1
    start = contact.at(before).material_points()
    now, plus, minus, way = beside(kind)
    found = (now.slip_rows(start) @ way).reshape(-1, contact.scene.dim - 1)
    assert error(found, plus.slip(start), minus.slip(start)) < 1e-7
    points, width = now.points, contact.scene.dim - 1
    rows = [spread(points.tangents[:, a], points.jump) @ way for a in range(width)]
    lacking = now.mean_tangents(*forces(now), start).slip @ way
    assert np.column_stack(rows).ravel() + lacking == pytest.approx(found.ravel(), abs=1e-12)


@pytest.mark.parametrize("kind", KINDS)
def test_turned_scenes_have_the_turned_answer(kind: str) -> None:
    contact, x = by_mortar(kind)
    later = x.copy()
    later[: contact.scene.bodies["high"].mesh.n_nodes, 0] += 0.06
    start, now = contact.at(x).material_points(), contact.at(later)
    wanted = np.einsum("na,nad->nd", now.slip(start), now.points.tangents)
    assert np.linalg.norm(wanted, axis=1) == pytest.approx(0.06, rel=0.3)
    turn = rotation(contact.scene.dim, 1.1)
    turned = contact.at(later @ turn.T - 0.2)
    assert np.array_equal(turned.key, now.key)
    assert turned.points.gap == pytest.approx(now.points.gap, abs=1e-12)
    found = np.einsum("na,nad->nd", turned.slip(start), turned.points.tangents)
    assert found == pytest.approx(wanted @ turn.T, abs=1e-12)
