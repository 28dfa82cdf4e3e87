"""The prices a cost model needs: a subdomain by its size, the coarse problem by the number of subdomains.

`python -m benchmarks.prices` prints them; run it alone on the machine.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from statistics import median
from time import perf_counter

import numpy as np
import scipy.sparse as sp
from mpi4py import MPI

from benchmarks.cases.scenes import block_mesh, block_on_plane
from fenics_contact._base.sparse import explicit_cost, implicit_cost, prefers_explicit
from fenics_contact.feti import build_torn_system, decompose
from fenics_contact.feti.condensation import Condensations
from fenics_contact.feti.inverse import ExplicitOperator, ImplicitOperator
from fenics_contact.feti.subdomain import Subdomain
from fenics_contact.qp.coarse import CoarseSpace
from fenics_contact.study.report import table

#: Elements along an edge of a cubic subdomain.
EDGES = (4, 5, 6, 7, 8, 10, 12)
#: Numbers of subdomains, all cubes, for the coarse problem.
SUBDOMAINS = (8, 27, 64, 125, 343, 1000, 2197, 4096)
#: Bytes that are read between two solves so that no factor is left in the cache.
FLUSH = 64 * 2**20


def seconds_of(
    work: Callable[[], object], repeats: int = 5, before: Callable[[], object] | None = None
) -> float:
    """Return the median of the seconds that some work takes, after something that is not counted."""
    spent = []
    for _ in range(repeats):
        if before is not None:
            before()
        start = perf_counter()
        work()
        spent.append(perf_counter() - start)
    return median(spent)


def cube(edge: int) -> Subdomain:
    """Return a floating cube of ``edge``³ elements as a subdomain with its matrices."""
    mesh = block_mesh((edge, edge, edge))
    scene = replace(block_on_plane(mesh), supports=[], contacts=[])
    decomposition = decompose(scene, {"block": np.zeros(mesh.n_cells, dtype=np.int64)}, MPI.COMM_SELF)
    return build_torn_system(scene, decomposition).subdomains[0]


def glued_dofs(subdomain: Subdomain, sides: int) -> np.ndarray:
    """Return the interface of a cube glued on its first ``sides`` sides (two: opposite ones; six: all)."""
    points = subdomain.points
    low, high = np.isclose(points, points.min(axis=0)), np.isclose(points, points.max(axis=0))
    glued = (low | high)[:, : sides // 2].any(axis=1)
    return np.flatnonzero(np.repeat(glued, 3))


def subdomain_prices(edges: Sequence[int] = EDGES) -> str:
    """Return a table of what one subdomain costs in both ways to keep it, measured and as predicted.

    A product is one application of K⁺ and one of S on the interface, with cold caches.
    """
    flush = np.zeros(FLUSH // 8)
    body = []
    for edge in edges:
        subdomain = cube(edge)
        size = subdomain.mesh.size
        for sides in (2, 6):
            interface = glued_dofs(subdomain, sides)
            given, found = np.ones(len(interface)), np.empty(len(interface))
            row = [f"{edge}³", str(size), str(len(interface))]
            for keep, predict in (
                (ImplicitOperator, implicit_cost),
                (partial(ExplicitOperator, condensations=Condensations()), explicit_cost),
            ):
                predicted = predict(size, len(interface))
                operator = keep(subdomain, interface)
                setting_up = seconds_of(partial(keep, subdomain, interface), 3)
                product = sum(
                    seconds_of(partial(apply, given, found), 20, before=flush.sum)
                    for apply in (operator.apply_flexibility, operator.apply_stiffness)
                )
                row.append(f"{1e3 * setting_up:.1f} ({1e3 * predicted.setup:.1f})")
                row.append(f"{1e3 * product:.3f} ({1e3 * predicted.product:.3f})")
            row.append("explicit" if prefers_explicit(size, len(interface)) else "implicit")
            body.append(row)
    costs = [f"{kind} {what} [ms]" for kind in ("implicit", "explicit") for what in ("set-up", "product")]
    return table(("elements", "dofs", "interface", *costs, "chosen"), body)


def cubes_in_a_lattice(count: int) -> sp.csr_matrix:
    """Return G of a lattice of floating cubes: six motions each, six multipliers a shared face.

    The pattern of a torn body with the fewest multipliers that can glue it; real rows are more, and G Gᵀ the
    same in size and pattern.
    """
    side = round(count ** (1 / 3))
    number = np.arange(side**3).reshape(side, side, side)
    pairs = [
        (number[:-1].ravel(), number[1:].ravel()),
        (number[:, :-1].ravel(), number[:, 1:].ravel()),
        (number[:, :, :-1].ravel(), number[:, :, 1:].ravel()),
    ]
    first, second = (np.concatenate(ends) for ends in zip(*pairs, strict=True))
    generator = np.random.default_rng(0)
    blocks = generator.normal(size=(len(first), 2, 6, 6))
    motion = 6 * np.stack([first, second], axis=1)[:, :, None, None] + np.arange(6)[:, None]
    column = 6 * np.arange(len(first))[:, None, None, None] + np.arange(6)
    rows, columns = np.broadcast_to(motion, blocks.shape), np.broadcast_to(column, blocks.shape)
    return sp.csr_matrix(
        (blocks.ravel(), (rows.ravel(), columns.ravel())), shape=(6 * side**3, 6 * len(first))
    )


def coarse_prices(counts: Sequence[int] = SUBDOMAINS) -> str:
    """Return a table of what the coarse problem costs as the subdomains become more."""
    body = []
    for count in counts:
        G = cubes_in_a_lattice(count)
        load = np.ones(G.shape[0])
        coarse = CoarseSpace(MPI.COMM_SELF, G, load)
        building = seconds_of(lambda G=G, load=load: CoarseSpace(MPI.COMM_SELF, G, load).gram, 1)  # type: ignore[misc]
        solving = seconds_of(partial(coarse.solve, load), 20)
        body.append((str(count), str(G.shape[0]), f"{1e3 * building:.1f}", f"{1e3 * solving:.3f}"))
    return table(("subdomains", "rigid motions", "assemble and factor [ms]", "solve [ms]"), body)


if __name__ == "__main__":
    print(f"One subdomain on one core\n\n{subdomain_prices()}\n", flush=True)
    print(f"Coarse problem on one core\n\n{coarse_prices()}")
