"""The part of a torn scene that does not depend on its geometry: meshes, numbering, compiled forms."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise

import numpy as np

from fenics_contact._libraries import MPI, start
from fenics_contact.display import displayed
from fenics_contact.errors import InvalidInputError, together
from fenics_contact.fem import FormLibrary, cell_stiffness
from fenics_contact.feti.condensation import Condensations
from fenics_contact.feti.copies import Tearing, tear
from fenics_contact.feti.gluing import GluingRows, gluing_rows, prescribed_displacements
from fenics_contact.feti.same_input import check_same_input
from fenics_contact.feti.subdomain import SubdomainMesh, cut_out
from fenics_contact.linalg import warn_of_threads
from fenics_contact.partition import check_face_connected
from fenics_contact.scene import Scene


@displayed
@dataclass(frozen=True)
class Decomposition:
    """A scene cut into subdomains; each rank holds the meshes of its own.

    Attributes:
        comm: Communicator over which the subdomains are spread.
        tearing: Numbering of nodes, copies and subdomains, replicated.
        partitions: Body name -> subdomain of every cell within the body, replicated.
        meshes: This rank's subdomain meshes, ascending by number.
        block_offset: First block of dofs of each of them in this rank's torn vector, and the total.
        copy_block: Block of each copy in this rank's torn vector, −1 if another rank holds it.
        gluing: Gluing and Dirichlet rows of all subdomains.
        forms: Compiled forms.
        condensations: Symbolic factorisations of this rank's subdomains.
    """

    comm: MPI.Comm
    tearing: Tearing
    partitions: Mapping[str, np.ndarray]
    meshes: tuple[SubdomainMesh, ...]
    block_offset: np.ndarray
    copy_block: np.ndarray
    gluing: GluingRows
    forms: FormLibrary
    condensations: Condensations = field(default_factory=Condensations)

    @property
    def torn_size(self) -> int:
        """Length of this rank's torn vectors."""
        return self.tearing.dim * int(self.block_offset[-1])

    @property
    def torn_unknowns(self) -> int:
        """Number of displacement unknowns of all subdomains of all ranks."""
        return self.tearing.dim * len(self.tearing.copy_subdomain)

    @cached_property
    def parts(self) -> tuple[slice, ...]:
        """Where each of this rank's subdomains lies in its torn vectors."""
        ends = self.tearing.dim * self.block_offset
        return tuple(slice(int(a), int(b)) for a, b in pairwise(ends))

    @cached_property
    def held(self) -> tuple[np.ndarray, np.ndarray]:
        """Numbers of the copies of nodes on this rank, and their blocks in its torn vectors."""
        here = np.flatnonzero(self.copy_block >= 0)
        return here, self.copy_block[here]

    def copies_here(self, nodes: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return for each copy on this rank of some nodes its place among them, its number and its block."""
        place, copy = self.tearing.copies_of(nodes)
        block = self.copy_block[copy]
        here = block >= 0
        return place[here], copy[here], block[here]

    @property
    def torn_stiffness(self) -> np.ndarray:
        """Typical stiffness at each dof of this rank's torn vectors, the largest of all ranks being one."""
        here, block = self.held
        stiffness = np.empty(len(here))
        stiffness[block] = self.tearing.copy_stiffness[here]
        return np.repeat(stiffness, self.tearing.dim)

    @property
    def fixed(self) -> np.ndarray:
        """Marks of prescribed components of nodes, shape (n_nodes, dim), replicated."""
        return self.gluing.fixed


def decompose(scene: Scene, partitions: Mapping[str, np.ndarray], comm: MPI.Comm) -> Decomposition:
    """Cut a scene into subdomains and distribute them over ranks. Collective on ``comm``.

    Args:
        scene: The scene, the same on every rank.
        partitions: Body name -> subdomain of every cell, numbered from 0 within the body.
        comm: Communicator.

    Raises:
        InvalidInputError: If a partition does not fit its body, a subdomain is not connected, there are more
            ranks than subdomains, or scene or partitions differ from rank to rank.
    """
    start(comm)
    check_same_input(comm, scene, partitions=partitions)
    with together(comm):
        _check_partitions(scene, partitions)
        if comm.rank == 0:
            warn_of_threads(comm.size)
    forms = FormLibrary(comm)
    forms.prepare(scene)
    # Ranks agree on errors after each local stage, before the next collective one.
    with together(comm):
        tearing = tear(scene, partitions, comm.size, cell_stiffness(scene, forms))
        if tearing.n_subdomains < comm.size:
            raise InvalidInputError(
                f"every rank needs a subdomain, but {comm.size} ranks share {tearing.n_subdomains} "
                f"subdomains: partition with scene.partition({comm.size}), cut the bodies finer, or run on "
                "fewer ranks"
            )
    with together(comm):
        meshes = tuple(
            _cut(scene, partitions, tearing, int(number))
            for number in np.flatnonzero(tearing.subdomain_rank == comm.rank)
        )
        gluing = gluing_rows(tearing, ~np.isnan(prescribed_displacements(scene, tearing)))
    block_offset = np.cumsum([0] + [len(mesh.nodes) for mesh in meshes])
    copy_block = _copy_blocks(tearing, meshes, block_offset)
    return Decomposition(comm, tearing, dict(partitions), meshes, block_offset, copy_block, gluing, forms)


def _check_partitions(scene: Scene, partitions: Mapping[str, np.ndarray]) -> None:
    if not isinstance(partitions, Mapping):
        raise InvalidInputError(
            f"partitions must give the subdomain of each cell by the names of bodies, got {partitions!r}: "
            "leave them out, or cut bodies by graph_partition or box_partition of fenics_contact.partition"
        )
    for name, body in scene.bodies.items():
        if name not in partitions:
            raise InvalidInputError(
                f"every body needs a partition, got them for {sorted(partitions)} but not for {name!r}: "
                "pass the subdomain of each of its cells"
            )
        partition = partitions[name]
        if not isinstance(partition, np.ndarray) or partition.shape != (body.mesh.n_cells,):
            given = partition.shape if isinstance(partition, np.ndarray) else repr(partition)
            raise InvalidInputError(
                f"the partition of body {name!r} must have shape ({body.mesh.n_cells},), one "
                f"subdomain per cell, got {given}: graph_partition or box_partition of "
                "fenics_contact.partition cuts a mesh into a number of subdomains"
            )
        check_face_connected(body.mesh, partition)


def _cut(scene: Scene, partitions: Mapping[str, np.ndarray], tearing: Tearing, number: int) -> SubdomainMesh:
    index = int(np.searchsorted(tearing.subdomain_offset, number, side="right")) - 1
    name = tearing.body_names[index]
    cells = np.flatnonzero(partitions[name] == number - tearing.subdomain_offset[index])
    return cut_out(number, name, scene.bodies[name], cells)


def _copy_blocks(tearing: Tearing, meshes: tuple[SubdomainMesh, ...], block_offset: np.ndarray) -> np.ndarray:
    total = tearing.n_subdomains
    keys = tearing.copy_node * total + tearing.copy_subdomain
    blocks = np.full(len(keys), -1, dtype=np.int64)
    for mesh, offset in zip(meshes, block_offset[:-1], strict=True):
        wanted = tearing.global_nodes(mesh.body, mesh.nodes) * total + mesh.number
        blocks[np.searchsorted(keys, wanted)] = offset + np.arange(len(mesh.nodes))
    return blocks
