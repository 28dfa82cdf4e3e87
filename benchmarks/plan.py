"""Which runs the benchmark has: a case with its settings on a number of ranks, repeated."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from benchmarks.cases.scene_data import PAPER_CELLS
from benchmarks.held import HELD
from fenics_contact.study.runner import Job

#: Cells of the block by a name for their number.
BLOCKS = {"28k": (32, 16, 16), "92k": (48, 24, 24), "212k": (64, 32, 32)}

#: Largest edge of the tetrahedra of the drilled block.
PART_SIZE = 0.028
#: Solvers of one linear system that the state is held against.
LINEAR = {"gamg": "CG + GAMG", "cholesky": "MUMPS's Cholesky"}
#: Friction coefficients of the chain beside 0.3.
OTHER_FRICTION = ("0.1", "0.6", "0.01", "0")
#: How forces and energies of different ranks and partitions are compared.
COMPARED = {"tolerance": 1e-9, "forces": True}
#: What may be skipped, as it needs a program that few have.
OPTIONAL = "getfem-28k"


def run(name: str, case: str, settings: dict[str, Any] | None = None, ranks: int = 2, **known: Any) -> Job:
    """Return the job of a case in `benchmarks.cases`: three times on two ranks by default."""
    known = {"repeats": 3, **known}
    return Job(name, f"benchmarks.cases.{case}:measure", settings or {}, ranks=ranks, **known)


def _refined(k: int) -> dict[str, Any]:
    """Return the chain with k times the cells in each direction, cut as it is by default."""
    return {"cells": [k * n for n in PAPER_CELLS], "default_partition": True}


def chain_runs() -> list[Job]:
    """Return all runs of the chain's state."""
    return [
        run("chain", "chain"),
        run("chain-1-rank", "chain", ranks=1),
        run("chain-refined-2", "chain", _refined(2)),
        run("chain-refined-3", "chain", _refined(3), repeats=1, limit=3600.0),
        *(run(f"chain-friction-{mu}", "chain", {"friction_coefficient": float(mu)}) for mu in OTHER_FRICTION),
        *(run(f"chain-compared-{ranks}", "chain", COMPARED, ranks, repeats=1) for ranks in (1, 2, 4)),
        run("chain-default", "chain", {"default_partition": True}),
        run("chain-equal", "chain", {"default_partition": True, "grading": 0.0}),
        run("chain-tetrahedra", "chain", {"default_partition": True, "cell": "tetrahedron"}),
        run("chain-compared-boxes", "chain", {**COMPARED, "boxes": [6, 2, 2]}, repeats=1),
        run("chain-compared-bisection", "chain", {**COMPARED, "parts": 16}, repeats=1),
    ]


def block_runs() -> list[Job]:
    """Return the block by this package and by others."""
    by_hand = {"counts": list(BLOCKS["92k"]), "boxes": [8, 4, 4]}
    found = [
        run("frictionless-block", "frictionless_block"),
        run("block-92k-boxes", "sliding_block", by_hand),
    ]
    for size, cells in BLOCKS.items():
        mesh = {"counts": list(cells)}
        repeats, limit = (1, 3600.0) if size == "212k" else (3, 1200.0)
        newton = {"repeats": repeats, "threads": 2, "limit": limit}
        found += [
            run(f"block-{size}", "sliding_block", mesh),
            *(run(f"{solver}-{size}", "linear_block", {**mesh, "solver": solver}) for solver in LINEAR),
            run(f"newton-{size}-ranks", "newton_block", mesh, repeats=1, limit=limit),
            run(f"newton-{size}-threads", "newton_block", mesh, 1, **newton),
        ]
    # A part of a CAD file of some 200 thousand unknowns, where no two subdomains are alike.
    found += [
        run("part", "sliding_block", {"size": PART_SIZE}, limit=1200.0),
        run("gamg-part", "linear_block", {"size": PART_SIZE}, limit=1200.0),
    ]
    # GetFEM's MUMPS has no MPI and bears none beside it.
    return [*found, run(OPTIONAL, "getfem_block", {"counts": list(BLOCKS["28k"])}, 0, threads=2)]


def runs(quick: bool = False) -> list[Job]:
    """Return every run in the order of measurement, or those of the quick benchmark, each once."""
    every = [
        *chain_runs(),
        run("linear-face", "linear_face"),
        run("design-step", "design_step"),
        run("shape-optimisation", "shape_optimisation", limit=1800.0),
        run("demo", "demo", limit=1800.0),
        *block_runs(),
    ]
    small = [replace(job, repeats=1) for job in every if job.name in HELD or job.name == OPTIONAL]
    return small if quick else every


_TINY = {"counts": [8, 4, 4]}
#: Small runs that leave the compiled forms of all others behind them; their results are not used.
WARM_UP = (
    run("chain", "chain", {"cells": [24, 4, 8], "boxes": [4, 1, 2]}, 1),
    run("block", "sliding_block", {**_TINY, "boxes": [2, 1, 1]}, 1),
    run("newton", "newton_block", _TINY, 1),
    run("linear", "linear_block", {**_TINY, "solver": "gamg"}, 1),
)
