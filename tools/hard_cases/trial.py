"""A hard case with a scene: how it is cut, solved, given otherwise, and what all its answers must share."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from mpi4py import MPI

from benchmarks.graph_partition import graph_partition
from fenics_contact import (
    ContactProblem,
    LoadStep,
    Scene,
    State,
    Status,
    box_partition,
    solve_scene,
    solve_steps,
)
from fenics_contact.errors import ConvergenceError
from fenics_contact.mesh import bisection_partition
from fenics_contact.qp import DualSolver, FaceNewton
from fenics_contact.qp.solution import SolverStep
from tools.hard_cases.transform import in_units, steps_in_units

Cut = Mapping[str, np.ndarray]
TOLERANCE = 1e-9
#: More products than any case that is solved needs; one that fails shall do so soon.
SOLVER = FaceNewton(tolerance=TOLERANCE, max_products=4000)
#: For cases that are known to fail: enough to see it.
HASTY = FaceNewton(tolerance=TOLERANCE, max_products=1500)
#: What a solver says that could not reach its tolerance.
STANDS_STILL = "face Newton needs residuals below"
#: Units of length and force that are no powers of two, nor of ten: an inch and a pound.
OTHER_UNITS = (25.4, 4.4482216)


@dataclass(frozen=True)
class Trial:
    """A scene and what is expected of it.

    Attributes:
        scene: The scene.
        cut: Subdomain of every cell of every body.
        other: Another partition, with another number of subdomains; None where the bodies have one cell.
        solver: Dual solver with its tolerance.
        steps: Load steps; the state after the last is judged.
        units: Whether the answer is found in other units, too.
        ranks: Numbers of ranks on which the answer must be the same.
        forces: Whether the forces of single contact points are unique, else only their sum over all is.
        displacements: Whether displacements are unique, else only their differences of energy are.
        amplification: What conditioning may make of the tolerance in the balance of nodes and in distances.
        agreement: Largest relative difference between answers that should be one.
        force_scale: The smallest force that contact forces are compared with, in its own unit.
        checks: Asserts what is known of this very answer.
        remark: Says something measured about it, for the table.
        twins: Other scenes that must have the same answer, given in the coordinates and units of this one.
        error: Class of the error that is expected instead of an answer.
        match: Pattern of its message.
        cause: Why it fails, which a better solver may not; empty where the error is the right answer.
    """

    scene: Scene
    cut: Cut
    other: Cut | None = None
    solver: DualSolver = SOLVER
    steps: tuple[LoadStep, ...] = ()
    units: bool = True
    ranks: tuple[int, ...] = (2,)
    forces: bool = True
    displacements: bool = True
    amplification: float = 10.0
    agreement: float = 1e-6
    force_scale: float = 0.0
    checks: Callable[[State], None] | None = None
    remark: Callable[[State], str] | None = None
    twins: Mapping[str, Callable[[], Answer]] = field(default_factory=dict)
    error: type[Exception] | None = None
    match: str = ""
    cause: str = ""

    def solve(self, comm: MPI.Comm = MPI.COMM_SELF, cut: Cut | None = None) -> State:
        """Find the state. Collective."""
        cut = self.cut if cut is None else cut
        if self.steps:
            return solve_steps(
                ContactProblem(self.scene, comm, partitions=cut, solver=self.solver), self.steps
            )[-1]
        return solve_scene(self.scene, comm, partitions=cut, solver=self.solver)

    def in_units(self, length: float, force: float) -> Trial:
        """Return the trial in other units."""
        scene = in_units(self.scene, length, force)
        steps = steps_in_units(self.steps, length, force, self.scene.dim)
        return replace(self, scene=scene, steps=steps)


@dataclass(frozen=True)
class Entry:
    """A trial in the list: built when it is run."""

    group: str
    sentence: str
    build: Callable[[], Trial]


TRIALS: dict[str, Entry] = {}


def trial(group: str, sentence: str | None = None) -> Callable[[Callable[[], Trial]], Callable[[], Trial]]:
    """Add a function that builds a trial to the list, under its name read as a sentence."""

    def add(build: Callable[[], Trial]) -> Callable[[], Trial]:
        words = sentence or build.__name__.replace("_", " ")
        assert words not in TRIALS, words
        TRIALS[words] = Entry(group, words, build)
        return build

    return add


def boxes(scene: Scene, counts: tuple[int, ...]) -> Cut:
    """Cut every body into the same boxes, as far as it has so many layers of cells."""
    cut = {}
    for name, body in scene.bodies.items():
        assert body.mesh.grid is not None
        layers = body.mesh.grid.max(axis=0) + 1
        cut[name] = box_partition(
            body.mesh, tuple(int(min(n, m)) for n, m in zip(counts, layers, strict=True))
        )
    return cut


def bisected(scene: Scene, parts: int) -> Cut:
    """Cut every body by bisection of its cell centres."""
    return {
        name: bisection_partition(body.mesh, min(parts, body.mesh.n_cells))
        for name, body in scene.bodies.items()
    }


def ragged(scene: Scene, parts: int) -> Cut:
    """Cut every body by METIS."""
    return {
        name: graph_partition(body.mesh, min(parts, body.mesh.n_cells), name)
        for name, body in scene.bodies.items()
    }


def failing_trial(scene: Scene, cause: str, **options: Any) -> Trial:
    """Return a trial that the solver is known not to manage, at least in some partition; it must say so."""
    expected = {"error": ConvergenceError, "match": STANDS_STILL, "solver": HASTY, "ranks": ()}
    return cut_trial(scene, cause=cause, **{**expected, "amplification": 1e4, "agreement": 1e-3, **options})


def cut_trial(scene: Scene, **options: Any) -> Trial:
    """Return a trial whose bodies are cut in two along x, and otherwise by bisection in three."""
    first = (2,) + (1,) * (scene.dim - 1)
    return Trial(scene, **{"cut": boxes(scene, first), "other": bisected(scene, 3), **options})


@dataclass(frozen=True)
class Answer:
    """What must be the same however a scene is given; lengths and forces in the units of the trial.

    Attributes:
        force: On every slave node, (n, dim), [force].
        displacement: Of all bodies' nodes, (n_nodes, dim), [length].
        energy: The minimum at given slip bounds, total potential and friction, [force length].
    """

    force: np.ndarray
    displacement: np.ndarray
    energy: np.ndarray

    @classmethod
    def of(cls, state: State) -> Answer:
        """Collect it from a state. Collective."""
        displacement = np.concatenate([state.gather_displacement(name) for name in state.scene.bodies])
        return cls(state.contact.force, displacement, np.array([state.energies.primal]))

    @classmethod
    def read(cls, data: Mapping[str, Any]) -> Answer:
        """Take back what `written` gave."""
        return cls(*(np.array(data[name]) for name in ("force", "displacement", "energy")))

    def written(self) -> dict[str, Any]:
        """Return plain lists."""
        return {name: getattr(self, name).tolist() for name in ("force", "displacement", "energy")}

    def in_units(self, length: float, force: float) -> Answer:
        """Return the answer that is expected in other units."""
        return Answer(force * self.force, length * self.displacement, length * force * self.energy)

    def difference(self, other: Answer, trial: Trial) -> float:
        """Return the largest relative difference of what is unique."""
        found = []
        if trial.forces:
            found.append(_relative(self.force, other.force, trial.force_scale))
        elif self.force.size:
            size = np.abs(self.force).sum() or 1.0
            found.append(float(np.abs((self.force - other.force).sum(axis=0)).max() / size))
        if trial.displacements:
            found.append(_relative(self.displacement, other.displacement))
        else:
            found.append(_relative(self.energy, other.energy))
        return max(found)


def _relative(first: np.ndarray, second: np.ndarray, least: float = 0.0) -> float:
    if first.shape != second.shape:
        return np.inf
    size = np.abs(first).max(initial=least)
    difference = np.abs(first - second).max(initial=0.0)
    return float(difference / size) if size > 0.0 else float(difference > 0.0)


def statuses(state: State) -> str:
    """Return the counts of open, sticking and slipping points."""
    return (
        " / ".join(str(state.contact.count(status)) for status in Status)
        if state.contact.points.count
        else ""
    )


def scene_size(state: State) -> str:
    """Return torn unknowns, subdomains and contact points."""
    counts = state.counts
    return f"{counts['torn_unknowns']} / {counts['subdomains']} / {counts['normal_multipliers']}"


def fallbacks(history: Sequence[SolverStep]) -> str:
    """Say what had to help a solver, from the notes of its history."""
    notes = [step.note for step in history]
    kinds = Counter(step.method for step in history if "rescue" in step.method)
    cycles = {found[0] for note in notes if (found := re.search(r"cycles with period \d+", note))}
    cuts = sum("cut to" in note for note in notes)
    damped = sum("damping with" in note for note in notes)
    parts = [_counted(number, kind) for kind, number in sorted(kinds.items())]
    parts += [f"the active set {cycle}" for cycle in sorted(cycles)]
    parts += [_counted(number, what) for number, what in ((cuts, "cut"), (damped, "damping")) if number]
    return ", ".join(parts)


def _counted(number: int, what: str) -> str:
    return f"{number} {what}{'' if number == 1 else 's'}"
