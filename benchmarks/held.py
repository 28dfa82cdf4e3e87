"""The counts that runs of the quick benchmark must keep."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Held:
    """Size of a run, exactly, and the work that it may take.

    Attributes:
        unknowns: Of the problem, see `targets.unknowns`.
        work: See `report.work`.
        margin: Factor up to which more work is let pass: other versions of BLAS and PETSc round differently.
    """

    unknowns: int
    work: int
    margin: float = 1.05


HELD = {
    "chain": Held(66528, 41),
    "chain-1-rank": Held(66528, 41),
    "chain-compared-1": Held(66528, 60),
    "chain-compared-2": Held(66528, 60),
    "chain-default": Held(72576, 33),
    "linear-face": Held(66528, 49),
    "frictionless-block": Held(34992, 24),
    "block-28k": Held(28611, 36),
    # 10 or 11 by the processor, 16 to 18 with PETSc 3.22; without the rigid motions 22.
    "gamg-28k": Held(28611, 11, margin=1.7),
    "cholesky-28k": Held(28611, 1),
    "newton-28k-threads": Held(28611, 9),
}
