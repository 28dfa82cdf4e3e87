"""What a load step costs: a block of rubber pressed on a plane and dragged, beside small strains."""

from __future__ import annotations

from dataclasses import replace
from time import perf_counter
from typing import Any

import numpy as np
from mpi4py import MPI

from fenics_contact import (
    Body,
    BodyMesh,
    ContactPair,
    ContactProblem,
    Coulomb,
    LoadSequence,
    LoadStep,
    RigidPlane,
    Scene,
    Support,
    Surface,
    box_partition,
    solve_scene,
)
from fenics_contact.gallery import block
from fenics_contact.materials import IsotropicElasticity, Material, NeoHooke

#: Displacements (x, z) of the upper side at the ends of load steps, and the friction below, by what is done.
WAYS = {
    "press": (((0.0, -0.1), (0.0, -0.2)), 0.0),
    "drag": (((0.0, -0.1), (0.04, -0.1), (0.08, -0.1), (0.12, -0.1)), 0.5),
}
#: Cells along the edges of a subdomain.
CELLS = 3
#: Poisson's ratio from which cells lock unless their dilatation is that of their mean.
LOCKS = 0.48


def cube(parts: int) -> BodyMesh:
    """Mesh a unit cube of parts³ subdomains, whose lower side bulges."""
    mesh = block((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), (parts * CELLS,) * 3)
    x, y, z = mesh.points.T
    bulge = 0.15 * ((x - 0.5) ** 2 + (y - 0.5) ** 2)
    return replace(mesh, points=np.column_stack([x, y, z + bulge * (1.0 - z)]))


def held(place: tuple[float, float]) -> list[Support]:
    """Return the support of the upper side."""
    return [Support("cube", "z1", (place[0], 0.0, place[1]))]


def scene(mesh: BodyMesh, material: Material, way: str) -> Scene:
    """Return the cube on its plane at the first load of a way."""
    places, friction = WAYS[way]
    plane, law = RigidPlane((0, 0, 0), (0, 0, 1)), Coulomb(friction) if friction else None
    pair = ContactPair(Surface("cube", "z0"), plane, law)
    return Scene({"cube": Body(mesh, material)}, held(places[0]), contacts=[pair])


def measured(comm: MPI.Comm, parts: int, ratio: float, way: str) -> dict[str, Any]:
    """Return products and factorisations of the load steps, and products of the first one at small strain.

    Args:
        comm: Communicator.
        parts: Subdomains along an edge.
        ratio: Poisson's ratio.
        way: What is done, see `WAYS`.
    """
    mesh, began = cube(parts), perf_counter()
    cut = {"cube": box_partition(mesh, (parts,) * 3)}
    small = solve_scene(
        scene(mesh, IsotropicElasticity(1.0, ratio), way), comm, partitions=cut, tolerance=1e-8
    )
    rubber = NeoHooke(1.0, ratio, mean_dilatation=ratio > LOCKS)
    sequence = LoadSequence(ContactProblem(scene(mesh, rubber, way), comm, partitions=cut))
    states = [sequence.advance(LoadStep(f"to {place}", supports=held(place))) for place in WAYS[way][0]]
    return {
        "parts": parts,
        "ratio": ratio,
        "way": way,
        "unknowns": mesh.points.size,
        "small_products": small.counts["f_products"],
        "products": [state.solution.products for state in states],
        "factorisations": [len(state.solution.history) for state in states],
        "seconds": round(perf_counter() - began, 1),
    }
