"""What becomes of a random history of large deformations: laws recomputed on whole bodies, and its twin."""

from __future__ import annotations

import logging
import time
import traceback
import warnings

import numpy as np
from mpi4py import MPI

from fenics_contact import ContactProblem, DeformedState, State, solve_steps
from fenics_contact.errors import ConvergenceError, FenicsContactError, InfeasibleError
from tests.hard.deformed.case import violations
from tools.random_scenes.deformed import History, cut, history
from tools.random_scenes.frame import Frame
from tools.random_scenes.judge import Outcome, Verdict

#: Relative differences of displacements and of forces between twins, solved to the default tolerance.
AGREE, FORCES = 1e-5, 1e-4
#: Forces out of balance, friction beyond its bound and gaps, relative.
LAWS = 1e-4


def judge_history(seed: int, comm: MPI.Comm = MPI.COMM_WORLD) -> Verdict:
    """Solve a history, recompute its laws, and solve it otherwise: elsewhere, in other units, cut otherwise.

    The twin is solved on all ranks of ``comm``, whose verdicts must be the same. Collective.
    """
    start = time.perf_counter()
    made = history(seed)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        told = logging.root.manager.disable
        logging.disable(logging.WARNING)
        try:
            outcome, detail, products = _ended(made, comm)
        finally:
            logging.disable(told)
    each = comm.allgather(outcome)
    if len(set(each)) > 1:
        outcome, detail = Outcome.WRONG, f"on ranks {[one.value for one in each]}: {detail}"
    return Verdict(seed, outcome, made.words, detail, round(time.perf_counter() - start, 3), products)


def _ended(made: History, comm: MPI.Comm) -> tuple[Outcome, str, int]:
    plain = Frame.plain(made.recipe.dim)
    one = _solved(made, plain, made.pieces[0], MPI.COMM_SELF)
    if isinstance(one, Exception):
        if not isinstance(one, FenicsContactError):
            place = traceback.extract_tb(one.__traceback__)[-1]
            return Outcome.TRACEBACK, f"{type(one).__name__}: {one} ({place.filename}:{place.lineno})", 0
        words = f"{type(one).__name__}: {one}"
        if isinstance(one, ConvergenceError):
            return Outcome.NOT_CONVERGED, words, 0
        if made.recipe.held or not isinstance(one, InfeasibleError):
            return Outcome.WRONG, f"nothing is wrong with it; {words}", 0
    other = _solved(made, made.frame, made.pieces[1], comm)
    if isinstance(one, Exception):
        if isinstance(other, Exception):
            same = type(other) is type(one)
            return (Outcome.REFUSED if same else Outcome.WRONG), f"{type(one).__name__}: {one}", 0
        return Outcome.WRONG, f"refused here and solved there: {one}", 0
    if isinstance(other, Exception):
        kind = Outcome.NOT_CONVERGED if isinstance(other, ConvergenceError) else Outcome.WRONG
        return kind, f"solved here, but there {type(other).__name__}: {other}", 0
    if not made.recipe.held:
        return Outcome.WRONG, "nothing holds it, yet it was solved", 0
    found = _complaints(one, made.recipe.remembers) + _differences(one, other, made.frame)
    products = sum(state.solution.products for state in one)
    return (Outcome.WRONG if found else Outcome.SOLVED), "; ".join(found), products


def _solved(
    made: History, frame: Frame, pieces: tuple[str, int] | None, comm: MPI.Comm
) -> list[State] | Exception:
    scene, steps = made.recipe.build(frame)
    try:
        tolerance = None if scene.is_nonlinear else 1e-9
        problem = ContactProblem(scene, comm, partitions=cut(scene, pieces), tolerance=tolerance)
        return list(solve_steps(problem, steps))
    except Exception as error:  # whatever comes from inside is what is looked for
        return error


def _complaints(states: list[State], remembers: bool) -> list[str]:
    """Say what breaks a law in the last state, recomputed on whole bodies."""
    last = states[-1]
    if not isinstance(last, DeformedState):
        return []
    laws = violations(states, remembers)  # type: ignore[arg-type]
    return [f"{name} {value:.1e}" for name, value in vars(laws).items() if not value <= LAWS]


def _at_nodes(state: State) -> np.ndarray:
    """Return the forces of contact at all nodes, pair by pair: twins may differ in points without any."""
    points = state.contact.points
    forces = np.zeros((len(state.scene.contacts), *state.scene.points.shape))
    forces[points.pair, points.slave] = state.contact.force
    return forces.reshape(-1, forces.shape[-1])


def _differences(one: list[State], other: list[State], frame: Frame) -> list[str]:
    """Say where twins differ at the end of any step."""
    found, bodies = [], one[0].scene.bodies
    sizes = [max(np.abs(state.gather_displacement(name)).max() for state in one for name in bodies)]
    sizes.append(max(np.abs(state.contact.force).max(initial=0.0) for state in one))
    for number, (here, there) in enumerate(zip(one, other, strict=True)):
        moved = max(
            np.abs(
                frame.back(there.gather_displacement(name), frame.length) - here.gather_displacement(name)
            ).max()
            for name in bodies
        )
        forces = frame.back(_at_nodes(there), frame.force) - _at_nodes(here)
        apart = (moved / (sizes[0] or 1.0), np.abs(forces).max(initial=0.0) / (sizes[1] or 1.0))
        if apart[0] > AGREE or apart[1] > FORCES:
            parts = [len(getattr(state, "fractions", ())) for state in (here, there)]
            found.append(
                f"step {number}: twins differ by {apart[0]:.1e}, forces by {apart[1]:.1e}, parts {parts}"
            )
    return found
