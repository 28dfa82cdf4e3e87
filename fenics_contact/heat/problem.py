"""Temperatures of a scene: its subdomains, joints, and the iteration where laws depend on temperatures."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from math import inf
from typing import Any

import numpy as np

from fenics_contact._base.checks import kind_in_words, naming_arguments
from fenics_contact._base.display import displayed
from fenics_contact._base.libraries import MPI
from fenics_contact._base.progress import PhaseTimer
from fenics_contact._base.shared import once_a_machine
from fenics_contact._pairing.points import join_points
from fenics_contact.errors import ConvergenceError, InvalidInputError, collectively, together
from fenics_contact.feti.all_rows import RowGroups
from fenics_contact.feti.decomposition import Decomposition, decompose, prescribed_along
from fenics_contact.feti.dual import DualSystem
from fenics_contact.feti.free_motions import free_motions
from fenics_contact.feti.torn import NumberedRows, TornSystem, at_rest, numbered, with_contact
from fenics_contact.heat.acceleration import CautiousAnderson
from fenics_contact.heat.assembly import Assembly, Heated, Rate
from fenics_contact.heat.determined import (
    require_agreement,
    require_agreement_across_ties,
    require_temperatures,
)
from fenics_contact.heat.forms import HeatForms
from fenics_contact.heat.joints import Joints
from fenics_contact.heat.plausible import blocked, odd_values, warn_of
from fenics_contact.heat.rows import ConductingRows
from fenics_contact.heat.scene import HeatScene
from fenics_contact.heat.solved import Solved, refined
from fenics_contact.heat.state import HeatState
from fenics_contact.qp.face_newton import ProjectedCG
from fenics_contact.results.dual_solve import solve_dual


@dataclass(frozen=True, eq=False)
class GivenContact:
    """What mechanics gives to the points of contacts, (n,) each: pressures, gaps, work of friction.

    `work`: per area and time, [power / length²].
    """

    pressure: np.ndarray
    gap: np.ndarray
    work: np.ndarray


@displayed
class HeatProblem:
    """Successive temperatures of a scene; meshes, numbering, points and factors stay where they can.

    Attributes:
        scene: The scene as it was given.
        comm: Communicator over which the subdomains are spread.
        tolerance: Largest relative residual of linear systems.
        timer: Wall time of this rank by phase, over all solutions.
        products: Applications of dual operators, of all solutions.
        state: The last solution, None before the first.
    """

    state: HeatState | None

    def __init__(
        self,
        scene: HeatScene,
        comm: MPI.Comm,
        *,
        partitions: Mapping[str, np.ndarray] | None = None,
        tolerance: float = 1e-11,
    ) -> None:
        """Prepare; nothing is computed yet. Arguments as for `solve_heat`."""
        if not isinstance(scene, HeatScene):
            raise InvalidInputError(
                f"what is solved must be a HeatScene, got {kind_in_words(type(scene))}: scenes of mechanics "
                "are solved by solve_scene, those of both by solve_heated"
            )
        self.scene, self.comm, self.tolerance = scene, comm, tolerance
        self.timer, self.state, self.products = PhaseTimer(), None, 0
        self._partitions = partitions
        self._decomposition: Decomposition | None = None
        self._assemblies: tuple[Assembly, ...] = ()
        self._joints: tuple[Joints, ...] = ()
        self._stiffness = np.zeros(0)

    def _facts(self) -> dict[str, Any]:
        bodies = {name: body.mesh.cells_in_words for name, body in self.scene.bodies.items()}
        return {"bodies": bodies, "ranks": self.comm.size, "tolerance": self.tolerance}

    @property
    def decomposition(self) -> Decomposition:
        """The subdomains. Collective on first use."""
        if self._decomposition is None:
            field, ranks = self.scene.field, self.comm.size
            with self.timer.phase("decompose"):
                cut = self._partitions or once_a_machine(self.comm, lambda: field.partition(ranks))
                self._decomposition = decompose(field, cut, self.comm)
                self._stiffness = self._decomposition.tearing.copy_stiffness
                forms = HeatForms(self._decomposition.forms.templates)
                self._assemblies = tuple(map(Assembly, forms.parts(self.scene, self._decomposition.meshes)))
        return self._decomposition

    def weighted(self, decomposition: Decomposition, heated: tuple[Heated, ...]) -> Decomposition:
        """Return subdomains whose copies of nodes share jumps by all that resists there. Collective."""
        here, block = decomposition.held
        stiffness = np.empty(len(block))
        stiffness[block] = self._stiffness[here]
        stiffness *= np.concatenate([np.zeros(0), *(each.stiffened for each in heated)])
        self._decomposition = decomposition.weighted(self.scene.field, stiffness)
        return self._decomposition

    @property
    def no_rate(self) -> Rate:
        """The rate of a steady state. Collective on first use."""
        decomposition = self.decomposition
        history = tuple(np.zeros(mesh.size) for mesh in decomposition.meshes)
        return Rate(0.0, np.zeros(decomposition.tearing.n_nodes), history)

    @collectively("HeatProblem.solve", lambda self, *_, **__: self.comm)
    def solve(
        self,
        scene: HeatScene | None = None,
        *,
        rate: Rate | None = None,
        given: GivenContact | None = None,
        most: int = 60,
    ) -> HeatState:
        """Return the temperatures of a scene, by default the given one, in a steady state. Collective.

        Args:
            scene: One with the same bodies.
            rate: How fast heat is stored; None: not at all.
            given: Pressures and gaps of contacts; None: as the scene says.
            most: Linear systems after which an iteration is given up.
        """
        scene = scene or self.scene
        with together(self.comm):
            require_agreement(scene)
        decomposition = self.decomposition.holding(scene.field)
        HeatForms(decomposition.forms.templates).prepare(scene)
        joints = self.joints(scene)
        iteration = _Iteration(self, scene, decomposition, joints, rate or self.no_rate,
                               given or as_given(joints))  # fmt: skip
        self.state = iteration.run(self.state, most)
        self.products += self.state.products
        return self.state

    def joints(self, scene: HeatScene) -> Joints:
        """Return the points of contacts and ties of a scene, those of the last one again. Collective."""
        decomposition = self.decomposition.holding(scene.field)
        if not any(known.scene is scene for known in self._joints):
            with self.timer.phase("pair"):
                self._joints = (Joints.of(scene, decomposition, self._joints),)
        return self._joints[0]


def as_given(joints: Joints) -> GivenContact:
    """Return pressures and gaps as a scene has them before mechanics moves anything."""
    return GivenContact(joints.pressure, joints.points.gap, np.zeros(joints.points.count))


@dataclass(frozen=True, eq=False)
class _Iteration:
    """Linear systems until laws agree with the temperatures that they lead to."""

    problem: HeatProblem
    scene: HeatScene
    decomposition: Decomposition
    joints: Joints
    rate: Rate
    given: GivenContact

    def run(
        self, last: HeatState | None, most: int, settled: float = 1e-10, loosest: float = 1e-3
    ) -> HeatState:
        guess, anderson, products = self._first(last), self._anderson, 0
        full, linear, floor = self.problem.tolerance, self.scene.is_linear, -inf
        for part in (*self.scene.loads, *(each.law for each in self.scene.contacts)):
            floor = max(floor, part.absolute_zero)
        tolerance = full if linear else max(full, loosest)
        for count in range(1, most + 1):
            state = self._linear(guess, last, tolerance, (count, products))
            products, last = state.products, state
            size = np.abs(state.values - state.values.mean()).max()
            following = anderson.next(guess, state.values)
            left = anderson.change * min(max(anderson.rate, 0.05), 1.0)
            # Even temperatures change by nothing but what linear systems leave.
            enough = max(settled * size, full * np.abs(state.values).max())
            if tolerance <= full and (linear or left <= enough):
                return state
            # What a step changes is known to a thousandth; the last system is solved in full.
            share = anderson.change / max(size, anderson.change)
            tolerance = full if left <= enough else min(max(full, 1e-3 * share), loosest)
            guess = np.maximum(following, guess - 0.7 * (guess - floor))
        raise ConvergenceError(
            f"temperatures do not settle, they change by {anderson.change:.2g} of {size:.2g} after {most} "
            "systems: start from a state nearby, or make steps of the loads"
        )

    @property
    def _anderson(self) -> CautiousAnderson:
        """Steps are Newton's where films alone vary."""
        return CautiousAnderson(1 if self.scene.only_films_vary else 5)

    def _first(self, last: HeatState | None) -> np.ndarray:
        """Return temperatures from which to start: the last ones, those before, or held and ambient ones."""
        if last is not None:
            return last.values
        if self.rate.factor:
            return self.rate.before
        count, known = self.decomposition.tearing.n_nodes, [*self.scene.levels]
        return np.full(count, float(np.mean(known)) if known else 0.0)

    def _linear(
        self, guess: np.ndarray, last: HeatState | None, tolerance: float, counts: tuple[int, int]
    ) -> HeatState:
        """Solve the system linearised at temperatures. Collective."""
        problem, decomposition, timer = self.problem, self.decomposition, self.problem.timer
        touch = self.joints.touch(guess, self.given.pressure, self.given.gap)
        with together(decomposition.comm):
            conductance = self.joints.conductance(touch)
            friction = self.joints.friction(touch, self.given.work)
            if not self.rate.factor:
                require_temperatures(self.scene, self.joints, conductance)
        with timer.phase("assemble"), together(decomposition.comm):
            heated = tuple(self._heated(guess, friction))
        decomposition = problem.weighted(decomposition, heated)
        torn = self._torn(decomposition, heated, self.joints.rows(conductance), last)
        system = DualSystem(torn, timer, previous=None if last is None else last.system)
        with timer.phase("solve"):
            start = None
            warm = self.scene.is_linear or tolerance > problem.tolerance
            if warm and last is not None and last.torn.numbering is torn.numbering:
                start = last.solution.multiplier
            # The least residual that rounding leaves where films and storage hardly hold a subdomain.
            own = [each.subdomain.typical_stiffness / each.even.sum() for each in heated if each.even.any()]
            reachable = 4e-16 * decomposition.comm.allreduce(max(own, default=0.0), op=MPI.MAX)
            solution = solve_dual(system, ProjectedCG(tolerance=max(tolerance, reachable)), start)
            field = system.displacement(solution.multiplier, solution.alpha)
            products = counts[1] + system.products
            # Large temperatures that laws have found round its balance, too.
            if not warm or tolerance <= problem.tolerance < 100.0 * reachable:
                solution, field, more = refined(system, solution, field, heated, max(1e-4, reachable))
                products += more
        solved = Solved(self.scene, self.joints, heated, system, solution, field, conductance, friction)
        return solved.state(counts[0], products, timer.seconds)

    def _heated(self, guess: np.ndarray, friction: np.ndarray) -> Iterator[Heated]:
        tearing = self.decomposition.tearing
        rubbed = self.joints.at_nodes(friction)
        for number, assembly in enumerate(self.problem._assemblies):
            name = assembly.part.mesh.body
            first = tearing.first_of(name)
            own = slice(first, first + self.scene.bodies[name].mesh.n_nodes)
            rate = Rate(self.rate.factor, self.rate.before[own], self.rate.history)
            yield assembly.heated(self.scene, guess[own], rate, number, rubbed[own])

    def _torn(
        self,
        decomposition: Decomposition,
        heated: tuple[Heated, ...],
        joints: tuple[ConductingRows, ConductingRows],
        last: HeatState | None,
    ) -> TornSystem:
        """Return the torn system. Collective."""
        scene, comm = self.scene.field, decomposition.comm
        prescribed, _ = once_a_machine(comm, lambda: prescribed_along(scene, decomposition.tearing))
        with together(comm):
            require_agreement_across_ties(self.scene, self.joints, prescribed[:, 0])
        none = join_points([], scene.dim, decomposition.tearing.n_nodes)
        groups = with_contact(scene, decomposition, joints, none, prescribed)
        if last is None:
            rows = numbered(groups, decomposition, None)
        else:
            rows = _numbered_as(last.torn, groups, decomposition)
        free = free_motions(scene, decomposition.tearing)
        subdomains = tuple(each.subdomain for each in heated)
        return at_rest(scene, decomposition, subdomains, rows, prescribed, free)


def _numbered_as(known: TornSystem, groups: RowGroups, decomposition: Decomposition) -> NumberedRows:
    """Return rows numbered as known ones. Collective.

    B stays the same object where rows do, which marks F as unchanged, too.
    """
    alike = known.decomposition is decomposition
    joints = (each.of(ConductingRows) for each in (groups, known.groups))
    alike = alike and all(map(ConductingRows.act_as, *joints))
    if decomposition.comm.allreduce(int(not alike)):
        return numbered(groups, decomposition, known.numbering)
    return NumberedRows(groups, known.numbering, known.B)


@collectively("solve_heat", lambda scene, comm, **_: comm)
@naming_arguments
def solve_heat(
    scene: HeatScene,
    comm: MPI.Comm,
    *,
    partitions: Mapping[str, np.ndarray] | None = None,
    tolerance: float = 1e-11,
) -> HeatState:
    """Compute the steady temperatures of a scene. Collective on ``comm``.

    Args:
        scene: Bodies that conduct, what heats and cools them, and where heat passes between them.
        comm: Communicator over which the subdomains are spread.
        partitions: Body name -> subdomain of every cell, numbered from 0 within the body; None cuts the
            bodies into subdomains of a suitable size.
        tolerance: Largest relative residual of linear systems.

    Raises:
        InvalidInputError: If a law gives something that is no conductance, conductivity or capacity.
        InfeasibleError: If nothing gives a temperature to a body.
        ConvergenceError: If a solver, or the iteration of laws that depend on temperatures, does not settle.

    Example:
        >>> warm = solve_heat(scene, MPI.COMM_WORLD)  # doctest: +SKIP
        >>> warm.temperature["upper"].max()  # doctest: +SKIP
    """
    problem = HeatProblem(scene, comm, partitions=partitions, tolerance=tolerance)
    warn_of(odd_values(scene), comm)
    state = problem.solve()
    warn_of(blocked(state), comm)
    return state
