"""One case of large deformations: load steps, what must hold of their states, and what must be the same."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from mpi4py import MPI

from fenics_contact import (
    AutomaticSteps,
    ContactProblem,
    DeformedState,
    LoadStep,
    Scene,
    TangentNewton,
    solve_steps,
)
from fenics_contact._large_deformations.equations import Equations
from fenics_contact.feti import decompose
from fenics_contact.mesh import bisection_partition
from tests.scenes import AnySupport

States = Sequence[DeformedState]
TOLERANCE = 1e-9
TINY = 1e-300


@dataclass(frozen=True)
class Case:
    """Load steps of a scene, and what is expected of them.

    Attributes:
        scene: The scene.
        steps: Its load steps.
        pieces: Subdomains of every body.
        other: Those of another solution, which must be the same.
        checks: Asserts what is known of these very states, by other means than the solver's.
        twins: Displacements that must be those of the last state, solved in other ways, shape (n_nodes, dim).
        agreement: Largest relative difference between displacements that should be the same.
        remembers: Whether forces depend on the way there or on loads, and are not recomputed from the last
            displacement.
        snaps: Whether bodies snap through where no equilibrium is near.
        most: Newton steps after which a part of a load step is given up.
        error: Class of the error that is expected instead.
        match: Pattern of its message.
    """

    scene: Scene
    steps: Sequence[LoadStep]
    pieces: int = 4
    other: int = 3
    checks: Callable[[States], None] | None = None
    twins: Mapping[str, Callable[[], np.ndarray]] = field(default_factory=dict)
    agreement: float = 1e-6
    remembers: bool = False
    snaps: bool = False
    most: int = 25
    error: type[Exception] | None = None
    match: str = ""

    def solve(self, comm: MPI.Comm = MPI.COMM_SELF, pieces: int | None = None) -> States:
        """Find the states. Collective."""
        number = self.pieces if pieces is None else pieces
        cut = {
            name: bisection_partition(body.mesh, min(number, body.mesh.n_cells))
            for name, body in self.scene.bodies.items()
        }
        newton = AutomaticSteps(TangentNewton(TOLERANCE, max_steps=self.most), snaps=self.snaps)
        problem = ContactProblem(self.scene, comm, partitions=cut, steps=newton)
        states = solve_steps(problem, self.steps)
        assert all(isinstance(state, DeformedState) for state in states)
        return states  # type: ignore[return-value]


CASES: dict[str, Callable[[], Case]] = {}


def case(build: Callable[[], Case]) -> Callable[[], Case]:
    """Add a function that builds a case to the list, under its name read as a sentence."""
    CASES[build.__name__.replace("_", " ")] = build
    return build


def ways(*supports: Sequence[AnySupport]) -> list[LoadStep]:
    """Return a load step for each list of supports."""
    return [LoadStep(str(number), supports=list(given)) for number, given in enumerate(supports)]


def times(*values: float) -> list[LoadStep]:
    """Return a load step that ends at each of some times."""
    return [LoadStep(f"to {value:g}", time=value) for value in values]


def displacement(state: DeformedState) -> np.ndarray:
    """Return the displacement of all bodies' nodes, shape (n_nodes, dim)."""
    return np.concatenate([state.gather_displacement(name) for name in state.scene.bodies])


def last_of(build: Callable[[], Case]) -> Callable[[], np.ndarray]:
    """Return a twin: the last displacement of another case."""
    return lambda: displacement(build().solve()[-1])


def reaction(state: DeformedState, support: int) -> np.ndarray:
    """Return the force of a support on its body, [force]."""
    return np.asarray(state.reactions()[support].force)


def difference(one: np.ndarray, other: np.ndarray) -> float:
    """Return the largest difference relative to the largest value."""
    size = max(float(np.abs(other).max(initial=0.0)), 1e-300)
    return float(np.abs(one - other).max(initial=0.0)) / size


@dataclass(frozen=True)
class Found:
    """How far a state is from what must hold, recomputed on whole bodies; all relative.

    Attributes:
        nodal: Largest force out of balance at a node that is free.
        cone: Largest tension or excess of friction.
        law: Largest penetration or normal force × gap.
    """

    nodal: float
    cone: float
    law: float


def violations(states: States, remembers: bool) -> Found:
    """Recompute those of the last state, relative to the largest forces on the way."""
    state = states[-1]
    least = max(np.abs(each.contact.normal_force).max(initial=0.0) for each in states)
    contact, u = state.contact, displacement(state)
    on_nodes = contact.points.jump.T @ contact.force if contact.points.count else np.zeros_like(u)
    nodal = state.balance().imbalance
    if not remembers:
        out = _internal(state.scene, u) - on_nodes
        size = np.abs(out[_fixed(state.scene)]).max(initial=np.abs(on_nodes).max(initial=0.0))
        nodal = max(
            nodal, np.abs(out[~_fixed(state.scene)]).max(initial=0.0) / max(float(size), float(least), TINY)
        )
    force, length = np.abs(contact.normal_force).max(initial=0.0) or 1.0, np.abs(u).max() or 1.0
    friction = np.linalg.norm(contact.friction_force, axis=1)
    return Found(
        float(nodal),
        float(
            max(-contact.normal_force.min(initial=0.0), (friction - contact.slip_bound).max(initial=0.0))
            / force
        ),
        float(
            max(
                -contact.gap.min(initial=0.0) / length,
                np.abs(contact.normal_force * contact.gap).max(initial=0.0) / (force * length),
            )
        ),
    )


def _internal(scene: Scene, u: np.ndarray) -> np.ndarray:
    """Return the internal forces of whole bodies, shape (n_nodes, dim)."""
    decomposition = _whole(scene)
    mechanics = Equations(scene, decomposition)._mechanics
    force = np.zeros_like(u)
    for mesh, each in zip(decomposition.meshes, mechanics, strict=True):
        nodes = decomposition.tearing.global_nodes(mesh.body, mesh.nodes)
        force[nodes] += each.at(u[nodes].ravel()).force.reshape(len(nodes), -1)
    return force


def _fixed(scene: Scene) -> np.ndarray:
    return np.asarray(_whole(scene).fixed)


def _whole(scene: Scene):  # type: ignore[no-untyped-def]
    one = {name: np.zeros(body.mesh.n_cells, dtype=np.int64) for name, body in scene.bodies.items()}
    return decompose(scene, one, MPI.COMM_SELF)
