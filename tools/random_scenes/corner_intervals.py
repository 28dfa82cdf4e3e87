"""Whether intervals of `solve_to` contain what quantities of scenes with corners and contrasts really are."""

from __future__ import annotations

import logging
import time
from contextlib import suppress
from typing import Any

import numpy as np
from mpi4py import MPI

from fenics_contact import Limits, quantity, solve_to
from fenics_contact.errors import ConvergenceError, FenicsContactError
from tools.random_scenes.corners import Corners, corners
from tools.random_scenes.judge import Outcome, Verdict, placed
from tools.random_scenes.nonlinear import nonlinear

#: Accuracies that are asked for.
ACCURACIES = (0.1, 0.05, 0.02, 0.01)
#: Unknowns of the last mesh.
MOST = 5000


def judge_corners(seed: int) -> Verdict:
    """Compute a quantity of a scene to an accuracy, and compare it with graded meshes of quadratic cells."""
    return _judged(seed, corners(seed), MOST)


def judge_nonlinear(seed: int) -> Verdict:
    """The same of rubber, metal and large sliding; the detail has processor seconds, too."""
    return _judged(seed, nonlinear(seed), 2000, layers=2, widest=0.2)


def _judged(seed: int, made: Corners, most: int, **finest: float) -> Verdict:
    """Judge a scene; `most`: unknowns of the last mesh; `finest`: of `Corners.reference`."""
    start = time.perf_counter()
    logging.getLogger("fenics_contact").setLevel(logging.ERROR)
    accuracy = ACCURACIES[seed // 2 % len(ACCURACIES)]
    try:
        outcome, detail, share, products = _ended(made, accuracy, most, finest)
    except ConvergenceError as error:
        outcome, detail, share, products = Outcome.NOT_CONVERGED, str(error), 0.0, 0
    except FenicsContactError as error:
        outcome, detail, share, products = Outcome.REFUSED, f"{type(error).__name__}: {error}", 0.0, 0
    except Exception as error:  # whatever comes from inside is what is looked for
        outcome, detail, share, products = Outcome.TRACEBACK, placed(error), 0.0, 0
    seconds = round(time.perf_counter() - start, 3)
    return Verdict(seed, outcome, made.words, detail, seconds, products, share)


def _ended(
    made: Corners, accuracy: float, most: int, finest: dict[str, Any]
) -> tuple[Outcome, str, float, int]:
    scene, (name, where) = made.start(), made.quantity
    limits, began = Limits(levels=15, unknowns=most), time.process_time()
    found = solve_to(scene, quantity(name, scene, **where), accuracy, MPI.COMM_SELF, limits=limits)
    if not np.isfinite(found.error):
        return Outcome.REFUSED, f"{name}: {found.reason[:60]}", 0.0, 0
    spent = time.process_time() - began
    reference, doubt = _reference(made, finest)
    if doubt > 0.5 * found.error:
        return Outcome.REFUSED, "the reference is not known well enough", 0.0, 0
    off = abs(found.value - reference)
    # What the state's own tolerance and rounding leave is no error of the mesh.
    allowed = found.error + doubt + 1e-5 * max(abs(found.value), abs(reference))
    steps = " ".join(f"{level.value:.6g}±{level.error:.2g}" for level in found.levels)
    detail = (
        f"{steps}; graded {reference:.6g}±{doubt:.1g}; {accuracy:g} wanted, reached: {found.reached}, "
        f"{found.levels[-1].unknowns} unknowns, {spent:.2f} s"
    )
    share = off / found.error if found.error > 0.0 else 0.0
    products = max(level.products for level in found.levels)
    return (Outcome.SOLVED if off <= allowed else Outcome.WRONG), detail, share, products


def _reference(made: Corners, finest: dict[str, Any]) -> tuple[float, float]:
    """Return a reference and its doubt; of coarser meshes where the finest one does not converge.

    Quadratic cells at a corner may turn inside out where those of `solve_to` are still too large to.
    """
    for coarser in ({}, {"layers": 1}):
        with suppress(ConvergenceError):
            return made.reference(**finest | coarser)
    return 0.0, np.inf
