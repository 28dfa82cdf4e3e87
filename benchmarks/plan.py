"""Which runs there are: a case with its settings on a number of ranks, repeated."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from benchmarks.cases.scene_data import PAPER_BOXES, PAPER_CELLS

#: Cells of the block by a name for their number, and boxes of about 6 elements, the fastest of 5, 6 and 8.
BLOCKS = {"28k": (32, 16, 16), "92k": (48, 24, 24), "212k": (64, 32, 32)}
BLOCK_BOXES = {"28k": (6, 3, 3), "92k": (8, 4, 4), "212k": (10, 5, 5)}

#: Solvers of one linear system that the state is held against.
LINEAR = {"gamg": "CG + GAMG", "cholesky": "MUMPS's Cholesky"}
#: Friction coefficients of the chain beside 0.3.
OTHER_FRICTION = ("0.1", "0.6", "0.01", "0")
#: Tolerance at which forces and energies of different ranks and partitions are compared.
COMPARED = ("--tolerance", "1e-9", "--forces")


@dataclass(frozen=True)
class Run:
    """One case with its settings.

    Attributes:
        name: How it is called in results and files.
        case: Module in `benchmarks.cases`.
        ranks: MPI ranks.
        options: Its command line.
        repeats: How often the full benchmark measures it.
        quick: Whether the quick benchmark measures it, once.
        threads: BLAS threads of each rank.
        seconds: Most that one measurement may take.
    """

    name: str
    case: str
    ranks: int = 2
    options: tuple[str, ...] = ()
    repeats: int = 3
    quick: bool = False
    threads: int = 1
    seconds: float = 600.0


def option(name: str, values: Sequence[int]) -> tuple[str, ...]:
    """Return a setting with several values as a command line."""
    return (f"--{name}", *map(str, values))


def refined_chain(k: int) -> tuple[str, ...]:
    """Return the chain with k times the cells and boxes in each direction."""
    return (
        *option("cells", [k * n for n in PAPER_CELLS]),
        *option("boxes", [k * n for n in PAPER_BOXES]),
    )


def chain_runs() -> list[Run]:
    """Return all runs of the chain's state."""
    runs = [
        Run("chain", "chain", quick=True),
        Run("chain-1-rank", "chain", 1, quick=True),
        Run("chain-refined-2", "chain", options=refined_chain(2)),
        Run("chain-refined-3", "chain", options=refined_chain(3), repeats=1, seconds=3600.0),
    ]
    runs += [
        Run(f"chain-friction-{mu}", "chain", options=("--friction-coefficient", mu)) for mu in OTHER_FRICTION
    ]
    runs += [
        Run(f"chain-compared-{ranks}", "chain", ranks, COMPARED, repeats=1, quick=ranks < 4)
        for ranks in (1, 2, 4)
    ]
    runs += [
        Run("chain-default", "chain", options=("--default-partition",), quick=True),
        Run("chain-compared-boxes", "chain", options=(*COMPARED, *option("boxes", (6, 2, 2))), repeats=1),
        Run("chain-compared-bisection", "chain", options=(*COMPARED, "--parts", "16"), repeats=1),
    ]
    return runs


def block_runs() -> list[Run]:
    """Return the block by this package and by others."""
    runs = [Run("frictionless-block", "frictionless_block", quick=True)]
    for size, cells in BLOCKS.items():
        counts, smallest, largest = option("counts", cells), size == "28k", size == "212k"
        repeats, seconds = (1, 3600.0) if largest else (3, 1200.0)
        boxes = option("boxes", BLOCK_BOXES[size])
        runs += [
            Run(f"block-{size}", "sliding_block", options=(*counts, *boxes), quick=smallest),
            Run(f"block-{size}-default", "sliding_block", options=counts, quick=smallest),
            *(
                Run(f"{solver}-{size}", "linear_block", 2, (*counts, "--solver", solver), quick=smallest)
                for solver in LINEAR
            ),
            Run(f"newton-{size}-ranks", "newton_block", 2, counts, 1, seconds=seconds),
            Run(
                f"newton-{size}-threads",
                "newton_block",
                1,
                counts,
                repeats,
                quick=smallest,
                threads=2,
                seconds=seconds,
            ),
        ]
    getfem = Run("getfem-28k", "getfem_block", 1, option("counts", BLOCKS["28k"]), quick=True, threads=2)
    return [*runs, getfem]


def all_runs() -> list[Run]:
    """Return every run, in the order in which they are measured."""
    return [
        *chain_runs(),
        Run("linear-face", "linear_face", quick=True),
        Run("design-step", "design_step"),
        Run("shape-optimisation", "shape_optimisation", seconds=1800.0),
        Run("demo", "demo", seconds=1800.0),
        *block_runs(),
    ]


#: Small runs that leave the compiled forms of all others behind them; their results are not used.
WARM_UP = (
    Run("warm-up-chain", "chain", 1, (*option("cells", (24, 4, 8)), *option("boxes", (4, 1, 2)))),
    Run("warm-up-block", "sliding_block", 1, (*option("counts", (8, 4, 4)), *option("boxes", (2, 1, 1)))),
    Run("warm-up-newton", "newton_block", 1, option("counts", (8, 4, 4))),
    Run("warm-up-linear", "linear_block", 1, (*option("counts", (8, 4, 4)), "--solver", "gamg")),
)


def chosen(names: Sequence[str], quick: bool) -> list[Run]:
    """Return the runs of a benchmark.

    Args:
        names: Only these; a name that no run has stands for all that begin with it. All if empty.
        quick: Only those of the quick benchmark; each once, also those that are named.

    Raises:
        ValueError: If no run begins with a name.
    """
    runs = [replace(run, repeats=1) for run in all_runs()] if quick else all_runs()
    if not names:
        return [run for run in runs if run.quick or not quick]
    known = [run.name for run in runs]
    wanted: set[str] = set()
    for name in names:
        meant = {name} if name in known else {other for other in known if other.startswith(name)}
        if not meant:
            raise ValueError(
                f"--only needs the name of a run or how it begins, got {name!r}: use one of "
                + ", ".join(known)
            )
        wanted |= meant
    return [run for run in runs if run.name in wanted]
