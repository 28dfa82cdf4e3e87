"""Parts from a STEP file touch as those whose shapes were written by hand do, on the same coarse mesh."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    BodyMesh,
    ContactPair,
    Scene,
    Support,
    Surface,
    TotalForce,
    read_cad,
    solve_scene,
)
from fenics_contact.materials import IsotropicElasticity
from fenics_contact.qp import FaceNewton
from fenics_contact.readers import gmsh_model
from fenics_contact.shapes import Parametric, Plane, Revolved, SurfaceShape, Torus

STEEL = IsotropicElasticity(1000.0, 0.3)
#: Ends of the parts along z, which are held and pulled.
HEIGHT = 5.0
#: Largest edges of the lower and the upper part.
COARSE, FINE = 1.5, 0.7


@dataclass(frozen=True)
class Parts:
    """Two parts that touch at the origin, a quarter of each.

    Attributes:
        build: Makes them in gmsh, the upper one first.
        shape: The round surface of the lower part, written by hand; it is the master.
        force: What presses the quarters together, [N].
    """

    build: Callable[[Any], None]
    shape: SurfaceShape
    force: float


def links(occ: Any) -> None:
    """Wires of 10 mm, bent to rings of 12 mm inner width, hooked into each other."""
    upper, lower = occ.addTorus(0, 0, 6, 11, 5), occ.addTorus(0, 0, 6, 11, 5)
    occ.rotate([(3, lower)], 0, 0, 6, 1, 0, 0, np.pi / 2)  # now round about y
    occ.rotate([(3, upper)], 0, 0, 6, 0, 1, 0, np.pi / 2)  # about x
    occ.rotate([(3, upper)], 0, 0, 0, 1, 0, 0, np.pi)
    occ.intersect([(3, upper)], [(3, occ.addBox(0, 0, -3, 5, 4, 3 + HEIGHT))])
    occ.intersect([(3, lower)], [(3, occ.addBox(0, 0, -HEIGHT, 4, 5, 3 + HEIGHT))])


def seat_on_an_egg(occ: Any) -> None:
    """A spherical seat on a spheroid, which a STEP file has as a spline."""
    egg, seat = occ.addSphere(0, 0, -HEIGHT, 1), occ.addSphere(0, 0, -7.5, 7.5)
    occ.cut([(3, occ.addBox(0, 0, -1, 5, 5, HEIGHT + 1))], [(3, seat)])
    occ.dilate([(3, egg)], 0, 0, -HEIGHT, 5.5, 5.5, HEIGHT)
    occ.intersect([(3, egg)], [(3, occ.addBox(0, 0, -HEIGHT, 6, 6, HEIGHT))])


ELLIPSE = Parametric(
    lambda u: np.column_stack([5.5 * np.cos(u[:, 0]), HEIGHT * np.sin(u[:, 0])]),
    (0.0,),
    (2.0 * np.pi,),
    periodic=(True,),
)
PARTS = {
    "links": Parts(links, Torus((0, 0, 6), (0, 1, 0), 11, 5), 50.0),
    "seat on an egg": Parts(seat_on_an_egg, Revolved(ELLIPSE, (0, 0, -HEIGHT), (0, 0, 1)), 40.0),
}


def from_step(parts: Parts, folder: Path) -> list[BodyMesh]:
    """Write the parts to a STEP file and read them back, the upper one first, which has the finer mesh."""
    path = folder / "parts.step"
    with gmsh_model("parts") as gmsh:
        parts.build(gmsh.model.occ)
        gmsh.model.occ.synchronize()
        gmsh.write(str(path))
    coarse = read_cad(path, COARSE)
    upper, lower = sorted(coarse, key=lambda name: -float(coarse[name].points[:, 2].mean()))
    return [read_cad(path, FINE, bodies=[upper])[upper], coarse[lower]]


def round_face(mesh: BodyMesh) -> str:
    """Name the surface that is round and reaches the origin."""
    here = int(np.argmin(np.linalg.norm(mesh.points, axis=1)))
    names = [name for name, facets in mesh.surfaces.items() if here in facets]
    (found,) = (name for name in names if not isinstance(mesh.shapes[name], Plane))
    return found


def flat_face(mesh: BodyMesh, axis: int, value: float) -> str:
    """Name the surface that lies in a plane across an axis."""
    (found,) = (
        name for name, facets in mesh.surfaces.items() if np.allclose(mesh.points[facets][..., axis], value)
    )
    return found


def pressed(upper: BodyMesh, lower: BodyMesh, force: float) -> Scene:
    """The upper part is the slave."""
    meshes, supports = {"upper": upper, "lower": lower}, []
    for name, mesh in meshes.items():
        supports.append(Support(name, flat_face(mesh, 0, 0.0), (0.0, None, None)))
        supports.append(Support(name, flat_face(mesh, 1, 0.0), (None, 0.0, None)))
    supports.append(Support("lower", flat_face(lower, 2, -HEIGHT)))
    return Scene(
        {name: Body(mesh, STEEL) for name, mesh in meshes.items()},
        supports,
        [TotalForce("upper", flat_face(upper, 2, HEIGHT), (0.0, 0.0, -force))],
        [ContactPair(Surface("upper", round_face(upper)), Surface("lower", round_face(lower)))],
    )


def peak(scene: Scene) -> float:
    state = solve_scene(scene, MPI.COMM_SELF, solver=FaceNewton(tolerance=1e-8))
    assert np.count_nonzero(state.contact.status) > 3
    return float(state.contact.pressure.max())


def by_hand(mesh: BodyMesh, shape: SurfaceShape) -> BodyMesh:
    return mesh.with_shapes({**mesh.shapes, round_face(mesh): shape})


@pytest.mark.parametrize("name", PARTS)
def test_parts_of_a_step_file_touch_on_their_true_surfaces(
    name: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    parts = PARTS[name]
    upper, lower = from_step(parts, tmp_path)
    capfd.readouterr()  # the library that writes STEP files talks
    scene = pressed(upper, lower, parts.force)
    exact = peak(pressed(upper, by_hand(lower, parts.shape), parts.force))
    assert peak(scene) == pytest.approx(exact, rel=0.01)
    facets = replace(scene, contacts=[replace(pair, geometry="faceted") for pair in scene.contacts])
    assert peak(facets) > 1.5 * exact
