"""A gmsh model of hexahedra, prisms, tetrahedra and pyramids in one body."""

from __future__ import annotations

from types import ModuleType

from mpi4py import MPI

from fenics_contact import BodyMesh, solve_scene
from fenics_contact.materials import IsotropicElasticity
from fenics_contact.mesh import bisection_partition
from fenics_contact.readers.gmsh import from_gmsh_model
from tests.fem.graded import pulled
from tests.readers.msh_files import name, own_gmsh


def four_boxes(gmsh: ModuleType) -> None:
    """Mesh a "bar" of 2 x 1 x 2: hexahedra, prisms beside them, tetrahedra and pyramids on top of both."""
    geo, mesh = gmsh.model.geo, gmsh.model.mesh
    at = {(x, y, z): geo.addPoint(x, y, z) for x in range(3) for y in range(2) for z in range(3)}
    lines: dict[tuple, int] = {}
    faces: dict[frozenset, int] = {}

    def line(a: tuple, b: tuple) -> int:
        if (b, a) in lines:
            return -lines[b, a]
        if (a, b) not in lines:
            lines[a, b] = geo.addLine(at[a], at[b])
        return lines[a, b]

    def face(*corners: tuple) -> int:
        key = frozenset(corners)
        if key not in faces:
            around = [line(a, b) for a, b in zip(corners, (*corners[1:], corners[0]), strict=True)]
            faces[key] = geo.addPlaneSurface([geo.addCurveLoop(around)])
        return faces[key]

    boxes = {}
    for x, z in ((0, 0), (1, 0), (0, 1), (1, 1)):
        low, high = [[(x + a, b, z + c) for a, b in ((0, 0), (1, 0), (1, 1), (0, 1))] for c in (0, 1)]
        around = [(low[i], low[j], high[j], high[i]) for i, j in ((0, 1), (1, 2), (2, 3), (3, 0))]
        sides = [face(*low), face(*high), *(face(*each) for each in around)]
        boxes[x, z] = geo.addVolume([geo.addSurfaceLoop(sides)]), sides, [at[c] for c in (*low, *high)]
    geo.synchronize()
    for tag in lines.values():
        mesh.setTransfiniteCurve(tag, 3)
    for tag in faces.values():
        mesh.setTransfiniteSurface(tag)
    for place, recombined in (((0, 0), range(6)), ((1, 0), range(2, 6))):
        volume, sides, corners = boxes[place]
        for side in recombined:
            mesh.setRecombine(2, sides[side])
        mesh.setTransfiniteVolume(volume, corners)
    name(gmsh, 3, [volume for volume, _, _ in boxes.values()], "bar")
    for axis, end in ((0, 2), (1, 1), (2, 2)):
        for k, value in enumerate((0, end)):
            there = [tag for corners, tag in faces.items() if all(c[axis] == value for c in corners)]
            name(gmsh, 2, there, f"{'xyz'[axis]}{k}")
    mesh.generate(3)


def bars_of_all_orders() -> dict[str, BodyMesh]:
    """Return the body with linear, quadratic and serendipity cells; gmsh runs in this process."""
    found = {}
    with own_gmsh() as gmsh:
        four_boxes(gmsh)
        found["linear"] = from_gmsh_model()["bar"]
        gmsh.model.mesh.setOrder(2)
        found["quadratic"] = from_gmsh_model(shapes=False)["bar"]
        gmsh.option.setNumber("Mesh.SecondOrderIncomplete", 1)
        gmsh.model.mesh.setOrder(1)
        gmsh.model.mesh.setOrder(2)
        gmsh.option.setNumber("Mesh.SecondOrderIncomplete", 0)
        found["serendipity"] = from_gmsh_model(shapes=False)["bar"]
    return found


def displacement_on(comm: MPI.Comm, bars: dict[str, BodyMesh] | None = None) -> list[list[float]]:
    """Return the displacements of the pulled bars in five subdomains each, one after the other. Collective.

    `bars`: by default they are meshed here.
    """
    result = []
    for mesh in (bars or bars_of_all_orders()).values():
        scene = pulled(mesh, IsotropicElasticity(100.0, 0.3))
        partition = {"bar": bisection_partition(mesh, 5)}
        state = solve_scene(scene, comm, partitions=partition, tolerance=1e-12)
        result += state.gather_displacement("bar").tolist()
    return result
