"""Default number of subdomains of a body, and the default partition."""

from __future__ import annotations

import numpy as np

from fenics_contact.checks import check_count
from fenics_contact.errors import InvalidInputError
from fenics_contact.mesh import BodyMesh
from fenics_contact.partition.bisection import bisection_partition
from fenics_contact.partition.cutting import check_one_piece

TARGET_NODES = {3: 700, 2: 1000}
"""Nodes of a subdomain by dimension: about 2000 displacement unknowns in both.

In 3D these are 9 nodes along an edge, as in the published chain of links. In 2D they are 32 nodes
along an edge: the matrices are of the same size, their factors sparser and the interface smaller, and the
condition number grows only with the squared logarithm of the cells along an edge."""

NEAR = (0.8, 1.25)
"""Factors by which the number of subdomains may miss the target so that it can be halved more often."""

_NODES_PER_CELL = {
    "hexahedron": 1.0,
    "tetrahedron": 1.0 / 5.5,
    "quadrilateral": 1.0,
    "triangle": 0.5,
    "hexahedron27": 8.0,
    "quadrilateral9": 4.0,
    "triangle6": 2.0,
    "tetrahedron10": 8.0 / 5.5,
}
"""Nodes per cell in a large mesh; for tetrahedra those of mesh generators (6 in a split hexahedron)."""


def target_parts(mesh: BodyMesh, nodes: float | None = None) -> int:
    """Choose the number of subdomains so that each has about a given number of nodes.

    A subdomain that would have m nodes inside a large mesh has (m^(1/d) + 1)^d once it is torn out.

    Args:
        mesh: Any mesh.
        nodes: Nodes of one subdomain, at least 2^d; unless given 700 in 3D and 1000 in 2D, about 2000
            displacements.

    Returns:
        Number of subdomains, at least 1 and at most the number of cells.

    Raises:
        InvalidInputError: If no subdomain can have so few nodes.
    """
    nodes = TARGET_NODES[mesh.dim] if nodes is None else nodes
    if not 2**mesh.dim <= nodes < np.inf:
        raise InvalidInputError(
            f"nodes must be at least {2**mesh.dim}, which one cell has, got {nodes}: a few hundred are usual"
        )
    inside = (nodes ** (1.0 / mesh.dim) - 1.0) ** mesh.dim
    parts = round(mesh.n_cells * _NODES_PER_CELL[mesh.cell_type] / inside)
    return int(np.clip(parts, 1, mesh.n_cells))


def default_partition(
    mesh: BodyMesh, ranks: int = 1, *, nodes: float | None = None, body: str = ""
) -> np.ndarray:
    """Cut a body into a number of subdomains suited to its size, and at least one for every rank.

    A number near the target that can be halved often is chosen: halves are similar, so that their matrices
    share a pattern. The cuts are those of `bisection_partition`. Only a body with fewer cells than ranks has
    fewer subdomains than there are ranks.

    Args:
        mesh: Any mesh that is connected through faces.
        ranks: Number of MPI ranks.
        nodes: As in `target_parts`.
        body: Name of the body, for messages.

    Returns:
        (n_cells,) subdomain numbers, every subdomain connected through faces; the same on every rank.

    Raises:
        InvalidInputError: If the mesh consists of separate parts, or an argument cannot be used.
    """
    check_count(ranks, "ranks")
    check_one_piece(mesh, body)
    target, least = target_parts(mesh, nodes), min(ranks, mesh.n_cells)
    return bisection_partition(mesh, _often_halved(target, least, mesh.n_cells))


def _often_halved(target: int, least: int, most: int) -> int:
    """Return the number near the target that can be halved most often, the nearer one of two."""
    first, last = (min(max(least, round(factor * target)), most) for factor in NEAR)
    return min(range(first, last + 1), key=lambda number: (-(number & -number), abs(number - target)))
