"""Plane bodies with a thickness: what their scene must be like, and the thickness along surfaces."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from fenics_contact._scene.body import Body
from fenics_contact._scene.checks import check_alike
from fenics_contact._scene.foundations import ElasticFoundation
from fenics_contact._scene.loads import Load
from fenics_contact._scene.pairs import ContactPair
from fenics_contact._scene.sectors import AnyTie
from fenics_contact.errors import InvalidInputError
from fenics_contact.mesh.faces import corners_of, match_faces


def require_thickness(
    bodies: Mapping[str, Body],
    foundations: Sequence[ElasticFoundation],
    pairs: Sequence[ContactPair | AnyTie],
) -> None:
    """Reject a scene where only some bodies have a thickness, and pairs on surfaces with several.

    `bodies`: those of a scene that carry no motion of a tool.
    """
    thick = {name: body.has_thickness for name, body in bodies.items()}
    check_alike("have a thickness", thick, "give it to the materials of all of them")
    if not any(thick.values()):
        return
    if foundations:
        raise InvalidInputError(
            "an ElasticFoundation of plane bodies needs materials without a thickness, as its stiffness is "
            "per unit of thickness: leave the thickness out, or hold the surface by a Spring"
        )
    for pair in pairs:
        thickness_on(bodies[pair.slave.body], pair.slave.name, f"the slave of {pair.place}")


def thickness_on(body: Body, surface: str, what: str) -> float:
    """Return the thickness of a body along a surface of it, which must be one."""
    found = np.unique(thickness_of_facets(body, body.mesh.surfaces[surface]))
    if len(found) > 1:
        raise InvalidInputError(
            f"{what} must have one thickness, surface {surface!r} has {', '.join(f'{t:g}' for t in found)}: "
            "give each part a surface of its own"
        )
    return float(found[0])


def thickness_of_facets(body: Body, facets: np.ndarray) -> np.ndarray:
    """Return the thickness of the cells behind facets, (n,)."""
    thickness = body.thickness_of_cells
    if np.ptp(thickness) == 0.0:
        return np.full(len(facets), thickness[0])
    boundary, cell = body.mesh.boundary
    place = match_faces(corners_of(facets, body.mesh.dim), corners_of(boundary, body.mesh.dim))
    return np.asarray(thickness[cell[place]])


def by_thickness(loads: Sequence[Load], bodies: Mapping[str, Body]) -> Iterator[Load]:
    """Yield loads, those on the volume of a body with several thicknesses region by region."""
    for load in loads:
        body = bodies[load.body]
        several = body.has_thickness and len(body.materials) > 1
        yield from load.in_regions(body.mesh.regions) if several else (load,)
