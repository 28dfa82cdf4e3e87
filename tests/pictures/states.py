"""States to draw: solved once, looked at by many tests."""

from __future__ import annotations

from functools import lru_cache
from io import BytesIO
from pathlib import Path

import numpy as np
from matplotlib.image import imread
from mpi4py import MPI

from fenics_contact import Body, Coulomb, Scene, Status, Support, Traction, solve_scene
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import IsotropicElasticity, PlaneStrain
from fenics_contact.mesh import quadratic
from fenics_contact.pictures import Picture
from fenics_contact.results.deformed_state import AnyState
from tests.scenes import partitions, two_blocks


@lru_cache(maxsize=2)
def touching_blocks(cell: str = "hexahedron") -> AnyState:
    """Two blocks in frictional contact, with open, sticking and slipping points."""
    scene = two_blocks(Coulomb(0.4), cell)
    state = solve_scene(scene, MPI.COMM_SELF, partitions=partitions(scene), tolerance=1e-6)
    assert all(state.contact.count(status) > 0 for status in Status), "some status is missing"
    return state


def pixels(picture: Path | Picture) -> np.ndarray:
    """Read a picture, (height, width, 3) in [0, 1]."""
    kept = isinstance(picture, Picture) and picture.path is None and picture.png is not None
    return np.asarray(imread(BytesIO(picture.png) if kept else picture))[..., :3]


def painted(image: np.ndarray) -> float:
    """Return the fraction of pixels that are not white."""
    return float(np.mean(np.any(image < 0.98, axis=-1)))


def contains(image: np.ndarray, colour: str, tolerance: float = 0.02) -> bool:
    """Whether a colour "#rrggbb" is found in more than ten pixels."""
    wanted = np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)]) / 255
    return int(np.sum(np.all(np.abs(image - wanted) < tolerance, axis=-1))) > 10


def pulled(cell: str) -> AnyState:
    """A bar of quadratic cells pulled along x."""
    if cell in ("hexahedron27", "tetrahedron10"):
        solid = "hexahedron" if cell == "hexahedron27" else "tetrahedron"
        mesh = quadratic(block((0, 0, 0), (2, 1, 1), (2, 1, 1), cell=solid))
        material, load = IsotropicElasticity(100.0, 0.3), (1.0, 0.0, 0.0)
    else:
        plane = "triangle" if cell == "triangle6" else "quadrilateral"
        mesh = quadratic(rectangle((0, 0), (2, 1), (2, 1), plane))
        material, load = PlaneStrain(100.0, 0.3), (1.0, 0.0)
    assert mesh.cell_type == cell
    hold = Support("bar", "x0", (0.0,) * mesh.dim)
    return solve_scene(
        Scene({"bar": Body(mesh, material)}, [hold], [Traction("bar", "x1", load)]), MPI.COMM_SELF
    )
