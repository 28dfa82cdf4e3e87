"""The part of a torn scene that does not depend on its geometry: meshes, numbering, gluing rows."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property, partial
from itertools import pairwise

import numpy as np
import scipy.sparse as sp

from fenics_contact import _dolfinx
from fenics_contact._base.costs import count_messages, count_of_exchange, with_ledger
from fenics_contact._base.display import displayed
from fenics_contact._base.libraries import MPI, PETSc, free_communicators, start
from fenics_contact._base.shared import once_a_machine
from fenics_contact._base.sparse import LAST_PLACES, dispose_with, sent
from fenics_contact._fem.forms import FormLibrary, cell_stiffness
from fenics_contact._pairing.points import NodeNumbers
from fenics_contact._scene.local_axes import NO_AXES, LocalAxes, joined_axes, same_axes
from fenics_contact._scene.memory import Subdomains, require_memory
from fenics_contact._scene.revolution import hold_axis
from fenics_contact._scene.scene import Scene
from fenics_contact._scene.tools import check_partitions, with_tool_parts
from fenics_contact.errors import InvalidInputError, together
from fenics_contact.feti.following import dependent_nodes
from fenics_contact.feti.same_input import check_same_input
from fenics_contact.feti.subdomain import SubdomainMesh, cut_out
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.mesh.cuts import pieces
from fenics_contact.mesh.held_once import hold_once_a_machine
from fenics_contact.mesh.partition import check_face_connected, kept_together


@displayed
@dataclass(frozen=True)
class Tearing(NodeNumbers):
    """The subdomains of the bodies of a scene, and the rank that owns each.

    Held once a machine. Subdomains, like nodes, are numbered consecutively, body after body. A *copy* is
    a pair (node, subdomain); copies are sorted by node, then by subdomain. `first_copy`: first copy of each
    node and the total; `copy_stiffness`: typical stiffness at each copy, the largest being one.
    """

    components: int
    subdomain_offset: np.ndarray
    subdomain_rank: np.ndarray
    first_copy: np.ndarray
    copy_subdomain: np.ndarray
    copy_stiffness: np.ndarray

    @property
    def multiplicity(self) -> np.ndarray:
        """Number of copies of each node, shape (n_nodes,)."""
        return np.diff(self.first_copy)

    @property
    def copy_node(self) -> np.ndarray:
        """Node of each copy, shape (n_copies,)."""
        return np.repeat(np.arange(self.n_nodes), self.multiplicity)

    def copies_in(self, nodes: np.ndarray, subdomain: int) -> np.ndarray:
        """Return the copy of each of some nodes in a subdomain that has them all."""
        _, copies = self.copies_of(nodes)
        return copies[self.copy_subdomain[copies] == subdomain]

    def copies_of(self, nodes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return for each copy of each of some nodes the place of that node among them, and the copy."""
        copies = self.first_copy[nodes + 1] - self.first_copy[nodes]
        within = np.arange(copies.sum()) - np.repeat(np.cumsum(copies) - copies, copies)
        return np.repeat(np.arange(len(nodes)), copies), np.repeat(self.first_copy[nodes], copies) + within

    @cached_property
    def copy_share(self) -> np.ndarray:
        """Stiffness of each copy relative to all copies of its node, shape (n_copies,)."""
        return self.copy_stiffness / np.repeat(
            np.add.reduceat(self.copy_stiffness, self.first_copy[:-1]), self.multiplicity
        )

    @cached_property
    def on_several_ranks(self) -> np.ndarray:
        """Whether subdomains of different ranks share a node, shape (n_nodes,)."""
        rank, first = self.subdomain_rank[self.copy_subdomain], self.first_copy[:-1]
        return np.asarray(np.minimum.reduceat(rank, first) != np.maximum.reduceat(rank, first))

    @property
    def n_subdomains(self) -> int:
        """Number of subdomains of all bodies."""
        return int(self.subdomain_offset[-1])


def tear(
    scene: Scene, partitions: Mapping[str, np.ndarray], rank: np.ndarray, stiffness: Mapping[str, np.ndarray]
) -> Tearing:
    """Cut the bodies along a partition of their cells.

    `rank`: the one that gets each subdomain, body after body.
    """
    numbers = NodeNumbers.of(scene)
    names, node_offset = numbers.body_names, numbers.node_offset
    counts = [int(partitions[name].max()) + 1 for name in names]
    subdomain_offset = np.cumsum([0, *counts])
    total = int(subdomain_offset[-1])
    keys, sums = [], []
    for index, name in enumerate(names):
        mesh = scene.bodies[name].mesh
        order = np.argsort(partitions[name], kind="stable")
        ends = np.cumsum(np.bincount(partitions[name], minlength=counts[index]))
        # One subdomain after the other: the corners of all cells at once take more memory than the meshes.
        for number, own in enumerate(np.split(order, ends[:-1])):
            nodes, where, times = np.unique(mesh.cells[own], return_inverse=True, return_counts=True)
            added = np.bincount(where.ravel(), np.repeat(stiffness[name][own], mesh.cells.shape[1]))
            # One integer key per node and subdomain: keys in their order are those of copies.
            keys.append((nodes + node_offset[index]) * total + subdomain_offset[index] + number)
            # Beside cells of another size the number of cells counts as well: a fifth fewer products.
            sums.append(added / (2**scene.dim if mesh.hanging else times))
    key, stiff = np.concatenate(keys), np.concatenate(sums)
    order = np.argsort(key)
    key, stiff = key[order], stiff[order]
    multiplicity = np.bincount(key // total, minlength=int(node_offset[-1]))
    return Tearing(
        names,
        node_offset,
        scene.components,
        subdomain_offset,
        rank,
        np.concatenate([[0], np.cumsum(multiplicity)]),
        key % total,
        stiff / stiff.max(),
    )


@dataclass(frozen=True)
class Rows:
    """Some rows of B; entry k is B[row[k], (copy[k], component[k])] = value[k].

    Attributes:
        row: Row of each entry, numbered from 0 within these rows, shape (n_entries,).
        copy: Copy of a node, shape (n_entries,).
        component: 0, 1 or 2, shape (n_entries,).
        value: Coefficient, shape (n_entries,).
        right: Right side c of each row, shape (n_rows,), [length].
        owner: Rank that owns each row, shape (n_rows,).
    """

    row: np.ndarray
    copy: np.ndarray
    component: np.ndarray
    value: np.ndarray
    right: np.ndarray
    owner: np.ndarray

    @property
    def count(self) -> int:
        """Number of rows."""
        return len(self.right)


def entries(parts: Sequence[Rows]) -> tuple[np.ndarray, ...]:
    """Return row, copy, component and value of the entries of several groups, numbered consecutively."""
    starts = np.cumsum([0] + [part.count for part in parts])
    row = np.concatenate([part.row + start for part, start in zip(parts, starts, strict=False)])
    names = ("copy", "component", "value")
    return row, *(np.concatenate([getattr(part, name) for part in parts]) for name in names)


def prescribed_displacements(scene: Scene, tearing: Tearing) -> np.ndarray:
    """Collect the supports node by node.

    Returns the value of each prescribed component, NaN where it is free, shape (n_nodes, dim), [length],
    along the axes of `prescribed_along`.
    """
    return prescribed_along(scene, tearing)[0]


def prescribed_along(scene: Scene, tearing: Tearing) -> tuple[np.ndarray, LocalAxes]:
    """Collect the supports node by node, with the axes of nodes that rollers hold.

    Returns the value of each prescribed component, NaN where it is free, shape (n_nodes, dim), [length], and
    along which axes.
    """
    prescribed, largest = np.full((tearing.n_nodes, scene.components), np.nan), 0.0
    held = ((support, *each) for support in scene.supports for each in support.held(scene))
    for support, own, given in held:
        nodes = tearing.global_nodes(support.body, own)
        known = prescribed[nodes]
        largest = max(largest, np.nanmax(np.abs(given)))
        clash = ~np.isnan(known) & ~np.isnan(given) & (np.abs(known - given) > LAST_PLACES * largest)
        if clash.any():
            node, component = np.argwhere(clash)[0]
            raise InvalidInputError(
                f"supports must agree where they meet: component {component} of surface {support.surface!r} "
                f"of body {support.body!r} has another value than {given[node, component]:g}: leave one None"
            )
        prescribed[nodes] = np.where(np.isnan(given), known, given)
    for name in tearing.body_names:
        first = tearing.first_of(name)
        hold_axis(scene.bodies[name], name, prescribed[first : first + scene.bodies[name].mesh.n_nodes])
    parts = []
    for body in scene.rolling_bodies:
        first = tearing.first_of(body)
        every = slice(first, first + scene.bodies[body].mesh.n_nodes)
        prescribed[every], axes = scene.held_by_rollers(body, prescribed[every])
        parts.append(axes.after(first))
    return prescribed, joined_axes(parts)


def weighted_helmert(stiffness: np.ndarray) -> np.ndarray:
    """Return rows of unit length that vanish on equal copies and are orthogonal in the inner product D⁻¹.

    Row k is the difference between the stiffness-weighted mean of the first k copies and the next one; with
    equal stiffnesses these are the rows of a Helmert matrix. `stiffness`: D of the copies of each node.
    """
    count, copies = stiffness.shape
    rows = np.zeros((count, copies - 1, copies))
    for k in range(1, copies):  # a few copies, all nodes at once
        rows[:, k - 1, :k] = stiffness[:, :k] / stiffness[:, :k].sum(axis=1, keepdims=True)
        rows[:, k - 1, k] = -1.0
    return rows / np.linalg.norm(rows, axis=2, keepdims=True)


@dataclass(frozen=True)
class GluingNumbers:
    """The numbers of gluing rows, held once a machine.

    `start`: first row of each component of each node, and the total, shape (n_nodes · dim + 1,); `dof`: node
    and component that each row belongs to, as node · dim + component; `owner`: rank that owns each row;
    `right`: zeros; `fixed`: marks of prescribed components, shape (n_nodes, dim).
    """

    start: np.ndarray
    dof: np.ndarray
    owner: np.ndarray
    right: np.ndarray
    fixed: np.ndarray

    @classmethod
    def of(cls, tearing: Tearing, fixed: np.ndarray, dependent: np.ndarray) -> GluingNumbers:
        """Number the rows, see `gluing_rows`."""
        counts = tearing.multiplicity
        counts[dependent] = 1
        counts = np.where(fixed, counts[:, None], counts[:, None] - 1).ravel()
        start = np.concatenate([[0], np.cumsum(counts)])
        dof = np.repeat(np.arange(fixed.size), counts)
        # A gluing row belongs to the rank of its node's first copy, a prescribing row to that of its copy.
        within = np.where(fixed.ravel()[dof], np.arange(len(dof)) - start[dof], 0)
        anchor = tearing.first_copy[dof // tearing.components] + within
        owner = tearing.subdomain_rank[tearing.copy_subdomain[anchor]]
        return cls(start, dof, owner, np.zeros(len(dof)), fixed)


@dataclass(frozen=True)
class GluingRows:
    """The equality rows that glue torn bodies together and fix them at their supports.

    `rows`: the rows, with their entries on this rank's copies; their right side is filled from the supports
    of a load, see `right_side`; `dof`: node and component that each row belongs to, as node · dim +
    component.
    """

    rows: Rows
    dof: np.ndarray
    fixed: np.ndarray
    axes: LocalAxes = NO_AXES

    def right_side(self, prescribed: np.ndarray, axes: LocalAxes = NO_AXES) -> np.ndarray:
        """Return c of the rows for displacements from `prescribed_along`."""
        if not same_axes(axes, self.axes):
            raise InvalidInputError(
                "supports may change values alone, rollers hold other directions: decompose the scene again"
            )
        if not np.array_equal(~np.isnan(prescribed), self.fixed):
            raise InvalidInputError(
                "supports may change values alone, they hold other components: decompose the scene again"
            )
        return np.nan_to_num(prescribed).ravel()[self.dof]


def gluing_rows(
    tearing: Tearing,
    fixed: np.ndarray,
    axes: LocalAxes = NO_AXES,
    dependent: Sequence[int] | np.ndarray = (),
    rank: int | None = None,
) -> GluingRows:
    """Build the equality rows B_E u = c_E, for which B_E D⁻¹ B_Eᵀ is diagonal, D the stiffness of copies.

    A free component of a node with m copies has m − 1 gluing rows of unit length (see `weighted_helmert`, c =
    0). A prescribed one has m rows, one for each copy, which glue it as well. Components are along the `axes`
    of nodes, which keeps them orthogonal. Dependent nodes have no rows, as each copy follows its masters.
    `dependent`: numbers of nodes that hang or are centres, none of which is; `rank`: the one whose copies the
    entries are on; None: all entries.
    """
    dependent = np.asarray(dependent, dtype=np.int64)
    return rows_of(tearing, GluingNumbers.of(tearing, fixed, dependent), axes, dependent, rank)


def rows_of(
    tearing: Tearing, numbers: GluingNumbers, axes: LocalAxes, dependent: np.ndarray, rank: int | None
) -> GluingRows:
    """Return gluing rows with these numbers, see `gluing_rows`."""
    mine = (tearing.subdomain_rank == rank) | (rank is None)
    here = mine[tearing.copy_subdomain]
    touched = np.logical_or.reduceat(here, tearing.first_copy[:-1])[:, None]
    multiplicity = tearing.multiplicity
    multiplicity[dependent] = 1
    fixed, start = numbers.fixed, numbers.start
    parts = [_prescribed_entries(tearing, fixed & touched, start)]
    for copies in np.unique(multiplicity[multiplicity > 1]):
        glued = touched & ~fixed & (multiplicity == copies)[:, None]
        parts.append(_glued_entries(tearing, glued, start, int(copies)))
    row, copy, component, entry = (np.concatenate(column) for column in zip(*parts, strict=True))
    if axes:
        row, copy, component, entry = _turned_entries(tearing, axes, row, copy, component, entry)
    row, copy, component, entry = (each[here[copy]] for each in (row, copy, component, entry))
    rows = Rows(row, copy, component, entry, numbers.right, numbers.owner)
    return GluingRows(rows, numbers.dof, fixed, axes)


def _turned_entries(
    tearing: Tearing,
    axes: LocalAxes,
    row: np.ndarray,
    copy: np.ndarray,
    component: np.ndarray,
    entry: np.ndarray,
) -> tuple[np.ndarray, ...]:
    """Return entries along the coordinates for those along the axes of nodes."""
    place = axes.place(tearing.copy_node[copy])
    plain, turned = np.flatnonzero(place < 0), np.flatnonzero(place >= 0)
    value = entry[turned, None] * axes.axes[place[turned], component[turned]]
    which, along = np.nonzero(value)
    source = np.concatenate([plain, turned[which]])
    component = np.concatenate([component[plain], along])
    return row[source], copy[source], component, np.concatenate([entry[plain], value[which, along]])


def _prescribed_entries(tearing: Tearing, fixed: np.ndarray, start: np.ndarray) -> tuple[np.ndarray, ...]:
    node, component = np.nonzero(fixed)
    copies = tearing.first_copy[node + 1] - tearing.first_copy[node]
    within = np.arange(copies.sum()) - np.repeat(np.cumsum(copies) - copies, copies)
    row = np.repeat(start[tearing.components * node + component], copies) + within
    copy = np.repeat(tearing.first_copy[node], copies) + within
    return row, copy, np.repeat(component, copies), np.ones(len(row))


def _glued_entries(
    tearing: Tearing, glued: np.ndarray, start: np.ndarray, copies: int
) -> tuple[np.ndarray, ...]:
    node, component = np.nonzero(glued)
    copy_of = tearing.first_copy[node][:, None] + np.arange(copies)
    matrix = weighted_helmert(tearing.copy_stiffness[copy_of])
    k, j = np.nonzero(np.tri(copies - 1, copies, 1))
    row = start[tearing.components * node + component][:, None] + k
    return row.ravel(), copy_of[:, j].ravel(), np.repeat(component, len(k)), matrix[:, k, j].ravel()


@displayed
@dataclass(frozen=True)
class Decomposition:
    """A scene cut into subdomains; each rank holds the meshes of its own.

    `block_offset`: first block of dofs of each of them in this rank's torn vector, and the total;
    `held`: numbers of the copies of nodes on this rank, ascending, and their blocks in its torn vectors;
    `compact`: whether a state fits into memory only with subdomains stored as `LocalKind.COMPACT`.
    """

    comm: MPI.Comm
    tearing: Tearing
    partitions: Mapping[str, np.ndarray]
    meshes: tuple[SubdomainMesh, ...]
    block_offset: np.ndarray
    held: tuple[np.ndarray, np.ndarray]
    gluing: GluingRows
    forms: FormLibrary
    compact: bool = False

    @property
    def torn_size(self) -> int:
        """Length of this rank's torn vectors."""
        return self.tearing.components * int(self.block_offset[-1])

    @property
    def torn_unknowns(self) -> int:
        """Number of displacement unknowns of all subdomains of all ranks."""
        return self.tearing.components * len(self.tearing.copy_subdomain)

    @cached_property
    def parts(self) -> tuple[slice, ...]:
        """Where each of this rank's subdomains lies in its torn vectors."""
        ends = self.tearing.components * self.block_offset
        return tuple(slice(int(a), int(b)) for a, b in pairwise(ends))

    def on_followed(self, force: np.ndarray) -> np.ndarray:
        """Return Tᵀ f of a torn force of this rank, (torn_size,): none is left on dependent nodes."""
        own = zip(self.meshes, self.parts, strict=True)
        return np.concatenate([np.zeros(0), *(mesh.following.force(force[part]) for mesh, part in own)])

    @cached_property
    def following(self) -> sp.csr_matrix:
        """T on this rank's torn vectors: dependent nodes at the displacement of others."""
        means = [mesh.following.means for mesh in self.meshes]
        return sp.csr_matrix(sp.block_diag([sp.csr_matrix((0, 0)), *means]))

    def blocks_of(self, copies: np.ndarray) -> np.ndarray:
        """Return the block of each copy in this rank's torn vectors, −1 if another rank holds it."""
        here, block = self.held
        place = np.minimum(np.searchsorted(here, copies), len(here) - 1)
        return np.where(here[place] == copies, block[place], -1)

    def copies_here(self, nodes: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return for each copy on this rank of some nodes its place among them, its number and its block."""
        place, copy = self.tearing.copies_of(nodes)
        block = self.blocks_of(copy)
        here = block >= 0
        return place[here], copy[here], block[here]

    @property
    def torn_stiffness(self) -> np.ndarray:
        """Typical stiffness at each dof of this rank's torn vectors, the largest of all ranks being one."""
        here, block = self.held
        stiffness = np.empty(len(here))
        stiffness[block] = self.tearing.copy_stiffness[here]
        return np.repeat(stiffness, self.tearing.components)

    @property
    def fixed(self) -> np.ndarray:
        """Marks of prescribed components of nodes, shape (n_nodes, dim), replicated."""
        return self.gluing.fixed

    @property
    def axes(self) -> LocalAxes:
        """Axes of nodes along which components are prescribed or free."""
        return self.gluing.axes

    def holding(self, scene: Scene) -> Decomposition:
        """Return the subdomains with the rows of a scene's supports: itself if it holds the same. Collective.

        In Total FETI what supports hold is in these rows alone: matrices, kernels and factors stay.
        """
        fixed, axes = once_a_machine(self.comm, lambda: _fixed(scene, self.tearing))
        with together(self.comm):
            if np.array_equal(fixed, self.fixed) and same_axes(axes, self.axes):
                return self
            dependent = dependent_nodes(scene, self.tearing)
        return replace(self, gluing=_glued(self.tearing, fixed, axes, dependent, self.comm))

    def weighted(self, scene: Scene, stiffness: np.ndarray, near: float = 2.0) -> Decomposition:
        """Return the subdomains with other typical stiffnesses of copies, and rows for them. Collective.

        Itself where none changes by more than a factor ``near``. `stiffness`: of each block of this rank.
        """
        here, block = self.held
        every = np.zeros(len(self.tearing.copy_subdomain))
        every[here] = stiffness[block]
        change = (every := np.asarray(self.comm.allreduce(every))) / self.tearing.copy_stiffness
        if max(change.max(), 1.0 / change.min()) <= near:
            return self
        tearing = once_a_machine(self.comm, lambda: replace(self.tearing, copy_stiffness=every))
        with together(self.comm):
            dependent = dependent_nodes(scene, tearing)
        return replace(
            self, tearing=tearing, gluing=_glued(tearing, self.fixed, self.axes, dependent, self.comm)
        )


def decompose(
    scene: Scene, partitions: Mapping[str, np.ndarray], comm: MPI.Comm, *, memory: float | None = None
) -> Decomposition:
    """Cut a scene into subdomains and distribute them over ranks. Collective on ``comm``.

    Args:
        scene: The scene, the same on every rank.
        partitions: Body name -> subdomain of every cell, numbered from 0 within the body.
        comm: Communicator.
        memory: What a state may take on a machine, [bytes]; None: what it has left.

    Raises:
        InvalidInputError: If a partition does not fit its body, a subdomain is not connected, there are more
            ranks than subdomains, or scene or partitions differ from rank to rank.
    """
    start(comm)
    comm = with_ledger(comm)
    partitions = with_tool_parts(scene.bodies, partitions)
    check_same_input(comm, scene, partitions=partitions)
    touching = {surface.body for pair in (*scene.contacts, *scene.ties) for surface in pair.surfaces}
    whole = {name: body.mesh for name, body in scene.bodies.items()}
    hold_once_a_machine(comm, [*whole.values()], [mesh for name, mesh in whole.items() if name in touching])
    partitions = once_a_machine(comm, lambda: _checked_partitions(scene, partitions))
    counted = cache(partial(Subdomains.of, scene, partitions))
    compact = not scene.is_nonlinear and require_memory(scene, counted, comm, limit=memory)
    forms = FormLibrary(comm)
    forms.prepare(scene)
    tearing = once_a_machine(comm, lambda: _torn(scene, partitions, counted, comm.size, forms))
    # Ranks agree on errors after each local stage, before the next collective one.
    with together(comm):
        if tearing.n_subdomains < comm.size:
            raise InvalidInputError(
                f"{comm.size} ranks need as many subdomains, got {tearing.n_subdomains}: use scene.partition"
            )
        here = np.flatnonzero(tearing.subdomain_rank == comm.rank)
        _check_communicators(len(here), each=20 if scene.is_nonlinear else 14)
    with together(comm):
        meshes = tuple(_cut(scene, partitions, tearing, here))
        dependent = dependent_nodes(scene, tearing)
    fixed, axes = once_a_machine(comm, lambda: _fixed(scene, tearing))
    gluing = _glued(tearing, fixed, axes, dependent, comm)
    block_offset = np.cumsum([0] + [len(mesh.nodes) for mesh in meshes])
    held = _held(tearing, meshes, block_offset)
    return Decomposition(comm, tearing, dict(partitions), meshes, block_offset, held, gluing, forms, compact)


def _torn(
    scene: Scene,
    partitions: Mapping[str, np.ndarray],
    counted: Callable[[], Subdomains],
    ranks: int,
    forms: FormLibrary,
) -> Tearing:
    """Cut the bodies, see `tear`, and compute what follows from the cuts alone."""
    rank = _dealt(scene, partitions, counted, ranks)
    tearing = tear(scene, partitions, rank, cell_stiffness(scene, forms))
    _ = tearing.copy_share, tearing.on_several_ranks  # which stay with it: held once a machine, too
    return tearing


def _fixed(scene: Scene, tearing: Tearing) -> tuple[np.ndarray, LocalAxes]:
    """Return the marks of prescribed components of nodes, shape (n_nodes, dim), and along which axes."""
    prescribed, axes = prescribed_along(scene, tearing)
    return ~np.isnan(prescribed), axes


def _glued(
    tearing: Tearing, fixed: np.ndarray, axes: LocalAxes, dependent: np.ndarray, comm: MPI.Comm
) -> GluingRows:
    """Return the gluing rows with their entries on this rank's copies. Collective on ``comm``."""
    numbers = once_a_machine(comm, lambda: GluingNumbers.of(tearing, fixed, dependent))
    with together(comm):
        return rows_of(tearing, numbers, axes, dependent, comm.rank)


def _whole(mesh: BodyMesh, partition: np.ndarray) -> np.ndarray:
    """Return a partition whose subdomains no cut crosses, with whole sets of siblings at hanging nodes."""
    return kept_together(mesh, pieces(mesh, partition))


def _checked_partitions(scene: Scene, partitions: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    check_partitions(scene.bodies, partitions)
    for name, body in scene.bodies.items():
        check_face_connected(body.mesh, pieces(body.mesh, partitions[name]))
    return {name: _whole(body.mesh, partitions[name]) for name, body in scene.bodies.items()}


def _dealt(
    scene: Scene, partitions: Mapping[str, np.ndarray], counted: Callable[[], Subdomains], ranks: int
) -> np.ndarray:
    """Return the rank of each subdomain, body after body."""
    if ranks == 1:
        return np.zeros(sum(int(part.max()) + 1 for part in partitions.values()), dtype=np.int64)
    parts = counted()
    # Tangents differ wherever bodies are deformed: nothing is alike.
    return (parts.unlike if scene.is_nonlinear else parts).dealt(ranks)


def _check_communicators(subdomains: int, each: int) -> None:
    """Raise where MPICH, which has 2048 communicators a process, would run out of them and end all ranks.

    `each`: what meshes, fields and factors of a subdomain take, measured with dolfinx 0.11 and MUMPS.
    """
    needed = each * subdomains
    left = free_communicators(needed)
    if left < needed:
        raise InvalidInputError(
            f"{subdomains} subdomains need about {needed} communicators of MPI, MPICH has {left} left: "
            "delete states, use fewer subdomains, more ranks, or Open MPI"
        )


def _cut(
    scene: Scene, partitions: Mapping[str, np.ndarray], tearing: Tearing, here: np.ndarray
) -> Iterator[SubdomainMesh]:
    spaces: dict[bytes, _dolfinx.fem.FunctionSpace] = {}
    body = np.searchsorted(tearing.subdomain_offset, here, side="right") - 1
    for number, index in zip(here, body, strict=True):
        name = tearing.body_names[index]
        cells = np.flatnonzero(partitions[name] == number - tearing.subdomain_offset[index])
        yield cut_out(int(number), name, scene.bodies[name], cells, spaces)


def _held(
    tearing: Tearing, meshes: tuple[SubdomainMesh, ...], block_offset: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the copies of nodes on this rank, ascending, and their blocks in its torn vectors."""
    parts = [tearing.copies_in(tearing.global_nodes(mesh.body, mesh.nodes), mesh.number) for mesh in meshes]
    copies = np.concatenate(parts)
    order = np.argsort(copies)
    return copies[order], order


def _in_order(owner: np.ndarray) -> np.ndarray:
    """Return the position of each row where they are in the order of owners."""
    position = np.empty(len(owner), dtype=np.int64)
    position[np.argsort(owner, kind="stable")] = np.arange(len(owner))
    return position


class DualNumbering:
    """Numbering of multipliers over ranks: each is owned by one rank and shared by those that touch it.

    Rows of B are first numbered in an order that does not depend on the number of ranks (*row numbers*). A
    rank owns some of them, in ascending order; *local* vectors hold the owned entries followed by the ghosts,
    the touched entries that other ranks own. `ghosts`: row numbers that it touches but does not own,
    ascending; `offset`: position of the first owned entry in the concatenation of all ranks' owned parts.
    """

    def __init__(self, comm: MPI.Comm, owner: np.ndarray, touched: np.ndarray) -> None:
        """Build numbering and exchange; owners are held once a machine. Collective on ``comm``."""
        self.comm = comm
        self.total = len(owner)
        self.owner, self._touched = owner, touched
        self._position = once_a_machine(comm, lambda: _in_order(owner))
        self.owned = np.flatnonzero(owner == comm.rank)
        self.offset = int(np.count_nonzero(owner < comm.rank))
        self.ghosts = touched[owner[touched] != comm.rank]
        self._messages = count_of_exchange(comm, owner[self.ghosts])
        self._vector = PETSc.Vec().createGhost(
            self._position[self.ghosts].astype(PETSc.IntType), (len(self.owned), self.total), comm=comm
        )
        dispose_with(self, self._vector, comm=comm)

    def serves(self, owner: np.ndarray, touched: np.ndarray) -> bool:
        """Return whether this rank's part is that of rows with these owners, touched as given."""
        return np.array_equal(self.owner, owner) and np.array_equal(self._touched, touched)

    @property
    def local_rows(self) -> np.ndarray:
        """Row numbers of a local vector, owned ones first."""
        return np.concatenate([self.owned, self.ghosts])

    def local_index(self, rows: np.ndarray) -> np.ndarray:
        """Return the positions of touched or owned rows in a local vector."""
        own = self.owned_index(rows)
        return np.where(own >= 0, own, len(self.owned) + np.searchsorted(self.ghosts, rows))

    def position(self, rows: np.ndarray) -> np.ndarray:
        """Return the positions of rows in the concatenation of all ranks' owned parts."""
        return self._position[rows]

    def owned_index(self, rows: np.ndarray) -> np.ndarray:
        """Return the positions of rows in this rank's owned vector, −1 for rows of other ranks."""
        if len(self.owned) == 0:
            return np.full(rows.shape, -1)
        index = np.minimum(np.searchsorted(self.owned, rows), len(self.owned) - 1)
        return np.where(self.owned[index] == rows, index, -1)

    def to_local(self, owned: np.ndarray) -> np.ndarray:
        """Return the local vector (owned, then ghosts) of an owned one. Collective."""
        count_messages(self.comm, self._messages)
        self._vector.array_w[:] = owned
        self._vector.ghostUpdate(PETSc.InsertMode.INSERT, PETSc.ScatterMode.FORWARD)
        with self._vector.localForm() as local:
            return np.array(local.array_r)

    def to_owned(self, local: np.ndarray) -> np.ndarray:
        """Add up the shares of all ranks and return the owned part. Collective."""
        count_messages(self.comm, self._messages)
        with self._vector.localForm() as form:
            form.array_w[:] = local
        self._vector.ghostUpdate(PETSc.InsertMode.ADD_VALUES, PETSc.ScatterMode.REVERSE)
        return np.array(self._vector.array_r)

    def gather(self, owned: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """Return entries of an owned vector for any rows, on every rank. Collective.

        Meant for contact rows, which are few; ``rows`` must be the same on every rank.
        """
        mine, index = np.zeros(len(rows)), self.owned_index(rows)
        mine[index >= 0] = owned[index[index >= 0]]
        return np.asarray(self.comm.allreduce(mine))

    def sum_rows(self, local: sp.csr_matrix) -> sp.csr_matrix:
        """Add up the ranks' shares of a sparse matrix with one row for each multiplier. Collective."""
        own, shares = local[: len(self.owned)], local[len(self.owned) :].tocoo()
        ghosts = self.ghosts[shares.row]
        row, column, value = sent(self.comm, self.owner[ghosts], ghosts, shares.col, shares.data)
        received = sp.csr_matrix((value, (np.searchsorted(self.owned, row), column)), shape=own.shape)
        return (own + received).tocsr() if received.nnz else own
