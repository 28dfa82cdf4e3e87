"""What becomes of a scene in which features meet: written in two ways it has one answer, or one refusal."""

from __future__ import annotations

import logging
import time
import warnings

import numpy as np
from mpi4py import MPI

from fenics_contact import ContactProblem, Scene, State, solve_steps
from fenics_contact.errors import ConvergenceError, FenicsContactError
from fenics_contact.mesh import bisection_partition
from tools.random_scenes.judge import Outcome, Verdict, placed
from tools.random_scenes.meetings import SlidingPair, Writing, meeting

#: Relative differences of displacements and of forces, and forces out of balance, at a tolerance of 1e-9.
AGREE, FORCES, BALANCE = 1e-5, 1e-4, 1e-6


def judge_meeting(seed: int) -> Verdict:
    """Solve a scene written down in two ways, and compare."""
    start, made = time.perf_counter(), meeting(seed)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        disabled = logging.root.manager.disable
        logging.disable(logging.WARNING)
        try:
            outcome, detail, products = _ended(made)
        finally:
            logging.disable(disabled)
    return Verdict(seed, outcome, made.words, detail, round(time.perf_counter() - start, 3), products)


def _ended(made: SlidingPair) -> tuple[Outcome, str, int]:
    here, there = Writing(), made.other
    one, other = (
        _solved(made, writing, pieces) for writing, pieces in zip((here, there), made.pieces, strict=True)
    )
    for found in (one, other):
        if isinstance(found, Exception) and not isinstance(found, FenicsContactError):
            return Outcome.TRACEBACK, placed(found), 0
    if isinstance(one, Exception) or isinstance(other, Exception):
        words = " | ".join(
            f"{type(each).__name__}: {each}" if isinstance(each, Exception) else "solved"
            for each in (one, other)
        )
        if isinstance(one, ConvergenceError) or isinstance(other, ConvergenceError):
            return Outcome.NOT_CONVERGED, words, 0
        return (Outcome.REFUSED if type(one) is type(other) else Outcome.WRONG), words, 0
    found = _differences(one, other, made, (here, there))
    products = sum(state.solution.products for state in one)
    return (Outcome.WRONG if found else Outcome.SOLVED), "; ".join(found), products


def _solved(made: SlidingPair, writing: Writing, pieces: int) -> list[State] | Exception:
    try:
        scene, steps = made.build(writing)
        problem = ContactProblem(scene, MPI.COMM_SELF, partitions=_cut(scene, pieces), tolerance=1e-9)
        return list(solve_steps(problem, steps))
    except Exception as error:  # whatever comes from inside is what is looked for
        return error


def _cut(scene: Scene, pieces: int) -> dict[str, np.ndarray] | None:
    if pieces == 1:
        return None
    return {
        name: bisection_partition(body.mesh, min(pieces, body.mesh.n_cells))
        for name, body in scene.bodies.items()
    }


def _differences(
    one: list[State], other: list[State], made: SlidingPair, writings: tuple[Writing, Writing]
) -> list[str]:
    """Return in words where both differ at the end of any step."""
    here, there = writings
    found, bodies = [], list(one[0].scene.bodies)
    size = max(np.abs(state.gather_displacement(name)).max() for state in one for name in bodies)
    force = max(np.abs(state.contact.force).max(initial=0.0) for state in one)
    for number, (first, second) in enumerate(zip(one, other, strict=True)):
        apart = 0.0
        for name in bodies:
            back = second.gather_displacement(name)[there.node[name]] @ there.turn / there.length
            apart = max(apart, np.abs(back - first.gather_displacement(name)[here.node[name]]).max())
        pressed = [_forces(state, writing, made) for state, writing in ((first, here), (second, there))]
        figures = {
            "displacements": (apart / (size or 1.0), AGREE),
            "forces": (np.abs(pressed[1] - pressed[0]).max(initial=0.0) / (force or 1.0), FORCES),
            "balance": (max(state.balance().imbalance for state in (first, second)), BALANCE),
        }
        words = [f"{name} {value:.1e}" for name, (value, most) in figures.items() if not value <= most]
        if len(first.unheld) != len(second.unheld):
            words.append(" and ".join(f"unheld {[*map(str, each.unheld)]}" for each in (first, second)))
        found += [f"step {number}: {each}" for each in words]
    return found


def _forces(state: State, writing: Writing, made: SlidingPair) -> np.ndarray:
    """Return forces of contact at all nodes pair by pair as in the first writing; of periodic ones sums."""
    points = state.contact.points
    forces = np.zeros((len(state.scene.contacts), *state.scene.points.shape))
    forces[points.pair, points.slave] = state.contact.force
    if made.periodic:
        forces = forces.sum(axis=1, keepdims=True)
    else:
        start, order = 0, []
        for name in state.scene.bodies:
            order.append(start + writing.node[name])
            start += len(writing.node[name])
        forces = forces[:, np.concatenate(order)]
    return np.asarray(forces @ writing.turn / writing.force)
