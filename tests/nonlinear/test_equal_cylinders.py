"""Equal cylinders pressed far on one another, which symmetry compares with one cylinder on a plane."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import Body, BodyMesh, ContactPair, RigidPlane, Scene, Support, Surface
from fenics_contact.gallery import rectangle
from tests.nonlinear.mortar_scenes import followed
from tests.nonlinear.scenes import RUBBER

APPROACHES = (0.1, 0.2, 0.3, 0.4)


def cylinder(cells: int, up: bool) -> BodyMesh:
    """Right half of a piece of a cylinder of radius one, above the origin or below it."""
    mesh = rectangle((0.0, 0.0 if up else -1.0), (0.9, 1.0 if up else 0.0), (cells, cells))
    x, y = mesh.points.T
    height = 1.0 - np.sqrt(1.0 - x**2)
    return replace(mesh, points=np.column_stack([x, (height if up else -height) + (1.0 - height) * y]))


def on_plane(approach: float, cells: int) -> Scene:
    supports = [Support("upper", "x0", (0.0, None)), Support("upper", "y1", (0.0, -approach))]
    pair = ContactPair(Surface("upper", "y0"), RigidPlane((0, 0), (0, 1)))
    return Scene({"upper": Body(cylinder(cells, True), RUBBER)}, supports, contacts=[pair])


def on_another(approach: float, cells: tuple[int, int], way: str) -> Scene:
    bodies = {name: Body(cylinder(n, name == "upper"), RUBBER) for name, n in zip(("upper", "lower"), cells)}
    supports = [Support(name, "x0", (0.0, None)) for name in bodies]
    supports += [Support("upper", "y1", (0.0, -2.0 * approach)), Support("lower", "y0")]
    pair = ContactPair(Surface("upper", "y0"), Surface("lower", "y1"), None, way)  # type: ignore[arg-type]
    return Scene(bodies, supports, contacts=[pair])


@cache
def forces_on_plane(cells: int) -> np.ndarray:
    return forces([on_plane(approach, cells) for approach in APPROACHES])


def forces(scenes: list[Scene]) -> np.ndarray:
    states = followed(scenes, MPI.COMM_SELF, 1e-8)
    return np.array([state.contact.force[:, 1].sum() for state in states])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("way", "limit"), [("node", 0.015), pytest.param("mortar", 0.0005, marks=pytest.mark.claim)]
)
def test_two_cylinders_press_as_one_on_a_plane(way: str, limit: float) -> None:
    """Approaches of up to 0.4 radii each; meshes that do not match."""
    plane = forces_on_plane(20)
    assert plane[-1] > 9.0 * plane[0]
    both = forces([on_another(approach, (20, 28), way) for approach in APPROACHES])
    assert np.abs(both / plane - 1.0).max() < limit


@pytest.mark.parametrize("way", [pytest.param("node", marks=pytest.mark.claim), "mortar"])
def test_two_cylinders_with_the_same_mesh_press_as_one_on_a_plane(way: str) -> None:
    plane = forces_on_plane(10)[1::2]
    both = forces([on_another(approach, (10, 10), way) for approach in APPROACHES[1::2]])
    assert np.abs(both / plane - 1.0).max() < 0.002
