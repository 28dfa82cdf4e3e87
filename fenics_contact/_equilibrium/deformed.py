"""Equilibria of scenes with nonlinear materials: found along a path of loads, each with its history."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import astuple, dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from fenics_contact._base.progress import PhaseTimer
from fenics_contact._equilibrium.between_nodes import InsideFacets, needed_nodes_on_obstacles, with_places
from fenics_contact._equilibrium.carried import TransferredState
from fenics_contact._equilibrium.other_rows import prescribed_as_is
from fenics_contact._equilibrium.outer_loops import outer_loops
from fenics_contact._equilibrium.previous import ONLY_STEP, AfterTransfer, Previous, Undeformed, Wanted
from fenics_contact._equilibrium.starts import CoarseStart
from fenics_contact._equilibrium.static_admissibility import (
    check_held,
    require_resisted,
    unresisted_in_words,
    unresisted_motions,
)
from fenics_contact._equilibrium.stored import Stored, require_rows, require_shape, with_stored_slip
from fenics_contact._equilibrium.warnings import advice
from fenics_contact._fem.mechanics import History
from fenics_contact._large_deformations.equations import (
    Configuration,
    Equations,
    Linearisation,
    ResidualState,
)
from fenics_contact._large_deformations.load_steps import AutomaticSteps, Near, Path, PathEndsError, Snap
from fenics_contact._large_deformations.loading import Loading
from fenics_contact._large_deformations.moving_contact import Contact
from fenics_contact._large_deformations.newton import Effort, NonlinearEquilibrium, NotHeldError
from fenics_contact._large_deformations.rigid_surfaces import driven_further
from fenics_contact._pairing.inside import InFacets
from fenics_contact._scene.local_axes import free_part
from fenics_contact._scene.scene import LoadStep, Scene
from fenics_contact.errors import ConvergenceError, InfeasibleError, InvalidInputError, LoadStepError
from fenics_contact.errors.kinds import safe_log
from fenics_contact.feti.averages import nodal_mean_transposed, nodal_sum
from fenics_contact.feti.carried import carried_over
from fenics_contact.feti.decomposition import Decomposition
from fenics_contact.feti.torn import TornSystem, contacts_alike
from fenics_contact.materials.plastic import has_history
from fenics_contact.qp.reductions import global_sum
from fenics_contact.qp.solution import Solution
from fenics_contact.results.contact import ContactResult
from fenics_contact.results.deformed_state import DeformedState, row_values_at
from fenics_contact.results.dual_solve import contact_result, worn_by
from fenics_contact.results.rigid_motions import UnheldMotion
from fenics_contact.results.state import Energies, State

if TYPE_CHECKING:
    from fenics_contact._pairing.sliding.points import SlidingPoints


_LOG = logging.getLogger(__name__)


class DeformedEquilibria:
    """Successive equilibria of a scene with nonlinear materials, on the subdomains of one decomposition."""

    def __init__(
        self,
        scene: Scene,
        decomposition: Decomposition,
        steps: AutomaticSteps | None,
        timer: PhaseTimer,
        assembled: TornSystem | None = None,
    ) -> None:
        """Prepare the forms of all materials. Collective."""
        _require_elastic(scene)
        self.scene, self._steps = scene, steps or AutomaticSteps()
        self.decomposition, self._timer = decomposition, timer
        self._equations = Equations(scene, decomposition)
        self.assembled = assembled
        self._unresisted: tuple[UnheldMotion, ...] | None = None
        self._places = InFacets.none(scene.dim)

    def solve(self, scene: Scene, previous: Previous, wanted: Wanted, most: int = 4) -> DeformedState:
        """Compute the equilibrium of a scene. Collective."""
        places = _places_of(previous.before.here, scene.dim)
        inside, state = InsideFacets(scene.dim, on_the_way=bool(previous.last)), None
        overlap = wanted.design or previous.start.is_coarser
        for _ in range(1 + (0 if overlap else most)):
            self._put_inside(places)
            try:
                state = self._solve(scene, previous, wanted)
            except LoadStepError as failure:
                if not len(places.point):
                    raise
                safe_log(_LOG.info, "points inside facets have no equilibrium near: %s", failure)
                break
            found = inside.after(state, needed_nodes_on_obstacles(state))
            if found is None:
                return state
            places = found.by_key(state.contact.points)
        if state is None:
            self._put_inside(InFacets.none(scene.dim))
            return self._solve(scene, previous, wanted)
        self._put_inside(_places_of(state, scene.dim))
        return state

    def _put_inside(self, places: InFacets) -> None:
        """Put points inside facets of slaves, by key, all others at nodes."""
        self._places = places
        self._equations.contact.put_inside(places)

    def _solve(self, scene: Scene, previous: Previous, wanted: Wanted) -> DeformedState:
        equations, timer, before = self._equations, self._timer, previous.last
        steps = _as_accurate_as(wanted, self._steps)
        contact, loops = equations.contact, outer_loops(scene)
        contact.feedbacks = sum((loop.feedback(contact, before, steps) for loop in loops), start=())
        with timer.phase("assemble"):
            start = self._start(scene, previous)
        self._require_later(scene, start.time, wanted.time)
        with timer.phase("assemble"):
            overlap = wanted.design or previous.start.is_coarser
            load = self._loading(scene, wanted.time, wanted.step, overlap)
            acted, load = start.loads(load, equations.contact)
            if self._unresisted is None:  # supports stay what they are in later steps
                self._unresisted = unresisted_motions(load.torn, scene.foundations)
            require_resisted(self._unresisted, load.torn, load.prescribed)
            begin = start.configuration(equations, acted)
        try:
            near = self._near(load, previous)
            path = steps.follow(
                equations, acted, load, begin, timer, start.known, held=not self._unresisted, near=near
            )
        except (InfeasibleError, NotHeldError) as failure:
            if not self._unresisted:
                _require_more_than_springs(load.torn, failure)
                raise
            raise InfeasibleError(unresisted_in_words(self._unresisted)) from failure
        except PathEndsError as failure:
            _require_more_than_springs(load.torn, failure)
            last = None if failure.path is None else _state_after(failure.path, previous, timer, steps)
            words = f"{wanted.where}{failure}{advice(scene, last or before)}"
            raise LoadStepError(words, failure.history, last) from failure
        return _state_after(path, previous, timer, steps)

    def _start(self, scene: Scene, previous: Previous) -> _FromRest | _FromState:
        """Return where a load step begins. Collective."""
        before = previous.last
        if not isinstance(before, DeformedState):
            return _FromRest()
        if isinstance(previous.before, AfterTransfer):
            return _FromState(before, *self._on_meshes_of(scene, before, previous.before.before), None)
        same = before.torn.decomposition is self.decomposition
        same = same and self._places.are_those_of(_places_of(before, scene.dim))
        if not (same and contacts_alike(scene, before.scene)):
            return _FromState(before, *self._held_otherwise(scene, before), None)
        end = before.equilibrium
        return _FromState(before, before.load, end.configuration, end.linearisation)

    def _near(self, load: Loading, previous: Previous) -> Near | None:
        """Return how Newton's method begins on refined meshes; None where equilibria depend on the way there.

        Rigid surfaces turn along their arcs, fluid goes on, and slip begins where nodes are first found.
        """
        steps, coarse = self._steps, previous.start
        by_way = load.turned or previous.last or outer_loops(load.torn.scene)
        if not isinstance(coarse, CoarseStart) or by_way or steps.snaps or steps.finer_history:
            return None

        def near(load: Loading, at: Configuration) -> Configuration:
            moved = coarse.displacement(load.torn)
            there = self._equations.contact.anew(load, moved, at.contact)
            if there.slip_start is not at.contact.slip_start:
                raise ConvergenceError("nodes are first found on the way")
            forces = coarse.at_contact(there.torn)
            found = replace(at, displacement=moved, multiplier=forces, contact=there)
            return _balanced(self._equations.evaluate_at(load, found))

        return near

    def serves(self, scene: Scene, decomposition: Decomposition) -> bool:
        """Return whether a scene has the meshes, the held components and the contact pairs of these."""
        same = self.decomposition is decomposition and scene.has_meshes_of(self.scene)
        return same and contacts_alike(scene, self.scene)

    def restored(self, stored: Stored, scene: Scene, known: State | None = None) -> DeformedState:
        """Build a state from what `stored_deformed` returned, with one factorisation. Collective."""
        timer, equations = self._timer, self._equations
        self._put_inside(InFacets.restored(stored, scene.dim))
        contact, loops = equations.contact, outer_loops(scene)
        contact.feedbacks = sum((loop.stored_feedback(contact, stored) for loop in loops), start=())
        with timer.phase("assemble"):
            load = whole = self._loading(scene, float(stored["times"][1]))
            at, load = stored_configuration(stored, load, equations.contact, self.decomposition)
            evaluation = equations.evaluate_at(load, at)
        near = evaluation.linearised(timer, None)
        evaluation = equations.evaluate_at(load, near.of(evaluation).at)
        end = NonlinearEquilibrium(evaluation, near, Effort(factorisations=1))
        fractions = tuple(map(float, stored["parts"]))
        rows = stored.get("snaps", ())
        snaps = tuple(Snap(fraction, way, work, int(stages)) for fraction, way, work, stages in rows)
        since = float(stored.get("since", 0.0))
        earlier_friction_work = float(stored.get("rubbed", 0.0))
        start = at.contact.slip_start
        path = Path(whole, end, None, start, fractions, since, snaps, earlier_friction_work, end.effort)

        def slipped(contact: ContactResult) -> ContactResult:
            slip, before = stored.get("slip", (contact.slip, contact.slip_before))
            return worn_by(replace(contact, slip=slip, slip_before=before), at.contact.torn)

        return _state_of(path, timer, slipped, None)

    def _require_later(self, scene: Scene, earlier: float, time: float) -> None:
        materials = [each for body in scene.bodies.values() for each in body.materials]
        if time < earlier and any(has_history(each) for each in materials):
            raise InvalidInputError(
                f"with material histories time must not decrease, got {time:g} after {earlier:g}: give later"
            )

    def _on_meshes_of(
        self, scene: Scene, before: DeformedState, carried: TransferredState
    ) -> tuple[Loading, Configuration]:
        """Return what acted in a state on other meshes and where it ended, on a scene's. Collective."""
        acted = self._loading(carried.scene_on(scene), before.time, overlap=True)
        at, moved = before.equilibrium.configuration, carried.fields.displacement(acted.torn)
        contact = self._equations.contact.first(acted, moved)
        kept = before.history.carried(before.scene, scene, carried.transfers).values
        was = before.torn_displacement
        squares = global_sum(self.decomposition.comm, was @ was, moved @ moved)
        # Sizes of displacements are sums over nodes, of which there are others now.
        grown = float(np.sqrt(squares[1] / squares[0])) if squares[0] > 0.0 else 1.0
        history = tuple(
            kept[mesh.body][mesh.cells] if mesh.body in kept else None for mesh in self.decomposition.meshes
        )
        start = Configuration(
            displacement=moved,
            multiplier=carried.multiplier(contact.torn),
            history=history,
            time=at.time,
            largest=grown * at.largest,
            contact=contact,
            motions=at.motions,
        )
        return acted, _balanced(self._equations.evaluate_at(acted, start))

    def _held_otherwise(self, scene: Scene, before: DeformedState) -> tuple[Loading, Configuration]:
        """Return what acted in a state and where it ended, with supports and pairs of another. Collective.

        What supports carried that are released acts as forces of the state before: they fall to zero in the
        step.
        """
        places = [{(each.body, each.surface) for each in at.rigid_surfaces} for at in (before.scene, scene)]
        if new := sorted(places[1] - places[0]):
            raise InvalidInputError(
                "a RigidSurface must be there from the first step on, that on "
                f"{new[0][1]!r} of {new[0][0]!r} is new: give it before, with all components free"
            )
        pairs = [[(pair.slave, pair.master) for pair in each.contacts] for each in (before.scene, scene)]
        if scene.deforms_much and any(one != other for one, other in zip(*pairs, strict=False)):
            raise InvalidInputError(
                f"with large deformations steps may leave out the last pairs alone, got {len(pairs[1])} of "
                f"{len(pairs[0])}: give the scene's pairs in another order"
            )
        at = before.equilibrium.configuration
        acted = self._loading(
            replace(before.scene, supports=scene.supports, contacts=scene.contacts), before.time, overlap=True
        )
        was = prescribed_as_is(before.torn, at.displacement, self.decomposition)
        acted = acted.at_rest(was)
        contact = self._equations.contact.first(acted, at.displacement)
        forces = carried_over(at.contact.torn, at.multiplier, contact.torn)
        start = replace(at, multiplier=forces, diagonal=None, contact=contact.from_here(forces))
        evaluation = self._equations.evaluate_at(acted, start)
        freed = before.torn.decomposition.fixed.any(axis=1)
        nodes, axes = np.flatnonzero(freed), self.decomposition.axes
        carried = nodal_sum(self.decomposition, evaluation.unbalanced)[nodes]
        carried = free_part(carried, nodes, self.decomposition.fixed, axes)
        acted = acted.with_forces(-nodal_mean_transposed(self.decomposition, nodes, carried))
        return acted, _balanced(self._equations.evaluate_at(acted, start))

    def _loading(
        self, scene: Scene, time: float, step: LoadStep = ONLY_STEP, overlap: bool = False
    ) -> Loading:
        """Return what acts at a time. Collective."""
        load = Loading.of(scene, self.decomposition, time, self.assembled, step=step, overlap=overlap)
        self.assembled = load.torn
        if scene.deforms_much:
            return load
        return replace(load, torn=with_places(load.torn, self._places.by_number(load.torn.points)))


class _FromRest:
    """A load step of bodies at rest, without loads."""

    time = 0.0
    known = None

    def loads(self, load: Loading, contact: Contact) -> tuple[Loading, Loading]:
        """Return what acts at its start and its end. Collective."""
        check_held(load.torn)
        return load.removed(), load

    def configuration(self, equations: Equations, acted: Loading) -> Configuration:
        """Return the configuration at its start. Collective."""
        return equations.at_rest(acted)


@dataclass(frozen=True, eq=False)
class _FromState:
    """A load step after a state; `acted`: what acted there; `at`: where it ended."""

    before: DeformedState
    acted: Loading
    at: Configuration
    known: Linearisation | None

    @property
    def time(self) -> float:
        return self.at.time

    def loads(self, load: Loading, contact: Contact) -> tuple[Loading, Loading]:
        acted = self.acted
        if any(joint.draws for joint in load.torn.groups.joints):
            acted = begun_as(self.before, acted, load)
        return moved_as(self.at, acted, load, contact)

    def configuration(self, equations: Equations, acted: Loading) -> Configuration:
        return self.at


def _as_accurate_as(wanted: Wanted, steps: AutomaticSteps) -> AutomaticSteps:
    """Return load steps to the wanted tolerance, by default to their own."""
    tolerance = steps.newton.tolerance if wanted.tolerance is None else wanted.tolerance
    if not isinstance(tolerance, float):
        raise InvalidInputError(
            f"tolerances of nonlinear materials must be numbers, got {tolerance!r}: leave it out for 1e-8"
        )
    return replace(steps, newton=replace(steps.newton, tolerance=tolerance))


def _places_of(before: State | None, dim: int) -> InFacets:
    """Return the places inside facets of a state before, by key, none on other meshes."""
    if not isinstance(before, DeformedState):
        return InFacets.none(dim)
    return InFacets.of(before.contact.points).by_key(before.contact.points)


def _balanced(evaluation: ResidualState) -> Configuration:
    """Return a configuration whose gluing rows take what is out of balance. Collective."""
    at, torn = evaluation.at, evaluation.torn
    return replace(at, multiplier=at.multiplier + torn.gluing_of(evaluation.unbalanced))


def begun_as(before: DeformedState, acted: Loading, load: Loading) -> Loading:
    """Return the load of the state before with the unknowns of joints that are now, see `Joint.begun`.

    Collective.
    """
    now, torn, was = load.torn, acted.torn, before.torn
    jump = was.jump(before.torn_displacement)
    right, loads = np.full(torn.groups.total, np.nan), []
    for joint in torn.groups.joints:
        for earlier in was.groups.of(type(joint)):
            values = (was.gathered(each, earlier) for each in (jump, before.solution.multiplier))
            right[torn.groups.rows_of(joint)], forces = joint.begun(earlier, now.scene, *values)
            loads.append(forces)
    right = right[torn.numbering.owned]
    kept = np.where(np.isnan(right), torn.right, right)
    free = replace(now.free, load=np.concatenate(loads))
    return replace(acted, torn=replace(torn, right=kept, free=free))


def moved_as(at: Configuration, acted: Loading, load: Loading, contact: Contact) -> tuple[Loading, Loading]:
    """Return the load of the state before with the free components of rigid surfaces of now. Collective.

    Those that were held have the force that they transmitted, those that were free are held where they were.
    The load that is to act begins with the free components as they are.
    """
    if not (load.is_tracked or acted.is_tracked):
        return acted, load
    last = {each.place: each for each in acted.turned}
    turned = []
    for each in load.turned:
        known = last.get(each.place, each.at_rest)
        held = np.where(each.free, known.load, 0.0)
        motion = at.motions.get(each.place, np.zeros_like(each.motion))
        turned.append(replace(each, motion=motion, load=held))
    acted = acted.with_surfaces(tuple(turned))
    if load.is_tracked:
        there = acted.at_motions(at.motions)
        now = at.on(contact.at(there, at.displacement, at.contact))
        missing = now.contact.torn.free_imbalance(now.multiplier)
        acted = replace(acted, turned=driven_further(acted.turned, -missing))
    return acted, load.with_surfaces(tuple(each.at(at.motions) for each in load.turned))


def _require_more_than_springs(torn: TornSystem, failure: Exception) -> None:
    """Name motions that elastic foundations alone resist: Newton's method may need more. Collective."""
    alone = unresisted_motions(torn, ()) if torn.scene.foundations else ()
    if alone:
        raise InfeasibleError(
            f"Newton's method needs supports, ties or contacts beside elastic foundations, which alone hold "
            f"body {alone[0]}: support it there, or cut the body into fewer subdomains"
        ) from failure


def _require_elastic(scene: Scene) -> None:
    """Reject rigid tools on bodies that are nonlinear with small displacements."""
    if not scene.deforms_much and scene.tools:
        raise InvalidInputError(
            "a RigidTool needs linear materials or large deformations, got small ones that are nonlinear"
        )


def _state_after(path: Path, previous: Previous, timer: PhaseTimer, steps: AutomaticSteps) -> DeformedState:
    """Return the state at the end of a path from another state. Collective."""
    at = path.end.evaluation.contact
    before = previous.before if isinstance(previous.last, DeformedState) else Undeformed()

    def earlier_slip(points: SlidingPoints) -> np.ndarray:
        there, slip = before.slipped(path.begun)
        return there.slip_on(points, slip)

    def of_step(contact: ContactResult) -> ContactResult:
        moved = replace(contact, **at.of_step(contact.friction_force, path.start, earlier_slip))
        return worn_by(moved, at.torn)

    return _state_of(path, timer, of_step, steps.newton.tolerance)


def _state_of(
    path: Path, timer: PhaseTimer, slipped: Callable[[ContactResult], ContactResult], tolerance: float | None
) -> DeformedState:
    """Return the state at the end of a path; `slipped`: adds the slip of moved bodies. Collective."""
    end, evaluation = path.end, path.end.evaluation
    ended = f", at {path.fractions[-1]:.3g} of the load step" if path.fractions[-1] < 1.0 else ""
    values, torn, moved = row_values_at(end), evaluation.loaded, evaluation.at.displacement
    solution = Solution(
        multiplier=values.multiplier,
        residuals=evaluation.residuals,
        iterations=len(path.effort.history),
        products=path.effort.products,
        history=path.effort.history,
        reason=f"every residual is below the tolerance{ended}"
        if path.effort.history
        else "read from a checkpoint",
    )
    with timer.phase("state"):
        contact = slipped(contact_result(torn, values, moved))
        energies = _energies(evaluation, path.earlier_friction_work)
    return DeformedState(
        torn=torn, solution=solution, torn_displacement=moved, contact=contact, energies=energies,
        seconds=dict(timer.seconds), equilibrium=end, load=path.load, begun=path.begun,
        fractions=path.fractions, since=path.since, snaps=path.snaps, tolerance=tolerance,
        factorisations=path.effort.factorisations,
    )  # fmt: skip


def _energies(evaluation: ResidualState, earlier_friction_work: float) -> Energies:
    """Return the stored energy, the work of dead loads and of friction in the last load step. Collective.

    The work of pressures that follow their surfaces depends on the way: then it is not known.
    """
    stored = [np.nan if response.energy is None else response.energy for response in evaluation.responses]
    strain = float(evaluation.torn.numbering.comm.allreduce(float(np.sum(stored))))
    work = evaluation.growth.work(evaluation.torn, evaluation.at.displacement) + evaluation.torn.fluid.work
    turned = evaluation.load.turned
    strain += sum(0.5 * float(each.springs @ each.motion**2) for each in turned)
    work += sum(each.work for each in turned if each.free.any())
    given_way, kept = evaluation.torn.compliance.energies(evaluation.at.multiplier)
    surface = float(evaluation.torn.numbering.comm.allreduce(given_way - kept))
    return Energies(strain, work, earlier_friction_work + evaluation.friction_work, surface=surface)


def stored_deformed(state: DeformedState) -> dict[str, np.ndarray]:
    """Return the arrays from which a state can be rebuilt, on any number of ranks. Collective.

    Torn displacements, multipliers and histories come back bit for bit; normals and slip are found again, to
    their last places. Fields on whole bodies may differ by a part of the openings at interfaces, which are
    below the tolerance: they are spread inside subdomains by tangents at the equilibrium, before by those of
    the last Newton step. Returns ``displacement`` of all copies of the nodes, shape (n_copies, dim),
    ``multiplier`` λ of all rows, the ``history`` of materials of each body, with the time and the largest
    displacement, before the step of histories, the work of friction before it, and the ``parts`` and
    ``snaps``; of moved bodies the facets that nodes touch, where, and the slip; else ``origin`` and
    ``slid``, from which slip is measured. All replicated.
    """
    decomposition, evaluation = state.torn.decomposition, state.equilibrium.evaluation
    comm, tearing, at = decomposition.comm, decomposition.tearing, evaluation.at
    numbering, rows = evaluation.torn.numbering, np.arange(evaluation.torn.numbering.total)
    here, block = decomposition.held
    copies = np.zeros((len(tearing.copy_subdomain), tearing.components))
    copies[here] = at.displacement.reshape(-1, tearing.components)[block]
    stored: dict[str, np.ndarray] = {
        "displacement": np.asarray(comm.allreduce(copies)),
        "multiplier": numbering.gather(at.multiplier, rows),
        "times": np.array([at.time, state.equilibrium.time, at.largest]),
        "parts": np.array(state.fractions),
        "since": np.array(state.since),
        "rubbed": np.array(state.energies.friction - evaluation.friction_work),
        **{_stored_motion(place): motion for place, motion in at.motions.items()},
        "snaps": np.array([astuple(snap) for snap in state.snaps]),
    }
    pairs = zip(decomposition.meshes, at.history, strict=True)
    parts = [(mesh.body, mesh.cells, values) for mesh, values in pairs if values is not None]
    history = History.unloaded(state.scene).advanced(comm, parts)
    stored |= {f"history.{name}": values for name, values in history.values.items()}
    stored |= _places_of(state, state.scene.dim).stored()
    stored |= evaluation.contact.stored()
    for loop in outer_loops(state.scene):
        stored |= loop.stored(evaluation.contact.torn)
    if "origin" in stored:
        return stored
    return stored | {"slip": np.array([state.contact.slip, state.contact.slip_before])}


def stored_configuration(
    stored: Stored, load: Loading, contact: Contact, decomposition: Decomposition
) -> tuple[Configuration, Loading]:
    """Return the configuration of a stored state, with its contact points, and its load. Collective."""
    tearing = decomposition.tearing
    require_shape(stored, "displacement", (len(tearing.copy_subdomain), tearing.components))
    here, block = decomposition.held
    by_block = np.zeros((len(here), tearing.components))
    by_block[block] = stored["displacement"][here]
    displacement = by_block.ravel()
    history = tuple(
        stored[f"history.{mesh.body}"][mesh.cells] if f"history.{mesh.body}" in stored else None
        for mesh in decomposition.meshes
    )
    motions = {
        each.place: stored[_stored_motion(each.place)]
        for each in load.turned
        if _stored_motion(each.place) in stored
    }
    load = load.at_motions(motions)
    if "origin" in stored:
        load = replace(load, torn=with_stored_slip(load.torn, stored))
    found = contact.found_again(load, displacement, stored)
    require_rows(found.torn, stored)
    begin, _, largest = stored["times"]
    multiplier = stored["multiplier"][found.torn.numbering.owned]
    configuration = Configuration(displacement, multiplier, history, float(begin), float(largest), found)
    return replace(configuration, motions=load.motions), load


def _stored_motion(place: tuple[str, str]) -> str:
    """Return the name of the stored motion of a rigid surface."""
    return f"motion.{place[0]}.{place[1]}"
