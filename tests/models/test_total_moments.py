"""A force with a moment, or at a point, is spread over its surface with exactly that resultant."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from fenics_contact import Body, BodyMesh, Scene, Support, TotalForce, Traction
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import block, rectangle
from fenics_contact.mesh import quadratic
from tests.models.bodies import bent, box, steel
from tests.models.elements import CELLS, load_by_node, whole

#: Quadratic cells and the linear ones of their shapes.
QUADRATIC = {
    "quadrilateral9": "quadrilateral",
    "triangle6": "triangle",
    "hexahedron27": "hexahedron",
    "tetrahedron10": "tetrahedron",
}


def curved(cell: str) -> BodyMesh:
    """A bent body of linear cells, or of quadratic ones whose edges are curved."""
    return bent(box(cell) if cell in CELLS else quadratic(box(QUADRATIC[cell])))


def nodal(mesh: BodyMesh, load: TotalForce | Traction) -> np.ndarray:
    return load_by_node(whole(Body(mesh, steel(mesh.dim)), [load]))


def moment(forces: np.ndarray, arms: np.ndarray) -> np.ndarray:
    if forces.shape[1] == 2:
        return np.array([np.sum(arms[:, 0] * forces[:, 1] - arms[:, 1] * forces[:, 0])])
    return np.cross(arms, forces).sum(axis=0)


@pytest.mark.parametrize("far", [0.0, 1e4])
@pytest.mark.parametrize("cell", [*CELLS, *QUADRATIC])
def test_force_and_moment_are_what_was_given(cell: str, far: float) -> None:
    mesh = curved(cell)
    mesh = mesh.moved(mesh.points + far)
    force, about = np.array([0.5, -1.0, 2.0])[: mesh.dim], np.array([1.0, -3.0, 2.0])[: mesh.dim] + far
    turn: Any = (0.7, -0.3, 0.4) if mesh.dim == 3 else 0.7
    # Coordinates far from the origin have fewer digits behind the point.
    near = 1e-12 * (np.linalg.norm(force) + np.linalg.norm(turn)) * (1 + 0.1 * far)
    for given in (turn, None):
        forces = nodal(mesh, TotalForce("cell", "x1", force, given, about))
        np.testing.assert_allclose(forces.sum(axis=0), force, rtol=0, atol=near)
        expected = np.atleast_1d(0.0 * np.asarray(turn) if given is None else given)
        np.testing.assert_allclose(moment(forces, mesh.points - about), expected, rtol=0, atol=near)
    turned = nodal(mesh, TotalForce("cell", "x1", 0.0 * force, turn))
    np.testing.assert_allclose(turned.sum(axis=0), 0.0, atol=near)
    np.testing.assert_allclose(moment(turned, mesh.points - about), turn, rtol=0, atol=near)
    off = np.setdiff1d(np.arange(mesh.n_nodes), mesh.surfaces["x1"])
    assert not np.any(turned[off])
    assert np.abs(turned).max() > 0.01


@pytest.mark.parametrize("cell", CELLS)
def test_a_force_at_the_centroid_is_spread_evenly(cell: str) -> None:
    mesh = box(cell)
    force = (0.5, -1.0, 2.0)[: mesh.dim]
    middle = (2.0, 0.5, 0.5)[: mesh.dim]
    even = nodal(mesh, TotalForce("cell", "x1", force))
    np.testing.assert_allclose(
        even, nodal(mesh, Traction("cell", "x1", force)), rtol=1e-15
    )  # on an area of one
    np.testing.assert_allclose(nodal(mesh, TotalForce("cell", "x1", force, at=middle)), even, atol=1e-14)


def test_a_torque_on_a_flat_face_is_a_traction_around_its_middle() -> None:
    mesh = block((0, 0, 0), (1, 2, 4), (2, 4, 6))
    second = 2 * 4 * (2**2 + 4**2) / 12
    around = Traction(
        "cell", "x1", lambda x: np.stack([0 * x[:, 0], 2 - x[:, 2], x[:, 1] - 1], axis=1) / second
    )
    torque = nodal(mesh, TotalForce("cell", "x1", (0.0, 0.0, 0.0), moment=(1.0, 0.0, 0.0)))
    np.testing.assert_allclose(torque, nodal(mesh, around), atol=1e-14)
    bending = TotalForce("cell", "x1", (0.0, 0.0, 0.0), moment=(0.0, 0.0, 1.0))
    linear = Traction("cell", "x1", lambda x: np.outer(-(x[:, 1] - 1) / (4 * 2**3 / 12), (1, 0, 0)))
    np.testing.assert_allclose(nodal(mesh, bending), nodal(mesh, linear), atol=1e-14)


@pytest.mark.parametrize(
    ("plane", "given", "words"),
    [
        (
            True,
            {"moment": (0.0, 0.0, 1.0)},
            "TotalForce.moment on surface 'x1' of body 'a' must be one number, as",
        ),
        (
            False,
            {"moment": 1.0},
            "must be three numbers, about x, y and z, got 1.0: in the plane a moment is",
        ),
        (False, {"moment": (1.0, 2.0)}, r"must be three numbers, about x, y and z, got \(1.0, 2.0\)"),
        (
            True,
            {"at": (0.0, 0.0, 1.0)},
            r"TotalForce.at of the force on .* must have 2 coordinates, got \(0.0, 0",
        ),
        (False, {"at": (0.0, 0.0)}, "must have 3 coordinates"),
        (False, {"moment": (0.0, np.nan, 0.0)}, "TotalForce.moment must be finite numbers, got .*nan"),
        (True, {"moment": np.inf}, "TotalForce.moment must be finite numbers, got inf"),
        (False, {"at": (0.0, np.nan, 0.0)}, "TotalForce.at must be finite numbers"),
        (
            False,
            {"at": 3.0},
            "TotalForce.at must be a sequence .each a number. or None, got 3.0: point at which",
        ),
        (False, {"moment": "big"}, "TotalForce.moment must be .* got 'big': moment besides that of"),
    ],
)
def test_what_does_not_fit_the_space_is_refused(plane: bool, given: dict[str, Any], words: str) -> None:
    mesh = rectangle((0, 0), (1, 1), (2, 2)) if plane else block((0, 0, 0), (1, 1, 1), (2, 2, 2))
    with pytest.raises(InvalidInputError, match=words):
        Scene(
            {"a": Body(mesh, steel(mesh.dim))},
            [Support("a", "x0")],
            [TotalForce("a", "x1", (0.0,) * mesh.dim, **given)],
        )


def test_a_moment_needs_more_than_a_line() -> None:
    mesh = block((0, 0, 0), (1, 1, 1e-7), (1, 1, 1))
    with pytest.raises(
        InvalidInputError, match=r"no line, surface 'x1' of body 'cell' is 1.0e-07 times as wide"
    ):
        nodal(mesh, TotalForce("cell", "x1", (0.0, 0.0, 0.0), moment=(0.0, 1.0, 0.0)))
