"""Refined curved bodies keep valid cells, and rims of surfaces lie on both of them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import block, disc, half_disc, hemisphere, rectangle
from fenics_contact.mesh import quadratic, refined, scaled_jacobian
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.mesh.quality import thickness
from fenics_contact.shapes import Cylinder, Plane, Sphere, Torus
from fenics_contact.shapes.combined import Joined
from fenics_contact.shapes.simple import SurfaceShape

BALL, BARREL = Sphere((0.5, 0.5, -4.0), 5.0), Cylinder((-1.0, 0.5, 0.0), (0.0, 0.0, 1.0), 3.0)


def triangles(mesh: BodyMesh) -> BodyMesh:
    halves = mesh.cells[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3)
    return BodyMesh(mesh.points, halves, mesh.surfaces, shapes=mesh.shapes)


#: Layers thinner than the distance between their coarse facets and the surface, on its inner or outer side.
THIN = {
    "half a disc": lambda: half_disc(1.0, 2, symmetry="", grading=2.0),
    "half a ball": lambda: hemisphere(1.0, 2, symmetry="x", grading=2.0),
    "ring": lambda: disc(1.0, 2, hole=0.99),
    "ring of triangles": lambda: triangles(disc(1.0, 2, hole=0.9)),
    "disc of quadratic triangles": lambda: quadratic(triangles(disc(1.0, 2))),
}


@pytest.mark.parametrize("body", THIN)
def test_cells_stay_good_where_one_spot_is_refined_again_and_again(body: str) -> None:
    """Before, nodes on the surface left those of the next layer behind them."""
    mesh = first = THIN[body]()
    spot = mesh.points[mesh.surfaces[min(mesh.shapes)][0]].mean(axis=0)
    for _ in range(5):
        away = np.linalg.norm(mesh.points[mesh.cells].mean(axis=1) - spot, axis=1)
        mesh = refined(mesh, np.argsort(away)[:4]).mesh
    assert scaled_jacobian(mesh.points, mesh.cells).min() > 0.5 * scaled_jacobian(*_of(first)).min()
    sizes = np.linalg.norm(np.ptp(mesh.points[mesh.cells], axis=1), axis=1)
    assert sizes.max() > 15 * sizes.min()


def _of(mesh: BodyMesh) -> tuple[np.ndarray, np.ndarray]:
    return mesh.points, mesh.cells


@pytest.mark.parametrize("body", ["half a disc", "half a ball", "ring"])
def test_any_cells_of_a_curved_body_can_be_refined(body: str) -> None:
    worst = scaled_jacobian(*_of(THIN[body]())).min()
    for seed in range(3):
        mesh, random = THIN[body](), np.random.default_rng(seed)
        for _ in range(3):
            marked = random.choice(mesh.n_cells, max(1, mesh.n_cells // 8), replace=False)
            mesh = refined(mesh, marked).mesh
        assert scaled_jacobian(*_of(mesh)).min() > 0.5 * worst
        assert thickness(*_of(mesh)).min() > 0.0


def test_neighbours_follow_where_a_surface_leaves_its_facets_by_more_than_the_cells_behind() -> None:
    ring = triangles(disc(1.0, 2, hole=0.99))
    assert scaled_jacobian(*_of(ring)).min() < 0.03
    mesh = ring
    for seed in (0, 1):
        marked = np.random.default_rng(seed).choice(mesh.n_cells, mesh.n_cells // 6, replace=False)
        mesh = refined(mesh, marked).mesh
    assert ring.n_cells < mesh.n_cells < 16 * ring.n_cells
    assert thickness(*_of(mesh)).min() > 0.0


def rounded(cell: str) -> BodyMesh:
    """Return a box whose top lies on a ball, its right side on a cylinder, all others on planes."""
    mesh = block((0.0, 0.0, 0.0), (2.0, 1.0, 1.0), (3, 3, 2), cell)
    points = mesh.points.copy()
    points[:, 0] *= 0.5 * (np.sqrt(9.0 - (points[:, 1] - 0.5) ** 2) - 1.0)
    points[:, 2] *= np.sqrt(25.0 - ((points[:, :2] - 0.5) ** 2).sum(axis=1)) - 4.0
    return BodyMesh(points, mesh.cells, mesh.surfaces, shapes={"z1": BALL, "x1": BARREL})


def joined(mesh: BodyMesh) -> BodyMesh:
    """Return the mesh with both as one surface, as CAD files have them."""
    parts = [mesh.surfaces["z1"], mesh.surfaces["x1"]]
    shape: SurfaceShape = Joined((BALL, BARREL), [mesh.points[part] for part in parts])
    others = {name: mesh.surfaces[name] for name in ("x0", "y0", "y1", "z0")}
    surfaces = {**others, "round": np.concatenate(parts)}
    return BodyMesh(mesh.points, mesh.cells, surfaces, shapes={"round": shape})


KINDS: dict[str, Callable[[], BodyMesh]] = {
    "hexahedra": lambda: rounded("hexahedron"),
    "tetrahedra": lambda: rounded("tetrahedron"),
    "quadratic tetrahedra": lambda: quadratic(rounded("tetrahedron")),
    "one surface": lambda: joined(rounded("hexahedron")),
}


def off(mesh: BodyMesh, name: str, shape: SurfaceShape) -> np.ndarray:
    """Return the distances of the nodes of a surface from a shape."""
    return np.abs(shape.distance(mesh.points[np.unique(mesh.surfaces[name])]))


@pytest.mark.parametrize("kind", KINDS)
def test_rims_lie_on_both_of_their_surfaces(kind: str) -> None:
    """A node between a ball and a plane, or a cylinder, was on the ball alone, and 3e-4 off the plane."""
    mesh = KINDS[kind]()
    while mesh.n_cells < 150:
        mesh = refined(mesh, np.arange(mesh.n_cells)).mesh
    shapes: dict[str, SurfaceShape] = {
        "x0": Plane((0.0, 0.0, 0.0), (-1.0, 0.0, 0.0)), "y0": Plane((0.0, 0.0, 0.0), (0.0, -1.0, 0.0)),
        "y1": Plane((0.0, 1.0, 0.0), (0.0, 1.0, 0.0)), "z0": Plane((0.0, 0.0, 0.0), (0.0, 0.0, -1.0)),
    }  # fmt: skip
    if kind == "one surface":
        both = [off(mesh, "round", shape) for shape in (BALL, BARREL)]
        assert np.minimum(*both).max() < 1e-13
        assert np.count_nonzero(np.maximum(*both) < 1e-13) == 13  # of 12 edges along the rim
    else:
        shapes = {**shapes, "z1": BALL, "x1": BARREL}
    for name, shape in shapes.items():
        assert off(mesh, name, shape).max() < 1e-13, name


def test_a_rim_where_a_fillet_touches_a_plane_lies_on_the_fillet() -> None:
    """They touch along a circle at no angle: nearly all directions in the plane leave the fillet alike."""
    mesh = block((1.0, 0.0, -1.0), (2.7, 0.6, 1.0), (2, 1, 1))
    radius, angle, height = mesh.points.T.copy()
    radius[np.isclose(radius, 1.85)] = 2.0
    height[(height > 0.0) & (radius > 2.5)] = np.sqrt(1.0 - 0.7**2)
    points = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), height])
    rounded_part = (radius[mesh.surfaces["z1"]] > 2.5).any(axis=1)
    fillet, flat = mesh.surfaces["z1"][rounded_part], mesh.surfaces["z1"][~rounded_part]
    torus, plane = Torus((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 2.0, 1.0), Plane((0.0, 0.0, 1.0), (0.0, 0.0, 1.0))
    for shapes in ({"fillet": torus}, {"fillet": torus, "flat": plane}):
        fine = BodyMesh(points, mesh.cells, {"fillet": fillet, "flat": flat}, shapes=shapes)
        gaps = []
        for _ in range(2):
            fine = refined(fine, np.arange(fine.n_cells)).mesh
            assert off(fine, "fillet", torus).max() < 1e-13
            gaps.append(off(fine, "flat", plane).max())
        # Half the square of the distance between arc and chord, which stays where it was.
        assert gaps[0] == pytest.approx(0.5 * (2.0 * (1.0 - np.cos(0.3))) ** 2, rel=0.1)
        assert gaps[1] == pytest.approx(gaps[0], rel=1e-9)


def test_a_shape_that_leaves_the_body_is_refused() -> None:
    thin = rectangle((0.0, 0.0), (1.0, 0.05), (1, 1), "triangle")
    valley = Sphere((0.5, 0.05 + np.sqrt(2.0)), 1.5, hollow=True)  # 0.086 deep in a body of 0.05
    body = BodyMesh(thin.points, thin.cells, thin.surfaces, shapes={"y1": valley})
    with pytest.raises(InvalidInputError, match=r"positive Jacobian, .*: see whether shapes of surfaces"):
        refined(body, [0, 1])
