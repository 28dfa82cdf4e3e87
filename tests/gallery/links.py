"""Two small links, and one word that changes with every bit of them."""

from __future__ import annotations

import hashlib

from mpi4py import MPI

from fenics_contact.gallery import LinkShape, two_links

SMALL = LinkShape(n_around=12, n_a=2, n_b=4, cell="tetrahedron")


def digest(comm: MPI.Comm | None) -> str:
    """Reduce two links to one word that changes with every bit of them."""
    pair = two_links(SMALL, comm=comm)
    meshes = (pair.first.mesh, pair.second.mesh)
    arrays = [a for mesh in meshes for a in (mesh.points, mesh.cells, mesh.grid, *mesh.surfaces.values())]
    arrays += [pair.first.crown.directions, pair.second.crown.directions]
    return hashlib.sha256(b"".join(a.tobytes() for a in arrays if a is not None)).hexdigest()
