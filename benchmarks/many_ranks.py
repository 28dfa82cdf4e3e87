"""A model of time on many ranks, from counts as `state.costs` has them.

`python -m benchmarks.many_ranks` prints what it says of up to ten thousand ranks; under mpirun with `--check`
its counts beside those of a run, with `--memory` the memory of each rank. The model is given products: with
`--products` they are counted, for more and more subdomains. See `docs/scaling.md`.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, field
from functools import cache
from itertools import product
from math import log2
from time import perf_counter
from typing import Any

import numpy as np
from mpi4py import MPI
from scipy.linalg import blas
from scipy.sparse.linalg import LinearOperator, eigsh

from benchmarks.cases.scenes import block_mesh, block_on_plane
from fenics_contact import (
    Body,
    ContactPair,
    Coulomb,
    FixedPoint,
    LinearState,
    RigidPlane,
    Scene,
    Support,
    Surface,
    Traction,
    Tresca,
    box_partition,
    once_a_machine,
    solve_scene,
)
from fenics_contact._base.sparse import FACTOR_BYTES, ROWS_PER_RANK, prefers_explicit
from fenics_contact._scene.dealing import Dealing
from fenics_contact.feti.reduced_coarse import Elimination, ReducedGrams
from fenics_contact.gallery import block
from fenics_contact.materials import IsotropicElasticity
from fenics_contact.qp import DualProblem, DualSolver, FaceNewton, Smalse
from fenics_contact.qp.coarse import DENSE_LIMIT
from fenics_contact.results import PhaseCosts
from fenics_contact.results.linear_state import as_linear
from fenics_contact.study.report import table
from fenics_contact.study.worker import peak_memory

#: Calls of each size that a solve takes: numbers for each product and for each step, as counted on 2, 4 and
#: 64 ranks. "coarse": sums of vectors of all rigid motions; "contact": solutions with the contact rows'
#: factor. One of the matrices has contact rows only.
COARSE, CONTACT, SCALARS, MATRICES = (2.5, 4.5), (2.0, -2.0), (3.0, 5.0), 3.5
#: Entries of sparse factors of m motions divided by m^(4/3), and seconds to make them for `COUNTED` motions:
#: L and U of the matrix of a face; L of the motions without contact, with the matrix reduced by them, on one
#: rank, and in all on several.
LU, REDUCED, SHARED, COUNTED = (64.0, 2.3), (22.0, 3.8), (32.0, 15.0), 24576
#: Seconds in which a Newton step factors its reduced matrices, of size 1536, on one rank; in which one of
#: size c is summed and factored in all on several, divided by c² and c³.
DENSE_STEP, SHARED_DENSE = 0.24, (2.5e-7, 1.8e-11)


#: Sides glued, clamped or in contact, of the first, an inner and the last subdomain in each direction.
SIDES = np.array([[2, 2, 1], [1, 2, 1], [2, 2, 1]])


@dataclass(frozen=True)
class Machine:
    """What a rank's share of a machine does.

    Attributes:
        latency: Of a message, [s].
        bandwidth: Of messages, [byte/s].
        flops: Operations of products that read triangles from memory, [1/s]: four for 6 bytes, half of the
            triangles being in single precision. The default is that of a core of a full node, 5 GB/s.
        iteration: Of Python in an iteration, [s].
        subdomain: Of Python in an iteration for each subdomain, [s].
    """

    latency: float = 2e-6
    bandwidth: float = 2e9
    flops: float = 3.3e9
    iteration: float = 1e-3
    subdomain: float = 1e-5

    def seconds(self, costs: PhaseCosts, ranks: int) -> dict[str, float]:
        """Return the seconds of each kind of costs, nothing overlapping.

        A reduction or a copy takes log₂ P steps; it moves its bytes twice or once. In a transfer every rank
        waits for every other.

        Args:
            costs: Of the rank with the most.
            ranks: P, their number.
        """
        depth = np.ceil(log2(ranks)) if ranks > 1 else 0.0
        calls = 2 * costs.reductions + costs.copies + costs.meetings
        moved = 2 * costs.reduction_bytes + costs.copy_bytes + 8 * ranks * costs.meetings
        return {
            "messages": costs.messages * self.latency + costs.message_bytes / self.bandwidth,
            "global": (depth * calls + (ranks - 1) * costs.transfers) * self.latency
            + (moved + costs.transfer_bytes) / self.bandwidth,
            "operations": costs.flops / self.flops,
        }

    def overhead(self, lattice: Lattice, ranks: int) -> float:
        """Return the seconds of Python in a solve on a number of ranks."""
        return lattice.products * (self.iteration + self.subdomain * lattice.side**3 / ranks)


@cache
def exchanged(side: int, edge: int, ranks: int) -> tuple[int, int]:
    """Return the messages and the faces between subdomains of an exchange, of the rank with the most each.

    Those of a lattice of side³ boxes of edge³ hexahedra, dealt to ranks as those of a scene.
    """
    place = np.ones(side, dtype=int)
    place[[0, -1]] = 0, 2
    each = np.stack(np.meshgrid(*(own[place] for own in SIDES), indexing="ij"), axis=-1).reshape(-1, 3)
    kind = np.unique(np.sort(each, axis=1), axis=0, return_inverse=True)[1].ravel()
    size = np.full(len(each), 3 * (edge + 1) ** 3)
    interface = size - 3 * (edge + 1 - each).prod(axis=1)
    rank = Dealing.of(np.zeros(len(each), dtype=int), kind, size, interface).among(ranks)
    rank = rank.reshape(side, side, side)
    pairs, faces = set[tuple[int, int]](), np.zeros(ranks, dtype=int)
    for step in product((-1, 0, 1), repeat=3):
        if step <= (0, 0, 0):
            continue
        here = tuple(slice(max(-d, 0), side - max(d, 0)) for d in step)
        there = tuple(slice(max(d, 0), side - max(-d, 0)) for d in step)
        owner, other = rank[here].ravel(), rank[there].ravel()
        apart = owner != other
        pairs.update(zip(owner[apart].tolist(), other[apart].tolist(), strict=True))
        if sum(map(abs, step)) == 1:
            np.add.at(faces, owner[apart], 1)
            np.add.at(faces, other[apart], 1)
    messages = np.bincount(np.array(sorted(pairs), dtype=int).ravel(), minlength=ranks)
    return int(messages.max()), int(faces.max())


@dataclass(frozen=True)
class Lattice:
    """A block cut into side³ equal boxes of edge³ hexahedra; one side is clamped, one lies on a plane.

    Attributes:
        side: Subdomains along an edge of the block, at least 2.
        edge: Elements along an edge of a subdomain.
        products: F-products of the solve, counted: they do not follow from the sizes.
        steps: Newton steps, counted.
    """

    side: int
    edge: int = 6
    products: int = 50
    steps: int = 8
    local: int = field(init=False)
    unknowns: int = field(init=False)

    def __post_init__(self) -> None:
        """Determine the operations of K⁺ and S of all subdomains, and the torn unknowns."""
        object.__setattr__(self, "unknowns", 3 * (self.edge + 1) ** 3 * self.side**3)
        count, nodes = np.array([1, self.side - 2, 1]), self.edge + 1
        inner = np.einsum("i,j,k->ijk", *(nodes - SIDES))
        number = np.einsum("i,j,k->ijk", count, count, count)
        size, total = 3 * nodes**3, 0.0
        for free, many in zip(inner.ravel(), number.ravel(), strict=True):
            interface = size - 3 * int(free)
            sparse = 4 * FACTOR_BYTES / 8 * (size**1.5 + (size - interface) ** 1.5)
            total += many * (4 * interface**2 if prefers_explicit(size, interface) else sparse)
        object.__setattr__(self, "local", int(total))

    @property
    def motions(self) -> int:
        """Rigid motions of all subdomains, the size of the coarse problem."""
        return 6 * self.side**3

    @property
    def contact_rows(self) -> int:
        """Multipliers of the contact, three at a node."""
        return 3 * (self.side * self.edge + 1) ** 2

    def solve(self, ranks: int) -> PhaseCosts:
        """Return the costs of the iterations of the rank with the most.

        A gluing row between two ranks belongs to a copy of a node, not to the node: edges have several.
        """
        steps, products, size = self.steps, self.products, self.motions
        exchanges = 2 * products + 2 * (products - steps)
        partners, faces = exchanged(self.side, self.edge, ranks)
        coarse, contact, scalars = (a * products + b * steps for a, b in (COARSE, CONTACT, SCALARS))
        matrices, dense = MATRICES * steps, size <= DENSE_LIMIT
        # Two subdomains that share nodes fill 25 of 36 pairs of motions. Which ones is known by a bit each.
        filled, pressed = 25 * (3 * self.side - 2) ** 3, 36 * (3 * self.side - 2) ** 2
        # Of contact rows, those of other ranks are sent to the one with their matrix, and back.
        owners = ranks if ranks <= self.side else round(ranks ** (2 / 3))
        others = (1 - 1 / owners) * self.contact_rows
        bytes_ = 8 * (coarse * size + 2 * scalars)
        bytes_ += dense * (8 * steps * ((MATRICES - 1) * filled + pressed) + matrices * size**2 / 8)
        solving = 2 * size**2 if dense else 4 * LU[0] * size ** (4 / 3) / self.holders(ranks)
        shared = self.reduced and self.holders(ranks) > 1
        if self.reduced:
            solving = 8 * REDUCED[0] * size ** (4 / 3) + 2 * self.pressed**2
        if shared:  # the small one is refined
            solving = (8 * SHARED[0] * size ** (4 / 3) + 6 * self.pressed**2) / self.holders(ranks)
        flops = products * self.local / ranks + coarse * solving + 4 * contact * self.contact_rows
        if ranks == 1:
            return PhaseCosts(flops=round(flops))
        return PhaseCosts(
            messages=round(exchanges * partners + 2 * contact * (owners - 1)),
            message_bytes=round(exchanges * 24 * faces * (self.edge + 1) ** 2 + 16 * contact * others),
            reductions=round(coarse + scalars + 2 * matrices * dense),
            reduction_bytes=round(bytes_),
            # Those who share factors collect the vector, and sum and copy one of the motions with contact.
            copies=round(steps + coarse * ((not dense) + 5 * shared)),
            copy_bytes=round(
                8 * steps + 8 * coarse * (size * (not dense) + (size + 4 * self.pressed) * shared)
            ),
            transfers=round(steps + matrices * (not dense)),
            transfer_bytes=round(20 * steps * others),
            meetings=3 + 2 * steps,
            largest_reduction=8 * (filled if dense else size),
            largest_copy=8 if dense else 8 * size,
            flops=round(flops),
        )

    @property
    def pressed(self) -> int:
        """Rigid motions of subdomains with contact rows."""
        return 6 * self.side**2

    @property
    def reduced(self) -> bool:
        """Whether faces factor only the motions of subdomains with contact rows."""
        return self.motions > DENSE_LIMIT and Elimination(np.zeros(0)).pays(self.motions, self.pressed)

    def holders(self, ranks: int) -> int:
        """Return the ranks that hold the factors of the coarse problem."""
        if self.reduced:
            return ReducedGrams.holders(ranks, self.motions)
        if self.motions <= DENSE_LIMIT:
            return 1
        return min(ranks, -(-self.motions // ROWS_PER_RANK))

    def coarse_factors(self, ranks: int) -> float:
        """Return the seconds of all coarse factorisations: sparse ones grow with m², dense ones with c³."""
        growth, holders = (self.motions / COUNTED) ** 2, self.holders(ranks)
        if not self.reduced:
            return MATRICES * self.steps * LU[1] * growth / holders
        if holders == 1:
            return REDUCED[1] * growth + self.steps * DENSE_STEP * (self.pressed / 1536) ** 3
        each = SHARED_DENSE[0] * self.pressed**2 + SHARED_DENSE[1] * self.pressed**3
        return (SHARED[1] * growth + MATRICES * self.steps * each) / holders

    def held(self) -> float:
        """Return the bytes that every machine holds of the whole problem, see `docs/scaling.md`."""
        return HELD_ONCE * self.unknowns


#: Bytes for each torn unknown of the whole problem that every machine holds once: meshes and partition 25,
#: numbers and owners of gluing rows 15, copies of nodes 10.
HELD_ONCE = 50.0


def extrapolated(machine: Machine, edge: int = 6, a_rank: int = 100_000, most: int = 10_000) -> str:
    """Return a table of the seconds of a solve with about as many unknowns on each of more and more ranks."""
    body = []
    for ranks in (1, 8, 64, 512, 4096, most):
        lattice = Lattice(round((a_rank * ranks / (3 * (edge + 1) ** 3)) ** (1 / 3)), edge)
        parts = machine.seconds(lattice.solve(ranks), ranks)
        local = lattice.products * lattice.local / ranks / machine.flops
        body.append(
            (
                str(ranks), f"{lattice.unknowns:.3g}", str(lattice.motions), f"{local:.3g}",
                f"{parts['operations'] - local:.3g}", f"{lattice.coarse_factors(ranks):.3g}",
                f"{parts['messages']:.3g}", f"{parts['global']:.3g}", f"{lattice.held() / 1e9:.3g}",
            )
        )  # fmt: skip
    head = ("ranks", "unknowns", "rigid motions", "subdomains [s]", "coarse, contact [s]")
    return table((*head, "coarse factors [s]", "messages [s]", "global [s]", "held [GB a machine]"), body)


def measured(comm: MPI.Comm, size: int = 654, count: int = 64) -> Machine:
    """Return what the first two of these ranks do, others waiting. Collective.

    Packed triangles of the size of an interface are applied one after the other, each from memory.
    """
    triangles = [np.ones(size * (size + 1) // 2) for _ in range(count)]
    given, begun = np.ones(size), perf_counter()
    for triangle in triangles:
        blas.dspmv(size, 1.0, triangle, given, lower=1)
    rate = 2 * size**2 * count / (perf_counter() - begun)
    if comm.size == 1:
        return Machine(flops=rate)
    latency = _ping_pong(comm, 1, 200)
    return Machine(latency, 8e6 / max(_ping_pong(comm, 1_000_000, 10), 1e-9), rate)


def _ping_pong(comm: MPI.Comm, numbers: int, times: int) -> float:
    """Return the seconds of a message between the first two ranks, the same on all. Collective."""
    data, comm_rank = np.zeros(numbers), comm.rank
    comm.Barrier()
    begun = perf_counter()
    for _ in range(times):
        if comm_rank == 0:
            comm.Send(data, 1)
            comm.Recv(data, 1)
        elif comm_rank == 1:
            comm.Recv(data, 0)
            comm.Send(data, 0)
    return float(comm.bcast((perf_counter() - begun) / (2 * times)))


def scene(side: int, edge: int) -> tuple[Scene, dict[str, np.ndarray]]:
    """Return the scene of a lattice, and its partition."""
    mesh = block_mesh((side * edge,) * 3)
    return block_on_plane(mesh, 0.3), {"block": box_partition(mesh, (side,) * 3)}


def checked(comm: MPI.Comm, side: int = 4, edge: int = 2) -> dict[str, Any]:
    """Solve a lattice; return the counts of the rank with the most, and those of the model. Collective.

    The model is given products and steps, nothing else.
    """
    given, partitions = scene(side, edge)
    state = solve_scene(given, comm, partitions=partitions, solver=FaceNewton(tolerance=1e-6))
    assert isinstance(state, LinearState)
    mine = asdict(state.costs.solve)
    most = {name: max(comm.allgather(value)) for name, value in mine.items()}
    lattice = Lattice(side, edge, state.solution.products, state.solution.iterations)
    return {
        "counted": most,
        "model": asdict(lattice.solve(comm.size)),
        "seconds": comm.allreduce(state.seconds["solve"], op=MPI.MAX),
        "overhead": Machine().overhead(lattice, comm.size),
    }


def memory(comm: MPI.Comm, edge: int = 6, a_rank: int = 2) -> str:
    """Solve a block with a_rank³ subdomains on every rank; return their memory in words. Collective."""
    imports = peak_memory()
    length, depth, height = (a_rank * n for n in MPI.Compute_dims(comm.size, 3))
    boxes, cells = (length, depth, height), (edge * length, edge * depth, edge * height)
    upper = (float(length), float(depth), float(height))
    mesh = once_a_machine(comm, lambda: block((0.0, 0.0, 0.0), upper, cells))
    given = block_on_plane(mesh, 0.3)
    partitions = {"block": once_a_machine(comm, lambda: box_partition(mesh, boxes))}
    state = solve_scene(given, comm, partitions=partitions, solver=FaceNewton(tolerance=1e-6))
    every = np.array(comm.allgather((peak_memory() - imports) / 1e6))
    copies = state.costs.total
    return (
        f"{comm.size} ranks, {state.counts['torn_unknowns']} unknowns, {state.solution.products} products: "
        f"{every.mean():.1f} MB a rank above the imports, {every.min():.1f} to {every.max():.1f}; "
        f"largest copy {copies.largest_copy} B, reduction {copies.largest_reduction} B"
    )


@dataclass(frozen=True)
class Cube:
    """A unit cube of side³ equal boxes, clamped at x0, pressed on a rigid plane and dragged over it.

    Attributes:
        side: Subdomains along an edge.
        edge: Elements along an edge of a subdomain, H/h.
        traction: On the upper side: one that presses all nodes on the plane, by default.
    """

    side: int
    edge: int
    traction: tuple[float, float, float] = (200.0, 0.0, -500.0)

    def solved(self, law: str, solver: DualSolver) -> LinearState:
        """Return the state under a law: linear, that is without a plane, frictionless, Tresca or Coulomb."""
        friction = {"frictionless": None, "Tresca": Tresca(60.0), "Coulomb": Coulomb(0.3)}
        mesh, plane = (
            block((0, 0, 0), (1, 1, 1), (self.side * self.edge,) * 3),
            RigidPlane((0, 0, 0), (0, 0, 1)),
        )
        contacts = [ContactPair(Surface("cube", "z0"), plane, friction[law])] if law in friction else []
        given = Scene(
            {"cube": Body(mesh, IsotropicElasticity(2.1e5, 0.3))},
            [Support("cube", "x0")],
            [Traction("cube", "z1", self.traction)],
            contacts,
        )
        parts = {"cube": box_partition(mesh, (self.side,) * 3)}
        return as_linear(solve_scene(given, MPI.COMM_SELF, partitions=parts, solver=solver), "products")

    @property
    def condition(self) -> float:
        """κ, the ratio of the extreme eigenvalues of P F P on Ker G."""
        least, largest = spectrum(self.solved("Tresca", FaceNewton(tolerance=1e-3)).dual.problem)
        return largest / least


def spectrum(problem: DualProblem, accuracy: float = 1e-2) -> tuple[float, float]:
    """Return the extreme eigenvalues of P F P on Ker G, on one rank; F is regular there."""
    project, size = problem.coarse.project, problem.layout.size
    start = project(np.random.default_rng(0).standard_normal(size))
    settings = {"k": 1, "return_eigenvectors": False, "v0": start, "tol": accuracy}

    def shifted(shift: float) -> LinearOperator:
        def apply(x: np.ndarray) -> np.ndarray:
            inside = project(x)
            return project(problem.operator(inside)) + shift * (x - inside)

        return LinearOperator((size, size), matvec=apply, dtype=np.float64)

    largest = float(eigsh(shifted(0.0), which="LA", **settings)[0])
    return float(eigsh(shifted(largest), which="SA", **settings)[0]), largest


#: Solvers that are compared, by the law of friction.
COMPARED: dict[str, tuple[DualSolver, ...]] = {
    **dict.fromkeys(("linear", "frictionless", "Tresca"), (FaceNewton(), Smalse())),
    "Coulomb": (FaceNewton(), FixedPoint(FaceNewton()), FixedPoint(Smalse())),
}
#: Subdomains along an edge and elements along that of each: many of one size, few of several.
LATTICES = ((2, 4), (3, 4), (4, 4), (6, 4), (8, 4), (3, 2), (3, 8))
#: Tractions that press all nodes on the plane, and that lift some.
TRACTIONS = {"all nodes closed": (200.0, 0.0, -500.0), "some open": (300.0, 60.0, -200.0)}


def counted_products() -> Iterator[str]:
    """Yield tables of products and, in brackets, Newton steps or outer iterations, to residuals of 1e-6."""
    head = ("subdomains", "H/h", "κ", *(f"{law}: Newton, SMALSE" for law in COMPARED if law != "Coulomb"))
    conditions = [f"{Cube(*lattice).condition:.1f}" for lattice in LATTICES]
    for words, traction in TRACTIONS.items():
        body = []
        for (side, edge), condition in zip(LATTICES, conditions, strict=True):
            cube, row = Cube(side, edge, traction), [str(side**3), str(edge), condition]
            for law, solvers in COMPARED.items():
                found = [cube.solved(law, solver).solution for solver in solvers]
                row.append(", ".join(f"{each.products} ({each.iterations})" for each in found))
            body.append(tuple(row))
        yield f"{words}\n\n{table((*head, 'Coulomb: Newton, fixed points of Newton, of SMALSE'), body)}"


def main(arguments: Sequence[str] | None = None) -> None:
    """Print what the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__)
    for name in ("latency", "bandwidth", "flops"):
        parser.add_argument(f"--{name}", type=float, default=getattr(Machine(), name))
    parser.add_argument("--edge", type=int, default=6, help="elements along an edge of a subdomain")
    parser.add_argument("--check", action="store_true", help="compare the counts of a run")
    parser.add_argument("--memory", action="store_true", help="measure the memory of each rank")
    parser.add_argument("--products", action="store_true", help="count products, by subdomains; on one rank")
    settings, comm = parser.parse_args(arguments), MPI.COMM_WORLD
    if settings.products:
        words = "\n\n".join(counted_products())
    elif settings.memory:
        words = memory(comm, settings.edge)
    elif settings.check:
        here, run = measured(comm), checked(comm, edge=settings.edge)
        rows = [(name, str(n), str(run["model"][name])) for name, n in run["counted"].items()]
        spent = sum(here.seconds(PhaseCosts(**run["counted"]), comm.size).values()) + run["overhead"]
        rows.append(("seconds", f"{run['seconds']:.3g}", f"{spent:.3g}"))
        words = f"{here} on {comm.size} ranks\n\n{table(('solve', 'counted', 'model'), rows)}"
    else:
        machine = Machine(settings.latency, settings.bandwidth, settings.flops)
        words = f"{machine}\n\n{extrapolated(machine, settings.edge)}"
    if comm.rank == 0:
        print(words)


if __name__ == "__main__":
    main()
