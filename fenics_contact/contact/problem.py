"""The entry point: from a scene to its equilibrium, and on to the next load, geometry or slip."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from fenics_contact._libraries import MPI, check_not_forked
from fenics_contact.contact.contact_doubts import ContactWarnings
from fenics_contact.contact.deformed_state import AnyState
from fenics_contact.contact.equilibrium import (
    default_solver,
    direct_state,
    dual_state,
    known_system,
    state_of,
)
from fenics_contact.contact.passing_bodies import PassingBodies
from fenics_contact.contact.state import State
from fenics_contact.contact.static_admissibility import check_held
from fenics_contact.contact.stored import restored_solution
from fenics_contact.contact.stored_rows import Stored, with_stored_slip
from fenics_contact.contact.tolerance import Tolerance, checked_tolerance
from fenics_contact.contact.turned_bodies import TurnedBodies
from fenics_contact.display import displayed
from fenics_contact.errors import InvalidInputError, collectively, together
from fenics_contact.feti import (
    Decomposition,
    DualSystem,
    TornSystem,
    build_torn_system,
    check_apart,
    check_same_input,
    decompose,
)
from fenics_contact.qp import DualSolver
from fenics_contact.scene import (
    Load,
    LoadStep,
    MovingObstacle,
    RigidSurface,
    Scene,
    SolverKind,
    choose_solver,
)
from fenics_contact.timing import PhaseTimer

if TYPE_CHECKING:
    from fenics_contact.contact.deformed_equilibria import DeformedEquilibria
    from fenics_contact.nonlinear import AutomaticSteps


@displayed
class ContactProblem:
    """Successive equilibria of a scene; each starts from the one before.

    What a change does not affect (topology, numbering, matrices, factors, contact points) is not recomputed,
    and the solver starts from the last contact forces. `LoadSequence` and `ShapeProblem` are built on it.

    Attributes:
        scene: The scene as it was given.
        comm: Communicator over which the subdomains are spread.
        solver: Dual solver with its tolerance; None: the one that `Scene.plan` names.
        tolerance: Largest relative residual of the solutions, see `solve_scene`.
        steps: How loads on nonlinear materials are followed; None: the default
            `fenics_contact.nonlinear.AutomaticSteps`.
        timer: Wall time of this rank by phase, over all solutions.
        state: The last solution, None before the first.

    Example:
        >>> equilibria = ContactProblem(scene, comm, tolerance=1e-6)  # doctest: +SKIP
        >>> first, again = equilibria.solve(), equilibria.solve(scene)  # doctest: +SKIP
    """

    def __init__(
        self,
        scene: Scene,
        comm: MPI.Comm,
        *,
        partitions: Mapping[str, np.ndarray] | None = None,
        solver: DualSolver | None = None,
        tolerance: Tolerance = None,
        steps: AutomaticSteps | None = None,
    ) -> None:
        """Prepare; nothing is computed yet. Arguments as for `solve_scene`."""
        self.scene, self.comm = scene, comm
        self.solver, self.tolerance, self.steps = solver, tolerance, steps
        self.timer = PhaseTimer()
        self.state = None
        self._partitions, self._decomposition = partitions, None
        self._contact_doubts, self._turned = ContactWarnings(), TurnedBodies()
        self._passing_bodies = PassingBodies()

    state: AnyState | None
    _decomposition: Decomposition | None
    _deformed_equilibria: DeformedEquilibria | None = None

    def _facts(self) -> dict[str, Any]:
        return {
            "scene": {name: body.in_words for name, body in self.scene.bodies.items()},
            "ranks": self.comm.size,
            "solver": "that of the scene's plan" if self.solver is None else self.solver,
            "tolerance": "by default" if self.tolerance is None else self.tolerance,
            "state": "none yet" if self.state is None else self.state.contact,
            "seconds": self.timer.seconds,
        }

    @property
    def partitions(self) -> Mapping[str, np.ndarray]:
        """Body name -> subdomain of every cell, numbered from 0 within the body. Collective on first use."""
        if self._partitions is None:
            with together(self.comm):
                self._partitions = self.scene.partition(self.comm.size)
        return self._partitions

    @property
    def decomposition(self) -> Decomposition:
        """The subdomains of the scene. Collective on first use."""
        return self._decomposed(self.scene)

    def _decomposed(self, scene: Scene) -> Decomposition:
        """Return the subdomains, those of the first scene solved: its supports fix some nodes."""
        if self._decomposition is None:
            with self.timer.phase("decompose"):
                self._decomposition = decompose(scene, self.partitions, self.comm)
        return self._decomposition

    @classmethod
    def following(
        cls,
        state: AnyState,
        *,
        solver: DualSolver | None = None,
        tolerance: Tolerance = None,
        steps: AutomaticSteps | None = None,
    ) -> ContactProblem:
        """Return the problem whose last solution is the given state, with its subdomains."""
        decomposition = state.torn.decomposition
        problem = cls(
            state.scene, decomposition.comm,
            partitions=decomposition.partitions, solver=solver, tolerance=tolerance, steps=steps,
        )  # fmt: skip
        problem._decomposition, problem.state = decomposition, state
        return problem

    def on(self, scene: Scene, partitions: Mapping[str, np.ndarray] | None = None) -> ContactProblem:
        """Return the problem of a scene on other meshes, solved alike; what was told is not told again."""
        other = ContactProblem(
            scene, self.comm,
            partitions=partitions, solver=self.solver, tolerance=self.tolerance, steps=self.steps,
        )  # fmt: skip
        other._contact_doubts, other._turned = self._contact_doubts, self._turned
        other._passing_bodies = self._passing_bodies
        return other

    def number(self, scene: Scene | None = None) -> float:
        """Return the tolerance as a number, for states that are differentiated or compared. Collective.

        Where none is given, or `BalancedTolerance`, which leaves the status of points uncertain, it is that
        of the solver: of the one given, of Newton's method, or of the one that the scene's plan names.

        Args:
            scene: As for `solve`.
        """
        scene = self.scene if scene is None else scene
        with together(self.comm):
            given = checked_tolerance(self.tolerance)
        if isinstance(given, float):
            return given
        if scene.is_nonlinear:
            from fenics_contact.nonlinear import AutomaticSteps

            return (self.steps or AutomaticSteps()).newton.tolerance
        if self.solver is not None:
            return self.solver.tolerance
        count = self._decomposed(scene).tearing.n_subdomains
        return default_solver(choose_solver(scene, count, sensitivity=True)).tolerance

    @collectively("ContactProblem.check_apart", lambda self, *_, **__: self.comm)
    def check_apart(self, scene: Scene) -> None:
        """Refuse a scene whose bodies overlap before they are loaded, unless a pair says so. Collective.

        Raises:
            InvalidInputError: Names the pair, the number of nodes and the depth.
        """
        check_apart(scene, self._decomposed(scene))

    @collectively("ContactProblem.overlaps", lambda self, *_, **__: self.comm)
    def overlaps(self, state: State) -> tuple[str, ...]:
        """Return words about surfaces that overlap before they are loaded and are pressed apart. Collective.

        Of nonlinear materials, none.
        """
        return () if state.scene.is_nonlinear else self._contact_doubts.overlaps(state)

    @collectively("ContactProblem.solve", lambda self, *_, **__: self.comm)
    def solve(
        self,
        scene: Scene | None = None,
        *,
        start: State | Literal["last"] | None = "last",
        slip_from: State | None = None,
        tolerance: Tolerance = None,
        overlap: bool = False,
        sensitivity: bool = False,
        time: float = 1.0,
        step: LoadStep | None = None,
    ) -> AnyState:
        """Compute an equilibrium. Collective.

        Args:
            scene: The scene with other loads, values of supports or coordinates; None: the original one.
            start: State of a neighbouring geometry or load to start from, None for that from which slip is
                measured, or none.
            slip_from: State from which slip is measured, that of the last load step; by default the
                undeformed state.
            tolerance: Overrides the problem's tolerance.
            overlap: Whether bodies may overlap before they are loaded, as those of a design do.
            sensitivity: Whether derivatives of the state are wanted; they need the dual system, and the
                default tolerance is then a number.
            time: Time of the equilibrium, for obstacles that move (`MovingObstacle`) and materials that
                creep.
            step: The load step, of whose functions of time a load of which parts are followed has the values
                in between.

        Raises:
            InvalidInputError: If scene or partition cannot be used, or supports hold other components than
                those of the scene that was solved first.
            InfeasibleError: If nothing holds some body against its load.
            ConvergenceError: If the solver does not reach its tolerance; the last solution stays unchanged.
        """
        check_not_forked()
        scene = self.scene if scene is None else scene
        with together(self.comm):
            _require_obstacles_at(scene, time)
        wanted = self.tolerance if tolerance is None else tolerance
        with together(self.comm):
            wanted = checked_tolerance(wanted)
        if scene.is_nonlinear:
            if self.solver is not None:
                raise InvalidInputError(
                    f"dual solvers are for linear materials, this scene has others, got {self.solver!r}: "
                    "give steps=AutomaticSteps(TangentNewton(...)) of fenics_contact.nonlinear instead"
                )
            self.state = self._equilibria(scene).solve(scene, slip_from, wanted, time, step, overlap=overlap)
            self._passing_bodies.warn(self.state)
            return self.state
        previous = (self.state if start == "last" else start) or slip_from
        decomposition = self._decomposed(scene)
        check_same_input(self.comm, scene, solver=self.solver, tolerance=wanted)
        with together(self.comm):
            kind = choose_solver(scene, decomposition.tearing.n_subdomains, sensitivity=sensitivity)
        known = self._alike(scene, previous)
        with self.timer.phase("assemble"):
            torn = self._torn(scene, known, overlap)
            if slip_from is not None:
                earlier, moved = slip_from.torn, slip_from.torn_displacement
                torn = torn.with_slip_from(earlier.relative(moved), earlier.sliding(moved))
            same = known is not None and torn.points is known.torn.points
            if known is None or not same or _loads_of(torn.scene) != _loads_of(known.scene):
                check_held(torn)
        if self.solver is None and kind is SolverKind.DIRECT:
            self.state = direct_state(torn, known, self.timer)
            self._turned.tell(self.state)
            return self.state
        solver = self.solver or default_solver(kind)
        # Derivatives need the status of every contact point, which a balanced state leaves uncertain.
        if wanted is None and (self.solver is not None or sensitivity):
            wanted = solver.tolerance
        self.state = dual_state(torn, previous, known, solver, wanted, self.timer)
        if not (overlap and self._contact_doubts.asked):  # designs differ little from the first one
            with self.timer.phase("state"):
                self._contact_doubts.warn(self.state, overlap=overlap)
                self._turned.tell(self.state)
                self._passing_bodies.warn(self.state)
        return self.state

    def _equilibria(self, scene: Scene) -> DeformedEquilibria:
        """Return what finds equilibria of nonlinear materials. Collective on first use."""
        from fenics_contact.contact.deformed_equilibria import DeformedEquilibria

        equilibria = self._deformed_equilibria
        if equilibria is None or not scene.has_meshes_of(equilibria.scene):
            equilibria = DeformedEquilibria(
                scene, self._decomposed(scene), self.steps, self.timer, beside=equilibria
            )
            self._deformed_equilibria = equilibria
        return equilibria

    @collectively("ContactProblem.restore", lambda self, *_, **__: self.comm)
    def restore(self, stored: Stored, scene: Scene | None = None) -> AnyState:
        """Build a state from what `stored_state` returned: one product instead of a solve. Collective.

        Of nonlinear materials one factorisation.

        Args:
            stored: The arrays, from the same subdomains on any number of ranks.
            scene: The scene with coordinates, loads and supports of the state; None: the original one.

        Returns:
            The state; its multiplier is that of the stored one, its residuals are recomputed. The last
            solution stays unchanged: assign the state to `state` to continue from it.

        Raises:
            InvalidInputError: If the arrays are those of another system.
        """
        scene = self.scene if scene is None else scene
        if scene.is_nonlinear:
            return self._equilibria(scene).restored(stored, scene)
        if not stored:
            torn = self._torn(scene, self.state, overlap=True)
            return direct_state(torn, self.state, self.timer)
        with self.timer.phase("assemble"):
            torn = with_stored_slip(self._torn(scene, self.state, overlap=True), stored)
        system = DualSystem(torn, self.timer, previous=known_system(self.state))
        with self.timer.phase("state"):
            solution = restored_solution(system, stored)
            displacement = system.displacement(solution.multiplier, solution.alpha)
        return state_of(system, solution, displacement, self.timer)

    def _alike(self, scene: Scene, start: State | None) -> State | None:
        """Return the state to reuse: the last one if it has the scene's meshes, else the start."""
        if start is None or self.state is None:
            return start
        return self.state if scene.has_meshes_of(self.state.scene) else start

    def _torn(self, scene: Scene, previous: State | None, overlap: bool) -> TornSystem:
        return build_torn_system(
            scene,
            self._decomposed(scene),
            overlap=overlap,
            previous=None if previous is None else previous.torn,
        )


@collectively("solve_scene", lambda scene, comm, **_: comm)
def solve_scene(
    scene: Scene,
    comm: MPI.Comm,
    *,
    partitions: Mapping[str, np.ndarray] | None = None,
    solver: DualSolver | None = None,
    tolerance: Tolerance = None,
    steps: AutomaticSteps | None = None,
) -> AnyState:
    """Compute the equilibrium of a scene. Collective on ``comm``.

    Args:
        scene: Bodies, supports, loads and contact pairs, the same on every rank.
        comm: Communicator over which the subdomains are spread.
        partitions: Body name -> subdomain of every cell, numbered from 0 within the body; None lets
            `Scene.partition` cut the bodies into subdomains of a suitable size.
        solver: Dual solver with its tolerance; None: the one that `Scene.plan` names.
        tolerance: Largest relative residual of the solution, or an `accuracy.BalancedTolerance`, which
            solves as accurately as the mesh deserves. By default the solver's own, and without a solver
            balanced. Give a number, 1e-6 or less, where the status of single contact points matters, or small
            differences between states. Where materials are nonlinear a number, 1e-8 by default.
        steps: How loads on nonlinear materials are followed; None: the default
            `fenics_contact.nonlinear.AutomaticSteps`.

    Raises:
        InvalidInputError: If scene or partition cannot be used.
        InfeasibleError: If nothing holds some body against its load.
        ConvergenceError: If the solver does not reach its tolerance.

    Example:
        >>> state = solve_scene(scene, MPI.COMM_WORLD)  # doctest: +SKIP
        >>> parts = {"block": box_partition(mesh, (2, 1, 1))}  # doctest: +SKIP
        >>> state = solve_scene(scene, MPI.COMM_SELF, partitions=parts)  # doctest: +SKIP
    """
    problem = ContactProblem(
        scene, comm, partitions=partitions, solver=solver, tolerance=tolerance, steps=steps
    )
    return problem.solve()


def _require_obstacles_at(scene: Scene, time: float) -> None:
    """Refuse obstacles that have moved by a time where bodies with small displacements do not see it.

    Raises:
        InvalidInputError: They have.
    """
    if scene.deforms_much:
        return
    for pair in scene.contacts:
        if isinstance(pair.master, MovingObstacle) and not pair.master.is_where_it_was(time):
            raise InvalidInputError(
                f"with small displacements obstacles must stand still, but that of {pair.place} has moved by "
                f"time {time:g}: move the bodies against it by their supports, or give a body a material for "
                "large deformations"
            )


def _loads_of(scene: Scene) -> tuple[list[Load], list[RigidSurface]]:
    """Return the loads of a scene, and the rigid surfaces, at whose points loads act."""
    return list(scene.loads), [each for each in scene.supports if isinstance(each, RigidSurface)]
