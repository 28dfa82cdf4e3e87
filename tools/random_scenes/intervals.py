"""Whether intervals of `solve_to` contain the quantity that uniformly refined meshes tend to."""

from __future__ import annotations

import logging
import time
from collections.abc import Iterator

import numpy as np
from mpi4py import MPI

from fenics_contact import AccurateResult, ContactProblem, Limits, Scene, quantity, solve_to
from fenics_contact._adaptive.levels import unknowns_of
from fenics_contact._adaptive.refined_scene import refine_scene
from fenics_contact.design.forms import ShapeForms
from fenics_contact.design.objective import Objective
from fenics_contact.errors import ConvergenceError, FenicsContactError
from fenics_contact.results.state import State
from tools.random_scenes.generator import sample
from tools.random_scenes.judge import Outcome, Verdict, placed

QUANTITIES = (
    "peak_pressure", "contact_force", "displacement", "potential", "effective_area", "reaction",
    "friction_work",
)  # fmt: skip
ACCURACY = 0.02
#: Unknowns of the last mesh of `solve_to`, and of the last uniform one.
MOST, FINEST = {2: 1500, 3: 3000}, {2: 30_000, 3: 30_000}


def judge_interval(seed: int) -> Verdict:
    """Compute a quantity of a random scene to 2 %, and on refinements of its last mesh."""
    start = time.perf_counter()
    logging.getLogger("fenics_contact").setLevel(logging.ERROR)
    made = sample(seed)
    words = [made.words]
    outcome, detail, share, products = Outcome.REFUSED, "", 0.0, 0
    try:
        state = ContactProblem(made.scene, MPI.COMM_SELF, tolerance=1e-6).solve()
    except FenicsContactError as error:  # not of meshes: `judge` looks into these
        detail = f"the scene itself: {type(error).__name__}"
    else:
        outcome, detail, share, products = _ended(seed, state, words)
    seconds = round(time.perf_counter() - start, 3)
    return Verdict(seed, outcome, "; ".join(words), detail, seconds, products, share)


def _ended(seed: int, state: State, words: list[str]) -> tuple[Outcome, str, float, int]:
    scene = state.scene
    try:
        name, wanted = chosen(seed, state)
        words.append(f"{name} {wanted!r}")
        limits = Limits(levels=15, unknowns=MOST[scene.dim])
        found = solve_to(scene, wanted, ACCURACY, MPI.COMM_SELF, limits=limits)
        if not np.isfinite(found.error):
            return Outcome.REFUSED, f"{name}: {found.reason[:60]}", 0.0, 0
        values = [found.levels[-1].state_value, *finer(found, wanted)]
    except ConvergenceError as error:
        return Outcome.NOT_CONVERGED, str(error), 0.0, 0
    except FenicsContactError as error:
        return Outcome.REFUSED, f"{type(error).__name__}: {error}", 0.0, 0
    except Exception as error:  # whatever comes from inside is what is looked for
        return Outcome.TRACEBACK, placed(error), 0.0, 0
    reference, doubt = extrapolated(values)
    off = abs(found.value - reference)
    steps = " ".join(f"{level.value:.6g}±{level.error:.2g}" for level in found.levels)
    detail = (
        f"{name}: {steps}; then {' '.join(f'{value:.6g}' for value in values[1:])} -> {reference:.6g}±"
        f"{doubt:.1g}; {found.levels[-1].unknowns} unknowns; {found.reason}"
    )
    # What the state's own tolerance and rounding leave is no error of the mesh.
    rounding = 1e-5 * max(abs(found.value), abs(reference))
    outcome = Outcome.SOLVED if off <= found.error + rounding else Outcome.WRONG
    share = off / found.error if found.error > 0.0 else 0.0
    return outcome, detail, share, found.levels[-1].products


def chosen(seed: int, state: State) -> tuple[str, Objective]:
    """Return the first quantity from a place in the list on that the scene has; all depend on its loads."""
    scene = state.scene
    for name in (*QUANTITIES, *QUANTITIES)[seed % len(QUANTITIES) :]:
        contacts, laws = bool(scene.contacts), [pair.has_friction for pair in scene.contacts]
        needed = {
            "peak_pressure": contacts, "contact_force": contacts, "effective_area": contacts,
            "reaction": bool(scene.supports), "friction_work": any(laws),
        }  # fmt: skip
        if needed.get(name, True):
            return name, quantity(name, scene, **_where(name, state))
    raise AssertionError


def _where(name: str, state: State) -> dict[str, object]:
    scene = state.scene
    if name == "contact_force":
        pair = scene.contacts[0]
        force = state.contact.force[state.contact.on_pair(0)].sum(axis=0)
        return {"surface": f"{pair.slave.body} {pair.slave.name}", "direction": _some(force)}
    if name == "reaction":
        support = scene.supports[-1]
        of_last = [
            reaction.force
            for other, reaction in zip(scene.supports, state.reactions(), strict=True)
            if (other.body, other.surface) == (support.body, support.surface)
        ]
        return {"surface": f"{support.body} {support.surface}", "direction": _some(np.sum(of_last, axis=0))}
    if name == "displacement":
        body = list(scene.bodies)[-1]
        mesh = scene.bodies[body].mesh
        surface = sorted(mesh.surfaces)[-1]
        moved = state.gather_displacement(body)[np.unique(mesh.surfaces[surface])].mean(axis=0)
        return {"surface": f"{body} {surface}", "direction": _some(moved)}
    return {}


def _some(vector: np.ndarray) -> tuple[float, ...]:
    size = float(np.linalg.norm(vector))
    return tuple(vector / size) if size > 0.0 else tuple(np.eye(len(vector))[-1])


def finer(found: AccurateResult, wanted: Objective, most: int = 2) -> Iterator[float]:
    """Return the quantity on up to two uniform refinements of the last mesh."""
    scene = found.state.scene
    for _ in range(most):
        scene = refine_scene(scene, _all_cells(scene)).scene
        if unknowns_of(scene) > FINEST[scene.dim]:
            return
        state = ContactProblem(scene, MPI.COMM_SELF, tolerance=1e-6).solve()
        yield wanted.value(state, ShapeForms.at_rest(state.torn))


def _all_cells(scene: Scene) -> dict[str, np.ndarray]:
    return {name: np.arange(body.mesh.n_cells) for name, body in scene.bodies.items()}


def extrapolated(values: list[float]) -> tuple[float, float]:
    """Return what values on meshes with halved cells tend to, and by how much that may be off.

    Errors fall by the ratio of the last two changes, at least by a fifth and at most to a quarter.
    """
    steps = np.diff(values)
    if len(steps) < 2 or steps[0] * steps[1] <= 0.0:
        rest = steps[-1] / 3.0 if len(steps) == 1 else 0.0
        return values[-1] + rest, abs(steps[-1])
    ratio = min(max(steps[1] / steps[0], 0.25), 0.8)
    rest = steps[1] * ratio / (1.0 - ratio)
    return values[-1] + rest, abs(rest)
