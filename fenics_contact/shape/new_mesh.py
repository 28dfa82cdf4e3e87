"""New meshes of designed bodies in the shape of a design, which know where their surfaces came from."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from fenics_contact._libraries import MPI
from fenics_contact.errors import InvalidInputError, together, user_code
from fenics_contact.mesh import BodyMesh
from fenics_contact.scene import Scene, Surface, keeping_discretisation
from fenics_contact.shape.design import SurfaceDesign
from fenics_contact.surfaces import project, shape_functions, true_surface

#: Takes the mesh of a body in the shape of a design; returns another one with the same named surfaces and
#: the same nodes on its design surfaces.
Mesher = Callable[[BodyMesh], BodyMesh]
#: Nodes nearer than this part of the extent are the same.
SAME = 1e-9


def meshed(
    scene: Scene, designs: Sequence[SurfaceDesign], mesher: Mesher, comm: MPI.Comm
) -> tuple[Scene, tuple[SurfaceDesign, ...]]:
    """Return the scene with new meshes of the designed bodies, made on rank 0, and the designs on them.

    Args:
        scene: The scene in the shape of a design.
    """
    names = sorted({design.body for design in designs})
    made: dict[str, BodyMesh] = {}
    with together(comm):
        if comm.rank == 0:
            with user_code("the mesher of a design"):
                made = {name: mesher(scene.bodies[name].mesh) for name in names}
            given = _with_given_gaps(scene)
            made = {name: _from_origin(scene, name, mesh, given) for name, mesh in made.items()}
    made = comm.bcast(made)
    bodies = {name: replace(scene.bodies[name], mesh=mesh) for name, mesh in made.items()}
    found = tuple(_found(design, scene.bodies[design.body].mesh, made[design.body]) for design in designs)
    kept = keeping_discretisation(scene)
    return replace(kept, bodies={**scene.bodies, **bodies}), found


def _with_given_gaps(scene: Scene) -> Mapping[str, set[str]]:
    """Return the bodies with surfaces in pairs that give their gaps: body -> names of these surfaces."""
    found: dict[str, set[str]] = {}
    for pair in scene.contacts:
        for side in (pair.slave, pair.master):
            if pair.given_gap and isinstance(side, Surface):
                found.setdefault(side.body, set()).add(side.name)
    return found


def _from_origin(scene: Scene, name: str, mesh: BodyMesh, given: Mapping[str, set[str]]) -> BodyMesh:
    """Return a new mesh that knows where its surfaces were before designs moved them.

    A given gap holds there, see `pairing.with_given_gaps`: what designs have added since is kept.
    """
    if name not in given:
        return mesh
    before = scene.bodies[name].mesh
    if mesh.shapes:
        raise InvalidInputError(
            f"a new mesh of {name!r}, which is in a pair that gives its gap, must have no shapes of its own, "
            f"got those of {sorted(mesh.shapes)}: leave them out, those of the mesh before are kept"
        )
    away, nearest = cKDTree(before.points).query(mesh.points)
    new = away > SAME * float(np.ptp(before.points, axis=0).max())
    moved = before.points - before.origin.points
    way = moved[nearest]
    for surface in sorted(given[name] & set(mesh.surfaces)):
        nodes = np.unique(mesh.surfaces[surface])
        way[nodes[new[nodes]]] = _way_between(name, surface, before, mesh, nodes[new[nodes]])
    points = np.where(new[:, None], mesh.points - way, before.origin.points[nearest])
    kept = {key for key, facets in mesh.surfaces.items() if not new[facets].any()}
    shapes = {key: shape for key, shape in before.origin.shapes.items() if key in kept}
    return mesh.reshaped_from(points, shapes)


def _way_between(body: str, name: str, before: BodyMesh, after: BodyMesh, nodes: np.ndarray) -> np.ndarray:
    """Return how far designs have moved the places of new nodes of a surface, shape (n, dim), [length]."""
    old, new = (true_surface(mesh, name, "faceted") for mesh in (before, after))
    mine = np.searchsorted(new.nodes, nodes)
    hit = project(new.points[mine], -new.normals[mine], old)  # surfaces meet that face each other
    if len(hit.point) < len(nodes):
        raise InvalidInputError(
            f"a new mesh of {body!r} must keep the place of surface {name!r}, as its pair gives the gap, but "
            f"{len(nodes) - len(hit.point)} of {len(nodes)} new nodes do not face the surface before: keep "
            "the nodes on its rim, or all facets, as mesh_io.refilled does"
        )
    weights, _ = shape_functions(hit.local, old.corners)
    moved = (before.points - before.origin.points)[old.nodes]
    return np.asarray(np.einsum("nk,nkd->nd", weights, moved[old.facets[hit.facet]]))


def _found(design: SurfaceDesign, before: BodyMesh, after: BodyMesh) -> SurfaceDesign:
    """Return a design with the numbers of its nodes in another mesh."""
    places = before.points[design.lattice.nodes]
    distance, nodes = cKDTree(after.points).query(places)
    lost = int(np.count_nonzero(distance > SAME * np.ptp(places, axis=0).max()))
    if lost:
        raise InvalidInputError(
            f"a new mesh of {design.body!r} must keep the nodes of its design surface, {lost} of "
            f"{len(places)} are gone: keep the facets of the surface, as mesh_io.refilled does"
        )
    return replace(design, surface=replace(design.lattice, nodes=np.asarray(nodes)))
