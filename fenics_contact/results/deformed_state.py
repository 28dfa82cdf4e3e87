"""The state of bodies with nonlinear materials, and how Newton's method ended in its load steps."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from fenics_contact._base.display import displayed
from fenics_contact.errors import collectively
from fenics_contact.materials.plastic import has_history
from fenics_contact.qp.solution import Solution, contact_step
from fenics_contact.results.contact import RowValues
from fenics_contact.results.fields import put_history_stress, von_mises_of
from fenics_contact.results.forces import NodalForces, Resultant, nodal_forces
from fenics_contact.results.linear_state import LinearState
from fenics_contact.results.state import State, comm_of

if TYPE_CHECKING:
    import dolfinx

    from fenics_contact._fem.mechanics import History, Response
    from fenics_contact._large_deformations.load_steps import Snap
    from fenics_contact._large_deformations.loading import Loading
    from fenics_contact._large_deformations.moving_contact import ContactConfiguration
    from fenics_contact._large_deformations.newton import NonlinearEquilibrium


@displayed
@dataclass(frozen=True, eq=False, kw_only=True)
class DeformedState(State):
    """An equilibrium of large deformations or nonlinear materials.

    Forces, gaps and stresses (Cauchy's) are those of the deformed bodies, where no material is made for that
    those of the undeformed ones, as in linear elasticity. Moments are those of the deformed places of bodies
    that deform much, and of the undeformed places of all others. Errors are estimated of quantities, by
    `fenics_contact.goal_error`; there are no bounds.

    Attributes:
        equilibrium: Displacement, forces and history of the materials.
        load: What acts.
        begun: Where bodies met at the start of the load step; None where a checkpoint was read.
        fractions: Parts of the last load step at which equilibria were found.
        since: The part from which slip and the histories of materials are one step up to the end: 0, unless
            `AutomaticSteps.finer_history` made each part a step of its own, or bodies snapped.
        snaps: Where bodies snapped within it.
        factorisations: Factored tangents of the last load step, counting all subdomains as one.
    """

    solution: Solution
    equilibrium: NonlinearEquilibrium
    load: Loading
    begun: ContactConfiguration | None
    fractions: tuple[float, ...]
    since: float
    snaps: tuple[Snap, ...]
    factorisations: int

    def _facts(self) -> dict[str, str]:
        facts = super()._facts()
        residuals = self.solution.residuals
        up_to = "" if self.reached == 1.0 else f", up to {self.reached:.3g}"
        anew = "" if self.since == 0.0 else f"; slip and histories begin anew at {self.since:.3g}"
        further = {
            "parts": f"{len(self.fractions)}{up_to} of the load step{anew}",
            "residuals": f"{facts['residuals']}, out of balance {residuals.coarse:.1e}",
            "snaps": "; ".join(map(str, self.snaps)) or "nan",
        }
        return {name: words for name, words in (facts | further).items() if words != "nan"}

    @cached_property
    def rows(self) -> RowValues:
        """Multipliers, residuals and steps of the natural map by row."""
        return row_values_at(self.equilibrium)

    def _errors_in_words(self) -> dict[str, str]:
        return {"errors": "of nonlinear materials those of quantities, by goal_error; or compare two meshes"}

    @cached_property
    @collectively("DeformedState.conforming_displacement", comm_of)
    def conforming_displacement(self) -> np.ndarray:
        """See `State.conforming_displacement`; without iteration. Collective on first use."""
        system = self.equilibrium.linearisation.system
        return system.conforming_on(self.torn, self.torn_displacement)

    @property
    def time(self) -> float:
        """The time at which it was reached."""
        return self.equilibrium.time

    @property
    def reached(self) -> float:
        """Part of the load step up to which it could be followed; less than one in a `LoadStepError`."""
        return float(self.fractions[-1])

    @cached_property
    def history(self) -> History:
        """Internal variables of the bodies' materials, on every rank. Collective on first use."""
        from fenics_contact._fem.mechanics import History

        decomposition, found = self.torn.decomposition, self.equilibrium.configuration.history
        pairs = zip(decomposition.meshes, found, strict=True)
        parts = [(mesh.body, mesh.cells, values) for mesh, values in pairs if values is not None]
        return History.unloaded(self.scene).advanced(decomposition.comm, parts)

    @property
    def responses(self) -> tuple[Response, ...]:
        """What the materials of each subdomain of this rank answer."""
        return self.equilibrium.evaluation.responses

    @cached_property
    def stress(self) -> dict[str, dolfinx.fem.Function]:  # type: ignore[override]
        """Cauchy stress of each body, its mean on each cell, shape (3, 3), [force / length²].

        Plane bodies have the component normal to the plane, too. Collective on first use.
        """
        return self._with_history(super().stress, lambda tensor: tensor)

    @cached_property
    def von_mises(self) -> dict[str, dolfinx.fem.Function]:  # type: ignore[override]
        """Von Mises stress of each body, constant on cells, [force / length²]. Collective on first use."""
        return self._with_history(super().von_mises, von_mises_of)

    def _with_history(
        self, fields: dict[str, dolfinx.fem.Function], quantity: Callable[[np.ndarray], np.ndarray]
    ) -> dict[str, dolfinx.fem.Function]:
        """Return fields of stresses with those of materials with a history in their places. Collective."""
        for name, body in self.scene.bodies.items():
            if any(has_history(material) for material in body.materials):
                put_history_stress(
                    fields[name], self.torn, name, self.equilibrium.evaluation.responses, quantity
                )
        return fields

    @cached_property
    @collectively("DeformedState.contact_nominal_pressure", comm_of)
    def contact_nominal_pressure(self) -> dict[str, dolfinx.fem.Function]:
        """Contact force by area of the undeformed slave as a Function, [force / length²].

        Laid out as `State.contact_pressure`, the force by area of the deformed slave. Collective on first
        use.
        """
        return self._contact_functions("contact_nominal_pressure")

    @cached_property
    def _nodal_forces(self) -> NodalForces:
        forces = nodal_forces(self.torn, self.solution.multiplier, self.torn_displacement)
        far = [each for each in self.equilibrium.evaluation.load.turned if each.far]
        springs = {each.place: self._exerted(*each.sprung, each.point) for each in far if each.springs.any()}
        moved = {each.place: each.motion[: self.scene.dim] for each in far}
        return replace(
            forces, places=self._moment_arms, bed=np.zeros_like(forces.bed), moved=moved, springs=springs
        )

    def _exerted(self, force: np.ndarray, moment: np.ndarray, about: np.ndarray) -> Resultant:
        return Resultant(force, self.scene.kinematics.moment_at(force, moment, about, about), about)

    @property
    def _known_motions(self) -> Mapping[tuple[str, str], np.ndarray]:
        return self.equilibrium.evaluation.load.motions

    @property
    def _least_force(self) -> float:
        return self.solution.residuals.force_scale

    @cached_property
    def _moment_arms(self) -> np.ndarray:
        """Where forces act on the nodes of all bodies, replicated, [length].

        Stress keeps a body of small strain in balance about its undeformed places, whatever others do.
        """
        return np.concatenate(
            [
                body.mesh.points + (self.gather_displacement(name) if body.deforms_much else 0.0)
                for name, body in self.scene.bodies.items()
            ]
        )


#: What solving a scene returns; annotations that need more than a `State` has narrow it by `isinstance`.
AnyState: TypeAlias = LinearState | DeformedState


def row_values_at(end: NonlinearEquilibrium) -> RowValues:
    """Return what the laws of rows depend on at an equilibrium."""
    evaluation, at = end.evaluation, end.evaluation.at
    torn, residual, diagonal = evaluation.torn, evaluation.constraint_residual, at.diagonal
    assert diagonal is not None
    bound, step = torn.law.bound(at.multiplier), contact_step(torn.layout, diagonal)
    free = np.zeros(len(at.multiplier), dtype=bool)
    return RowValues(at.multiplier, residual, bound, step, -residual, free, evaluation.residuals)


#: Near the end residuals may be what rounding and inexact systems leave: the best of this many steps counts.
LAST = 3


@displayed
@dataclass(frozen=True)
class NewtonSteps:
    """Residuals of Newton's method in load steps, in the last of the parts in which each was followed.

    Attributes:
        residuals: The worst residual after each Newton step, relative, one tuple for each load step.
    """

    residuals: tuple[tuple[float, ...], ...]

    @classmethod
    def of(cls, states: Sequence[State]) -> NewtonSteps:
        """Return those of states with nonlinear materials; states from a checkpoint have none.

        Args:
            states: States after load steps.
        """
        runs = (state.equilibrium.effort.history for state in states if isinstance(state, DeformedState))
        return cls(tuple(tuple(line.residuals.worst for line in run) for run in runs if run))

    @property
    def reduction(self) -> np.ndarray:
        """Best residual reduction of the last three steps, shape (n,), dimensionless.

        Where Newton's method is superlinear it is small, the smaller the smaller the residual. Load steps of
        one Newton step, as of bodies that touch nothing, are left out.
        """
        ends = [np.array(end) for end in self._ends]
        return np.array([float((end[1:] / end[:-1]).min()) for end in ends])

    @property
    def _ends(self) -> list[tuple[float, ...]]:
        """The last residuals of load steps of several Newton steps."""
        return [run[-LAST - 1 :] for run in self.residuals if len(run) > 1]

    def __str__(self) -> str:
        """Return numbers of steps, the last residuals of the median load step, and the reductions."""
        reduction = self.reduction
        if not reduction.size:
            return "Newton's method: no load step with several steps"
        counts = [len(run) for run in self.residuals]
        usual = self._ends[int(np.argsort(reduction)[len(reduction) // 2])]
        ends = ", ".join(f"{value:.0e}" for value in usual)
        median, worst = f"{np.median(reduction):.0e}", f"{reduction.max():.0e}"
        return (
            f"Newton's method: {np.mean(counts):.1f} steps a load step, at most {max(counts)}; residuals at "
            f"the end of a median one {ends}; its best step leaves {median} of them, of the worst load step "
            f"{worst}"
        )
