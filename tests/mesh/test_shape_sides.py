"""Shapes must face out of the body, and show themselves in a few lines."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fenics_contact import BodyMesh
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import block, rectangle
from fenics_contact.shapes import Circle, Plane, SurfaceShape
from fenics_contact.shapes.combined import Joined


def ring() -> BodyMesh:
    """A quarter of a ring with radii 1 and 2."""
    flat = rectangle((1.0, 0.0), (2.0, 0.5 * np.pi), (2, 8))
    radius, angle = flat.points.T
    return replace(flat, points=radius[:, None] * np.column_stack([np.cos(angle), np.sin(angle)]))


@pytest.mark.parametrize("surface", ["x0", "x1"])
def test_a_circle_that_faces_into_the_body_is_refused_with_the_switch_to_turn_it(surface: str) -> None:
    hole = surface == "x0"
    radius = 1.0 if hole else 2.0
    ring().with_shapes({surface: Circle((0.0, 0.0), radius, hollow=hole)})
    with pytest.raises(InvalidInputError, match=f"Circle point into it: give it hollow={hole}"):
        ring().with_shapes({surface: Circle((0.0, 0.0), radius, hollow=not hole)})


def joined(mesh: BodyMesh, sides: dict[str, SurfaceShape]) -> Joined:
    return Joined(tuple(sides.values()), tuple(mesh.points[mesh.surfaces[name]] for name in sides))


def test_one_side_of_several_that_faces_into_the_body_is_refused() -> None:
    mesh = block((0, 0, 0), (1, 1, 1), (2, 2, 2))
    both = {"two": np.concatenate([mesh.surfaces["x1"], mesh.surfaces["z1"]])}
    mesh = BodyMesh(mesh.points, mesh.cells, {**mesh.surfaces, **both})
    right = {"x1": Plane((1, 0, 0), (1, 0, 0)), "z1": Plane((0, 0, 1), (0, 0, 1))}
    known = mesh.with_shapes({"two": joined(mesh, right)})
    assert repr(known.shapes["two"]) == "Joined\n  shapes  2 × Plane\n  facets  8"
    assert len(str(known.shapes).splitlines()) <= 10
    wrong = joined(mesh, right | {"z1": Plane((0, 0, 1), (0, 0, -1))})
    with pytest.raises(InvalidInputError, match=r"Plane point into it: give it the normal \(.*1\.0\)"):
        mesh.with_shapes({"two": wrong})
