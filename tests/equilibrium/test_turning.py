"""By how much bodies turn and strain, and when nobody needs to know."""

from __future__ import annotations

import logging

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import Body, BodyMesh, ContactProblem, RigidSurface, Scene, Support
from fenics_contact._equilibrium import warnings
from fenics_contact._equilibrium.turning import Turning, gradient_squares
from fenics_contact._equilibrium.warnings import FAR, ContactWarnings
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import IsotropicElasticity

MESHES = {
    "triangles": rectangle((100, 0), (101, 2), (3, 2), "triangle"),
    "quadrilaterals": rectangle((100, 0), (101, 2), (3, 2)),
    "tetrahedra": block((100, 0, 0), (101, 2, 3), (2, 2, 1), "tetrahedron"),
    "hexahedra": block((100, 0, 0), (101, 2, 3), (2, 2, 1)),
}


def rotation_and_strain(mesh: BodyMesh, moved: np.ndarray, cells: slice = slice(None)) -> np.ndarray:
    """Return the root mean squares of rotation and strain of some cells."""
    rotation, strain, size = gradient_squares(mesh.points, moved, mesh.cells[cells])[0]
    return np.sqrt(np.array([rotation, strain]) / size)


@pytest.mark.parametrize("mesh", MESHES.values(), ids=MESHES)
def test_the_rotation_of_a_body_is_that_of_its_rigid_motion(mesh: BodyMesh) -> None:
    dim, spin = mesh.dim, np.zeros((3, 3))
    spin[0, 1], spin[2, 0], spin[1, 2] = (0.03, 0.0, 0.0) if dim == 2 else (0.03, 0.1, -0.2)
    turned = mesh.points @ (spin - spin.T)[:dim, :dim] + 5.0
    assert rotation_and_strain(mesh, turned) == pytest.approx([np.linalg.norm(spin), 0.0], rel=1e-9, abs=1e-7)
    grown = rotation_and_strain(mesh, 0.1 * mesh.points)
    assert grown == pytest.approx([0.0, 0.1 * np.sqrt(dim)], rel=1e-9, abs=1e-7)


@pytest.mark.parametrize(("name", "torsion"), [*((name, False) for name in MESHES), ("quadrilaterals", True)])
def test_no_cell_turns_or_strains_by_more_than_the_bound(name: str, torsion: bool) -> None:
    """With torsion displacements have a third component, around the axis."""
    mesh, random = MESHES[name], np.random.default_rng(1)
    near_axis = torsion * np.array([-99.7, *np.zeros(mesh.dim - 1)])
    mesh = mesh.moved(mesh.points + near_axis + random.uniform(-0.1, 0.1, mesh.points.shape))
    width, found = 3 if torsion else mesh.dim, []
    for _ in range(200):
        moved = random.standard_normal((mesh.n_nodes, width))
        moved /= np.linalg.norm(moved, axis=1)[:, None]
        bound = gradient_squares(mesh.points, moved, mesh.cells)[1]
        cells = [rotation_and_strain(mesh, moved, slice(cell, cell + 1)) for cell in range(len(mesh.cells))]
        found.append(np.max(cells) / bound)
    assert 0.2 < max(found) <= 1.0


def turned(angle: float) -> Scene:
    """A beam whose end is turned."""
    turn = RigidSurface("beam", "x1", (6.0, 0.5, 0.5), (0, 0, 0), (0.0, 0.0, angle))
    return Scene({"beam": Body(BEAM, IsotropicElasticity(100.0, 0.3))}, [Support("beam", "x0"), turn])


BEAM = block((0, 0, 0), (6, 1, 1), (6, 1, 1))


def test_bounds_withhold_no_warning(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    """From the second state of a mesh on: states that turn by nearly as much as is warned of, and by more."""
    problem, counted = ContactProblem(turned(0.01), MPI.COMM_SELF), []
    first = problem.solve(turned(0.01))
    unit = Turning.of(first, "beam").rotation / 0.01
    angles = [1e-6, 1e-3, *(FAR / unit * np.array([0.3, 0.99, 1.01, 2.0]))]
    states = [problem.solve(turned(angle)) for angle in angles]
    monkeypatch.setattr(warnings, "Turning", _Counted(counted))
    told = []
    for state in states:
        known = ContactWarnings()
        known.examined(first)
        counted.clear()
        caplog.clear()
        with caplog.at_level(logging.WARNING, logger="fenics_contact"):
            known.examined(state)
        told.append((len(counted), "has turned by" in caplog.text))
    assert told == [(0, False), (0, False), (1, False), (1, False), (1, True), (1, True)]


class _Counted:
    """Stands in for `Turning` and counts what is asked of it."""

    def __init__(self, counted: list[str]) -> None:
        self.counted = counted

    def of(self, state: object, body: str) -> Turning:
        self.counted.append(body)
        return Turning.of(state, body)  # type: ignore[arg-type]
