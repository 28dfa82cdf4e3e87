"""One chain link: a stadium-shaped ring of structured hexahedra or tetrahedra with a named crown."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree

from fenics_contact.display import displayed
from fenics_contact.errors import FenicsContactError, together
from fenics_contact.gallery.memory import require_room
from fenics_contact.gallery.ring import LinkShape, crown_indices, crown_shapes, ring_lattice, stations
from fenics_contact.gallery.ring_gmsh import mesh_ring
from fenics_contact.gallery.ring_spacing import drawn_together
from fenics_contact.gallery.structured import split_hexahedra, structured_cells
from fenics_contact.mesh import BodyMesh, orient

if TYPE_CHECKING:
    from mpi4py import MPI


@displayed
@dataclass(frozen=True, eq=False)
class DesignSurface:
    """Nodes of a surface that a design may move, with smooth coordinates on it.

    Attributes:
        nodes: Node numbers in the body's mesh, (n,) int64; s runs slowest.
        parameters: Surface coordinates (s, t) in [0, 1], (n, 2), of a curve in the plane s alone, (n, 1). On
            the crown of a link s runs along the ring over the contact crown's half turn, t across the wire
            over its inner arc; both proportional to arc length.
        directions: Unit normals of the smooth surface at these nodes, out of the body, (n, dim).
        counts: Number of nodes along s and t, or along s; their product is n.
    """

    nodes: np.ndarray
    parameters: np.ndarray
    directions: np.ndarray
    counts: tuple[int, ...]


@displayed
@dataclass(frozen=True, eq=False)
class Link:
    """A chain link for a scene.

    Attributes:
        shape: Its proportions.
        mesh: The mesh with surfaces "contact" (inner side of the contact crown) and "grip" (inner side of the
            far crown, where the chain's next link would bear), pieces of tori, and grid index (around, a, b).
        crown: The contact surface as a design surface.
    """

    shape: LinkShape
    mesh: BodyMesh
    crown: DesignSurface

    def placed(self, rotation: np.ndarray, translation: np.ndarray) -> Link:
        """Return the link moved rigidly.

        Args:
            rotation: Proper rotation matrix, (3, 3), about the origin, applied first.
            translation: Displacement, (3,).

        Returns:
            The link at its new place; design directions rotate with it.
        """
        mesh = self.mesh.placed(rotation, translation)
        return replace(
            self, mesh=mesh, crown=replace(self.crown, directions=self.crown.directions @ rotation.T)
        )


def chain_link(shape: LinkShape | None = None, comm: MPI.Comm | None = None) -> Link:
    """Build a chain link with gmsh.

    The ring lies in the x-z plane, the middle of the contact crown's inner side at the origin and the link on
    the -x side of its contact crown, see `fenics_contact.gallery.ring`. The same shape gives bitwise the same
    mesh.

    Args:
        shape: Proportions and mesh size; `LinkShape()` unless given.
        comm: If given, gmsh runs on rank 0 only and all ranks receive the mesh.

    Returns:
        The link, replicated.

    Raises:
        InvalidInputError: If the shape cannot be meshed without inverted cells.
        MissingRequirementError: If gmsh cannot be imported.

    Note:
        Collective on ``comm`` if given.
    """
    shape = LinkShape() if shape is None else shape
    require_room(shape.n_around, shape.n_a, shape.n_b)
    if comm is None:
        points, facets = _lattice_from_gmsh(shape)
    else:
        built: tuple[np.ndarray, dict[str, np.ndarray]] | None = None
        with together(comm):
            built = _lattice_from_gmsh(shape) if comm.rank == 0 else None
        points, facets = comm.bcast(built, root=0)
    cells, grid = structured_cells((shape.n_around, shape.n_a, shape.n_b), closed=True)
    surfaces = {name: orient(cells, facets[name]) for name in sorted(facets)}
    mesh = BodyMesh(points, cells, surfaces, grid, shapes=crown_shapes(shape))
    if shape.cell == "tetrahedron":
        mesh = split_hexahedra(mesh, _mirrored(grid, shape))
    return Link(shape, mesh, _crown(shape))


def _lattice_from_gmsh(shape: LinkShape) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Mesh with gmsh and renumber the nodes in the order of the structured lattice.

    gmsh divides an arc into equal pieces to about nine digits, slightly different between versions; the
    returned coordinates are those of the lattice, graded if the link is. For equal pieces gmsh's are checked
    against them.

    Returns:
        Coordinates, (n_nodes, 3), and facets by name, (n_facets, 4), in the numbering of `structured_cells`.
    """
    points, cells, facets = mesh_ring(shape)
    lattice = ring_lattice(shape, shape.spacing.uniform).reshape(-1, 3)
    used = np.unique(cells)
    distance, place = cKDTree(lattice).query(points[used])
    expected, _ = structured_cells((shape.n_around, shape.n_a, shape.n_b), closed=True)
    number = np.full(points.shape[0], -1, dtype=np.int64)
    number[used] = place
    complete = np.array_equal(np.sort(place), np.arange(lattice.shape[0]))
    if not (complete and distance.max() < 1e-6 * shape.thickness and _same_cells(number[cells], expected)):
        raise FenicsContactError(
            f"gmsh must return the ring's lattice of {lattice.shape[0]} nodes and {expected.shape[0]} "
            f"hexahedra, got {used.size} nodes, {cells.shape[0]} hexahedra, nodes off by up to "
            f"{distance.max():.3g}: please report this shape and the version of gmsh"
        )
    return ring_lattice(shape).reshape(-1, 3), {name: number[nodes] for name, nodes in facets.items()}


def _mirrored(grid: np.ndarray, shape: LinkShape) -> np.ndarray:
    """Choose diagonals that make the tetrahedra as symmetric as the link and cut its obtuse corners in two.

    Every hexahedron's diagonal runs from the outside of the section to its middle, and along the ring from
    the contact crown's middle to the far crown's.
    """
    from_middle = (grid[:, 0] - shape.n_around // 16) % shape.n_around
    upper = 2 * grid[:, 1:] + 1 > [shape.n_a, shape.n_b]
    return np.column_stack([from_middle >= shape.n_around // 2, upper])


def _same_cells(cells: np.ndarray, expected: np.ndarray) -> bool:
    """Compare two lists of cells as sets of node sets, in any order."""
    if cells.shape != expected.shape:
        return False
    ours, theirs = np.sort(cells, axis=1), np.sort(expected, axis=1)
    return np.array_equal(ours[np.lexsort(ours.T[::-1])], theirs[np.lexsort(theirs.T[::-1])])


def _crown(shape: LinkShape) -> DesignSurface:
    around, spacing = crown_indices(shape), shape.spacing
    _, outward = stations(shape)
    _, normals = shape.section.inner_arc(shape.n_b, spacing.across)
    across = np.array([0.0, 1.0, 0.0])
    directions = normals[None, :, :1] * outward[around][:, None] + normals[None, :, 1:] * across
    counts = (around.size, shape.n_b + 1)
    ticks = [
        drawn_together(np.linspace(0.0, 1.0, count), 0.5, strength)
        for count, strength in zip(counts, (spacing.along, spacing.across), strict=True)
    ]
    s, t = np.meshgrid(*ticks, indexing="ij")
    nodes = around[:, None] * (shape.n_a + 1) * (shape.n_b + 1) + np.arange(shape.n_b + 1)
    parameters = np.column_stack([s.ravel(), t.ravel()])
    return DesignSurface(nodes.ravel(), parameters, directions.reshape(-1, 3), counts)
