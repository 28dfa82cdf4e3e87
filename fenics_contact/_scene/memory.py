"""The memory that a state of a scene needs, from its cells, cuts and pairs alone, for linear materials."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp

from fenics_contact._base.libraries import MPI
from fenics_contact._base.memory import addressable_memory, available_memory
from fenics_contact._base.shared import once_a_machine, ranks_of_machine
from fenics_contact._base.sparse import factor_bytes, prefers_explicit
from fenics_contact._scene.checks import check_positive
from fenics_contact._scene.dealing import Dealing
from fenics_contact.errors import InvalidInputError, together

if TYPE_CHECKING:
    from fenics_contact._scene.body import Body
    from fenics_contact._scene.parts import SceneParts


@dataclass(frozen=True)
class Rates:
    """Bytes by what needs them, measured on blocks, chains and plates (hexahedra, tetrahedra, quadratic).

    Attributes:
        start: What a rank needs at first, whatever the scene.
        tables: Numbering, gluing rows and meshes, of each torn unknown on every machine.
        alone: What a rank holds of the whole problem for itself, of each torn unknown.
        own: Kernels, coordinates and loads, of each torn unknown.
        system: Rows of B, coarse space and vectors, of each torn unknown.
        entry: Of an entry of a sparse matrix.
        whole: Subdomains alike from which their dense matrices are stored as a whole, not as triangles.
        workspace: Of MUMPS and PETSc for each entry of a matrix that is condensed, for each of the condensed
            one, and relative to the factors of both.
        modes: Of each row of one that is stored compactly.
        holes: What workspaces of condensed matrices leave in holes for a while, for each entry of a matrix,
            and for each of the condensed one at most.
        until: Subdomains after which holes return to the system.
        factored: Of each unknown of a sparse factor in addition to its entries.
        inverting: Of each entry of a condensed matrix while it is inverted.
        vectors: Vectors of multipliers that iterations keep.
    """

    start: float = 9e6
    tables: float = 55.0
    alone: float = 5.0
    own: float = 100.0
    system: float = 110.0
    entry: float = 12.0
    whole: int = 8
    workspace: tuple[float, float, float] = (27.0, 24.0, 0.5)
    modes: float = 32.0
    holes: tuple[float, float] = (34.0, 5.5)
    until: int = 8
    factored: float = 300.0
    inverting: float = 18.0
    vectors: float = 130.0


@dataclass(frozen=True)
class Subdomains:
    """The subdomains of a scene and what counts for their memory, shape (n_subdomains,) each.

    Attributes:
        size: Unknowns.
        interface: Those that rows of B touch.
        kind: Numbers of kinds: those that seem alike up to rotations and mirrors have the same.
        matrix: The same of those that seem alike up to translations, wherever rows of B touch them.
        couplings: Entries of a row of the stiffness, about.
        body: Number of its body.
    """

    size: np.ndarray
    interface: np.ndarray
    kind: np.ndarray
    matrix: np.ndarray
    couplings: np.ndarray
    body: np.ndarray

    @classmethod
    def of(cls, scene: SceneParts, partitions: Mapping[str, np.ndarray]) -> Subdomains:
        """Return those of the bodies that have a partition of their cells."""
        materials = [body.material for body in scene.bodies.values()]
        sizes, shapes, turned, bodies = [], [], [], list[np.ndarray]()
        for (name, body), material in zip(scene.bodies.items(), materials, strict=True):
            if name not in partitions:
                continue
            counts, invariants, moments = _counted(scene, name, partitions[name])
            couplings = np.full(len(counts), _couplings(body, partitions[name]))
            own = np.full(len(counts), materials.index(material))
            sizes.append(np.column_stack([counts, own, couplings]))
            shapes.append(invariants)
            turned.append(moments)
            bodies.append(np.full(len(counts), len(bodies)))
        counts = np.concatenate(sizes)
        size, interface = counts[:, :2].astype(np.int64).T
        numbers = (
            _numbered(counts, np.concatenate(shapes)),
            _numbered(counts[:, [0, 2, 3, -2]], np.concatenate(turned)),
        )
        return cls(size, interface, *numbers, counts[:, -1], np.concatenate(bodies))

    def dealt(self, ranks: int) -> np.ndarray:
        """Return the rank that each is dealt to."""
        return Dealing.of(self.body, self.kind, self.size, self.interface).among(ranks)

    def kinds(self, ranks: int = 1) -> int:
        """Return how many kinds the ranks have, each of its own."""
        return len(np.unique(np.column_stack([self.dealt(ranks), self.kind]), axis=0))

    @property
    def unlike(self) -> Subdomains:
        """The same where none shares factors with another."""
        return replace(self, kind=np.arange(len(self.kind)))


def _numbered(counts: np.ndarray, shapes: np.ndarray) -> np.ndarray:
    """Return the number of each subdomain among those of which counts, or shapes to six places, differ."""
    alike = np.round(shapes / np.abs(shapes).max(initial=np.finfo(float).tiny), 6) + 0.0  # no -0.0
    _, number = np.unique(np.column_stack([counts, alike]), axis=0, return_inverse=True)
    return np.asarray(number.ravel())


def expected_memory(
    scene: SceneParts,
    parts: Subdomains,
    ranks: int = 1,
    *,
    compact: bool = False,
    machines: int = 1,
) -> float:
    """Return the largest memory that a state takes on all ranks together, without libraries, [bytes].

    It is the largest one of that with all stiffness matrices, that while the last subdomains are factored,
    and that while the dual problem is solved. Subdomains of a rank that are alike count once.

    `compact`: whether each is stored as one triangle in single precision, `LocalKind.COMPACT`; `machines`:
    how many the ranks are on, each of which holds the tables once.
    """
    rates = Rates()
    torn = int(parts.size.sum())
    nodes = sum(body.mesh.n_nodes for body in scene.bodies.values())
    fixed = sum(int(np.count_nonzero(scene.fixed(name))) for name in scene.body_names)
    multipliers = torn - scene.components * nodes + fixed
    meshes = sum(body.mesh.points.nbytes + body.mesh.cells.nbytes for body in scene.bodies.values())
    steady = machines * (meshes + rates.tables * torn) + ranks * (rates.start + rates.alone * torn)
    steady += rates.own * torn
    factors = workspaces = assembled = 0.0
    dealt = parts.dealt(ranks)
    for rank in range(ranks):
        mine = np.flatnonzero(dealt == rank)
        held, during = _factors(parts, mine, scene.dim, rates, compact)
        factors, workspaces = factors + held, workspaces + during
        first = mine[np.unique(parts.matrix[mine], return_index=True)[1]]
        assembled += rates.entry * float(parts.couplings[first] @ parts.size[first])
    solving = rates.system * torn + 8.0 * rates.vectors * multipliers
    if compact:  # while the first ones are condensed all matrices are there
        assembled += workspaces
    return steady + max(assembled, factors + max(workspaces, solving))


@dataclass(frozen=True)
class Fit:
    """Memory that a state of a linear scene takes on a machine, and what the machine has left, [bytes].

    Attributes:
        left: What may be taken, infinite where it is not known, or there is more than enough.
        fast: What a state takes where subdomains are stored for speed.
        compact: That where each is stored as one triangle in single precision, `LocalKind.COMPACT`.
        roomy: Share of the memory that may be taken.
    """

    left: float = np.inf
    fast: float = 0.0
    compact: float = 0.0
    roomy: float = 0.9

    @property
    def is_tight(self) -> bool:
        """Whether subdomains are to be stored compactly."""
        return self.fast > self.roomy * self.left

    @property
    def is_tighter(self) -> bool:
        """Whether bodies are to be cut for subdomains that are stored compactly."""
        return min(self.fast, self.compact) > self.roomy * self.left

    @classmethod
    def of(
        cls,
        scene: SceneParts,
        counted: Callable[[], Subdomains],
        comm: MPI.Comm,
        *,
        limit: float | None = None,
        ample: float = 50e3,
    ) -> Fit:
        """Compute it from a partition. Collective; of the machines the one with the least memory counts.

        `counted`: returns the subdomains; `limit`: memory that a state may take on a machine, [bytes]; None:
        what it has left; `ample`: bytes for each unknown, more than any scene takes; where they are left,
        nothing is computed without a limit.
        """
        with together(comm):
            _check_limit(limit)
        ranks = ranks_of_machine(comm).size
        if limit is None and comm.allreduce(ample * _unknowns(scene) <= _left(ranks), MPI.LAND):
            return cls()
        share = ranks / comm.size
        parts = once_a_machine(comm, counted)
        with together(comm):
            machines = round(1.0 / share)
            fast = expected_memory(scene, parts, comm.size, machines=machines)
            compact = expected_memory(scene, parts, comm.size, compact=True, machines=machines)
            left = limit or _left(ranks)
        each = comm.allgather((left / share, left, share))
        _, left, share = min(each, key=lambda one: one[0])
        return cls(left, share * fast, share * compact)


def _left(ranks: int) -> float:
    """Return what a machine has left for its ranks, infinite if unknown, [bytes]; ranks may have limits."""
    known = (available_memory(), 1), (addressable_memory(), ranks)
    return min((count * size for size, count in known if size is not None), default=np.inf)


def require_memory(
    scene: SceneParts,
    counted: Callable[[], Subdomains],
    comm: MPI.Comm,
    *,
    limit: float | None = None,
    certain: float = 1.3,
) -> bool:
    """Refuse a scene of which a state needs more memory than its machines have left. Collective.

    Returns whether it fits only where subdomains are stored compactly.

    `counted`: returns the subdomains; `limit`: memory that a state may take on a machine, [bytes]; None: what
    it has left; `certain`: how far the expected memory must exceed what is left, as it is an estimate.
    """
    fit, unknowns = Fit.of(scene, counted, comm, limit=limit), _unknowns(scene)
    needed = min(fit.fast, fit.compact)
    if needed > certain * fit.left:
        left = f"{fit.left / 1e9:.3g} GB {'are left' if limit is None else 'are allowed'}"
        raise InvalidInputError(
            f"a state must fit into memory, but {unknowns} unknowns need about {needed / 1e9:.3g} GB on this "
            f"machine, and {left}: about {int(unknowns * fit.left / needed):,} unknowns would fit; take "
            "coarser meshes, refine where it matters, or use more machines"
        )
    return fit.is_tight


def _unknowns(scene: SceneParts) -> int:
    return scene.components * sum(body.mesh.n_nodes for body in scene.bodies.values())


def _check_limit(limit: float | None) -> None:
    if limit is not None:
        remedy = (
            "give the bytes that a state may take on a machine, such as 8e9, or none for all that are left"
        )
        check_positive("memory", limit, remedy)


def _factors(
    parts: Subdomains, mine: np.ndarray, dim: int, rates: Rates, compact: bool
) -> tuple[float, float]:
    """Return the bytes of factors of some subdomains, and of the workspaces while the last are made."""
    _, first, members = np.unique(parts.kind[mine], return_index=True, return_counts=True)
    held, largest, during, holes = 0.0, 0.0, list[float](), list[float]()
    by_matrix, by_condensed, by_factor = rates.workspace
    for index, count in zip(mine[first], members, strict=True):
        n, b, couplings = int(parts.size[index]), int(parts.interface[index]), parts.couplings[index]
        whole = 2.0 if count >= rates.whole else 1.0
        if compact:
            held += whole * 2.0 * b**2 + rates.modes * b
        else:
            held += _sparse(n - b, dim, rates) + rates.entry * couplings * b
            if not prefers_explicit(n, b):
                held += _sparse(n, dim, rates)
                continue
            held += whole * 6.0 * b**2
        largest = max(largest, rates.inverting * b**2)
        during.append(by_matrix * couplings * n + by_condensed * b**2 + by_factor * factor_bytes(n, dim))
        holes.append(min(rates.holes[0] * couplings * n, rates.holes[1] * b**2))
    workspaces = largest + max(during, default=0.0)
    if compact:  # elsewhere what stays fills the holes
        workspaces += min(rates.until, len(holes)) * float(np.mean(holes))
    return held, workspaces


def _sparse(size: int, dim: int, rates: Rates) -> float:
    """Return the bytes of the factor of a sparse matrix."""
    return factor_bytes(size, dim) + rates.factored * size


def _counted(
    scene: SceneParts, name: str, partition: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return unknowns, interface dofs and sums over cells of subdomains, invariants and moments of each."""
    body = scene.bodies[name]
    mesh, count = body.mesh, int(partition.max()) + 1
    every = partition[:, None] * np.int64(mesh.n_nodes) + mesh.cells
    keys, cells = np.unique(every, return_counts=True)
    subdomain, node = keys // mesh.n_nodes, keys % mesh.n_nodes
    marks = scene.fixed(name).astype(float)
    for pair in (*scene.contacts, *scene.ties):
        # The master has rows at fewer nodes than the slave, and seldom the same pieces.
        for surface, mark in zip(pair.surfaces, (1.0, 1.5), strict=False):
            if surface.body == name:
                marks[np.unique(scene.facets(surface))] = mark
    marks[np.bincount(node, minlength=mesh.n_nodes) > 1] = 1.0
    on_interface = marks[node].sum(axis=1)
    touched = np.count_nonzero(marks[node], axis=1)
    nodes, interface, *connected = (
        np.bincount(subdomain, weight, minlength=count)
        for weight in (None, touched, cells**2.0, cells**3.0, cells * on_interface, cells**2 * on_interface)
    )
    squares, fourth = _moments(mesh.points[node], subdomain, cells**2.0, nodes)
    at_interface, fourth_there = _moments(mesh.points[node], subdomain, cells * on_interface, nodes)
    material = np.bincount(partition, body.material_of_cells, minlength=count)
    principal = [np.linalg.eigvalsh(each) for each in (squares, at_interface)]
    invariants = np.column_stack([*principal, fourth, fourth_there])
    moments = np.column_stack([squares.reshape(count, -1), fourth])
    counts = np.column_stack([scene.components * nodes, interface, *connected, material])
    return counts, invariants, moments


def _moments(
    points: np.ndarray, subdomain: np.ndarray, weight: np.ndarray, nodes: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return second moments of weighted nodes about the mean, (n, dim, dim), and roots of fourth ones."""
    count = len(nodes)

    def summed(values: np.ndarray) -> np.ndarray:
        return np.bincount(subdomain, values, minlength=count)

    arms = points - np.stack([summed(x) / nodes for x in points.T], axis=1)[subdomain]
    squares = np.array([[summed(weight * x * y) for y in arms.T] for x in arms.T])
    fourth = summed(weight * (arms**2).sum(axis=1) ** 2)
    return np.moveaxis(squares, -1, 0), np.sqrt(fourth)


def _couplings(body: Body, partition: np.ndarray) -> float:
    """Return the entries of a row of the stiffness of a body's first subdomain."""
    _, nodes = np.unique(body.mesh.cells[partition == 0], return_inverse=True)
    cells = nodes.reshape(-1, body.mesh.cells.shape[1])
    of_cell = np.repeat(np.arange(len(cells)), cells.shape[1])
    incidence = sp.csr_matrix((np.ones(cells.size), (cells.ravel(), of_cell)))
    return float(body.components * (incidence @ incidence.T).nnz / incidence.shape[0])
