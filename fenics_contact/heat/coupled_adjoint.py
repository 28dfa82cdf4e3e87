"""The mechanics of an adjoint of both fields: how a quantity depends on temperatures through it.

With temperatures T, mechanics finds forces and displacements m(T), and these give pressures, gaps and work to
the residual R of heat. Temperatures act on J − wᵀ R through m, by the adjoint of mechanics with that as its
objective. Both adjoints are solved in turn until they agree, as the fields are.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fenics_contact._equilibrium.outer_loops import outer_loops
from fenics_contact._equilibrium.problem import ContactProblem
from fenics_contact._equilibrium.steps import stored_state
from fenics_contact.design.adjoint import (
    Adjoint,
    LinearisedFace,
    WeakChoice,
    WeakPoints,
    linearise_face,
    on_owned,
    require_from_rest,
    state_error,
    with_jumps,
    with_slips,
)  # fmt: skip
from fenics_contact.design.contact_derivatives import bound_sensitivity
from fenics_contact.design.forms import ShapeForms
from fenics_contact.design.load_derivatives import thermal_work_by_temperature
from fenics_contact.design.objective import Objective, Partials, finite_partials, guarded_user_call
from fenics_contact.design.objectives import on_rows
from fenics_contact.design.sensitivity import adjoint_of
from fenics_contact.errors import InvalidInputError
from fenics_contact.feti.averages import nodal_mean_transposed
from fenics_contact.heat.interaction import Interaction, check_fit
from fenics_contact.heat.joints import Joints
from fenics_contact.heat.objectives import AtTemperatures, HeatObjective, NoMechanics
from fenics_contact.heat.problem import GivenContact
from fenics_contact.heat.properties import slope_of
from fenics_contact.heat.scene import HeatScene
from fenics_contact.heat.state import HeatState
from fenics_contact.qp.face_newton import ProjectedCG
from fenics_contact.results.deformed_state import AnyState
from fenics_contact.results.linear_state import LinearState, as_linear
from fenics_contact.results.state import Tolerance


@dataclass(frozen=True, eq=False)
class Mechanics(NoMechanics):
    """Mechanics at temperatures, with the forces of a state, and its adjoint.

    `problem`: whose last state is that one; `stored`: its forces; `state`: in balance with these forces,
    which is that of the scene to first order with `missing`; `gives`: to the points where heat passes;
    `by_given`, `partials`: of J − wᵀ R by that and by the state, with `adjoint` and the derivative
    `by_temperature` at all nodes of the heat.
    """

    interaction: Interaction
    problem: ContactProblem
    stored: Mapping[str, np.ndarray]
    state: LinearState
    linearised: LinearisedFace
    forms: ShapeForms
    gives: GivenContact
    by_given: GivenContact
    partials: Partials
    adjoint: Adjoint
    by_temperature: np.ndarray  # type: ignore[assignment]

    is_fixed = False

    @classmethod
    def of(
        cls, interaction: Interaction, known: AnyState, values: np.ndarray, tolerance: Tolerance
    ) -> Mechanics:
        """Solve mechanics at steady temperatures of all nodes, from a known state. Collective."""
        linear = as_linear(known, "adjoints of heat and mechanics")
        if loops := outer_loops(interaction.scene):
            raise InvalidInputError(
                "adjoints of heat and mechanics need contacts whose laws no outer iteration changes, got "
                f"{[type(each).__name__ for each in loops]}: leave them out"
            )
        require_from_rest(linear)
        first = ContactProblem.following(linear, tolerance=tolerance)
        first.defer_warnings()  # solve_heated has given them
        state = as_linear(first.solve(interaction.heated(values), adjoint=True), "adjoints")
        problem = ContactProblem.following(state, solver=ProjectedCG())  # never directly, without multipliers
        multiplier = np.zeros_like(state.solution.multiplier)
        none = Adjoint(np.zeros_like(state.torn_displacement), multiplier, 0.0 * state.dual_solution.alpha, 0)
        face = linearise_face(state, WeakChoice.RELEASED)
        gives = interaction.given(_on_face(state, face))
        return cls(
            interaction, problem, stored_state(state), state, face, ShapeForms.at_rest(state.torn),
            gives, gives, Partials.of(state, 0.0), none, np.zeros_like(values),
        )  # fmt: skip

    @property
    def weak(self) -> WeakPoints:  # type: ignore[override]
        """Contact points that only just touch, or are about to slip."""
        return self.linearised.weak

    @property
    def missing(self) -> float:  # type: ignore[override]
        """What J − wᵀ R misses at forces that are not in equilibrium, and what these give. Collective.

        To first order, on the side of kinks where `gives` is.
        """
        coarse = self.state.dual.problem.coarse
        unbalanced = self.adjoint.motions * coarse.residual(self.state.solution.multiplier)
        error = state_error(self.state, self.partials, self.linearised, self.adjoint, unbalanced)
        by, now, then = (vars(x) for x in (self.by_given, self.interaction.given(self.state), self.gives))
        return error.correction + sum(float(by[name] @ (now[name] - then[name])) for name in by)

    def of_scenes(self, scenes: Any) -> tuple[HeatScene, Mechanics]:
        """Return those of a pair of scenes, mechanics and heat."""
        scene, heat = scenes
        check_fit(scene, heat, self.interaction.cold)
        return heat, replace(self, interaction=replace(self.interaction, scene=scene, heat=heat))

    def at(self, values: np.ndarray, joints: Joints) -> Mechanics:
        """Return mechanics with the forces of the state at temperatures of all nodes. Collective."""
        if joints.points.count != len(self.gives.gap):
            raise InvalidInputError(
                f"derivatives need the same points of contact, {len(self.gives.gap)}, got "
                f"{joints.points.count} after a step: take a smaller step, or other nodes as slaves"
            )
        interaction = replace(self.interaction, joints=joints)
        state: Any = self.problem.restore(self.stored, interaction.heated(values))
        return replace(self, interaction=interaction, state=_on_face(state, self.linearised))

    def given(self, joints: Joints) -> GivenContact:
        """Return what the state gives."""
        return self.gives

    def check(self, at: AtTemperatures, state: HeatState, quantity: HeatObjective) -> None:
        """Reject quantities of mechanics that depend on temperatures themselves. Collective."""
        torn, warmer = self.state.torn, self.interaction.heated(at.values + np.ptp(at.values) + 1.0)
        other = replace(self, state=replace(self.state, torn=replace(torn, scene=warmer)))
        for objective in quantity.of_mechanics:
            value = self.value(objective)
            if not abs(other.value(objective) - value) <= 1e-9 * abs(value):  # von Mises stresses pass
                raise InvalidInputError(
                    "an adjoint through both fields needs a quantity of forces and displacements, got "
                    f"{type(objective).__name__}, which temperatures change, too: take forces or Movement"
                )

    def value(self, objective: Objective) -> float:
        """Return a quantity of mechanics. Collective."""
        with guarded_user_call(self.state.torn.decomposition.comm):
            return objective.value(self.state, self.forms)

    def following(self, at: AtTemperatures, quantity: HeatObjective, w: np.ndarray) -> Mechanics:
        """Solve its adjoint of J − wᵀ R. Collective."""
        _, passing, residual = quantity.partials(at)
        by, start = at.by_given(passing, residual - w), self.adjoint.multiplier
        partials = self._partials(quantity, by)
        adjoint, _, partials = adjoint_of(self.state, partials, self.linearised, 1e-11, start)
        total = self._by_friction(at, partials, adjoint)
        for load in self.interaction.strains(at.values):
            first, torn = self.interaction.tearing.first_of(load.body), self.state.torn
            by_nodes = thermal_work_by_temperature(self.forms, torn, load, adjoint.displacement)
            total[first : first + len(by_nodes)] += by_nodes
        return replace(self, by_given=by, partials=partials, adjoint=adjoint, by_temperature=total)

    def _partials(self, quantity: HeatObjective, by: GivenContact) -> Partials:
        """Return the derivatives by forces and displacements, also through what they give. Collective."""
        state, interaction, torn, contact = self.state, self.interaction, self.state.torn, self.state.contact
        points, lost = interaction.joints.points, interaction.lost(state)
        by_pressure, by_gap, by_lost = np.zeros((3, contact.points.count))
        apart = by.gap.copy()
        for _, place, mine, onto in interaction.means(state):
            by_pressure += onto.T @ by.pressure[mine]
            by_gap += onto.T @ by.gap[mine]
            apart[mine[onto.getnnz(axis=1) > 0]] = 0.0
            density, area = onto @ (lost / contact.nominal_area), interaction.joints.area[mine]
            if density.any():  # w = ŵ W / (A · ŵ), see `Interaction.given`
                pressed, total = contact.on_pair(place), density @ area
                share = by.work[mine] @ density / total
                change = lost[pressed].sum() / total * (by.work[mine] - share * area)
                by_lost += onto.T @ change / contact.nominal_area
                by_lost[pressed] += share
        by_lost = by_lost * (lost > 0.0) / interaction.duration
        by_gap[contact.normal_force > 0.0] = 0.0
        own = [finite_partials(each.partials(state, self.forms)) for each in quantity.of_mechanics]
        partials = next(iter(own), Partials.of(state, 0.0))
        forces = on_rows(state, by_pressure / contact.nominal_area, by_lost[:, None] * contact.slip)
        moved = points.on_nodes(apart[:, None] * points.normal)
        moved = np.pad(moved, ((0, 0), (0, torn.components - moved.shape[1])))
        moved = nodal_mean_transposed(torn.decomposition, interaction.nodes_in(state), moved)
        partials = with_slips(state, partials, by_lost[:, None] * contact.friction_force)
        partials = with_jumps(state, partials, on_owned(torn, torn.normal_rows, -by_gap))
        by_displacement = partials.by_displacement + moved
        return replace(
            partials, by_displacement=by_displacement, by_multiplier=partials.by_multiplier + forces
        )

    def _by_friction(self, at: AtTemperatures, partials: Partials, adjoint: Adjoint) -> np.ndarray:
        """Return the derivative by temperatures through friction that depends on them, (n_nodes,)."""
        torn, contact, joints = self.state.torn, self.state.contact, self.interaction.joints
        by_bound = bound_sensitivity(torn, partials.by_multiplier, adjoint.displacement, self.linearised)
        force, by_coefficient = contact.normal_force[torn.frictional], np.zeros(contact.points.count)
        by_coefficient[torn.frictional] = by_bound * force * ~torn.groups.slips.strength.limited(force)
        by_mean, places = np.zeros(joints.points.count), torn.scene.points[torn.points.slave]
        for number in self.interaction.rubbing:
            near, mean = self.interaction.between(number, at.values)
            mine = np.flatnonzero(torn.points.pair == self.interaction.pairs[number])
            table: Any = self.interaction.laws[number].coefficient
            here = near(places[mine])
            np.add.at(by_mean, here, by_coefficient[mine] * slope_of(table.at, mean)[here])
        of_master = np.where(joints.on_obstacle, 0.0, by_mean)
        return 0.5 * np.asarray(joints.points.own.T @ by_mean + joints.points.master.T @ of_master)


def _on_face(state: LinearState, linearised: LinearisedFace) -> LinearState:
    """Return a state without forces at points that its face has open: they only just touch. Collective."""
    torn, contact, closed = state.torn, state.contact, np.zeros(state.torn.layout.size)
    closed[torn.layout.normal] = linearised.face.closed
    force = contact.normal_force * torn.numbering.gather(closed, torn.normal_rows)
    return replace(state, contact=replace(contact, normal_force=force))
