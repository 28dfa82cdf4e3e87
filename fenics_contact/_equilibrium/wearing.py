"""Wear of contact surfaces: solved again until distances agree with slips, and what is lost before."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import cast

import numpy as np

from fenics_contact._base.display import counted
from fenics_contact._equilibrium.passes import OuterLoop, Passes, Relaxation
from fenics_contact._large_deformations.load_steps import AutomaticSteps
from fenics_contact._large_deformations.moving_contact import Contact
from fenics_contact._large_deformations.wear import EarlierWear
from fenics_contact._scene.scene import Scene
from fenics_contact.errors import ConvergenceError, InvalidInputError
from fenics_contact.feti.carried import on_contacts
from fenics_contact.feti.point_wear import AtNodes, PointWear, WornClosures
from fenics_contact.feti.torn import TornSystem
from fenics_contact.results.linear_state import LinearState
from fenics_contact.results.state import State


@dataclass(frozen=True)
class Wearing(OuterLoop):
    """Surfaces that lose material: passes until the distances over which they do are those of the slips."""

    name = "wear"
    max_passes: int = 100
    rough: float = 1e-2

    def check(self, last: State, scene: Scene) -> None:
        """Reject pairs that have worn and wear no more: their depth would be forgotten."""
        now = {(pair.slave, pair.master): pair for pair in scene.contacts}
        for number, pair in enumerate(last.scene.contacts):
            after = now.get((pair.slave, pair.master), pair)
            if not after.wears and last.contact.worn_volume(number) > 0.0:
                raise InvalidInputError(
                    f"a pair that has worn must keep its law, but {after.place} of the load step has "
                    "none: give it Wear(..., sliding=0.0) where nothing more wears"
                )

    def require_derivatives(self, torn: TornSystem, before: State | None) -> None:
        """Accept all: what a step takes away is part of its law, see `design.wear`."""

    def solve(self, passes: Passes, torn: TornSystem, before: State | None, tolerance: float) -> LinearState:
        """Return the state whose wear is that of its pressures and slips. Collective.

        Every pass is one solution at given distances D, whose wear D r(p) is a closure. Where points slide as
        prescribed it is the only one. Else slips change with it: the next pass takes over a part of the
        difference, as `FrictionBySlip` does; the first one need not be accurate. The tolerance is that of the
        forces by which the wear of the distances that were and of those that are differ, relative to all.
        """
        wear = PointWear.of(torn.scene, torn.points, _lost(torn, before), torn.decomposition.comm)
        distance, relaxation = wear.distance(_slip(torn, passes.latest)), Relaxation()
        guessed = passes.latest is not None or not wear.by_slip
        accuracy = tolerance if guessed else max(tolerance, self.rough)
        while passes.count < self.max_passes:
            state = passes.run(wear.on(torn, distance), accuracy)
            missing = wear.distance(state.contact.slip) - distance
            change = _in_forces(state, wear, missing)
            passes.remark(f"wear pass {passes.count}: forces change by {change:.1e}")
            if accuracy > tolerance:  # what slips err by changes wear by so much of its change
                accuracy = tolerance if change * accuracy <= tolerance else max(tolerance, accuracy**2)
                distance = distance + missing
                continue
            if change <= tolerance:
                return passes.answer(state)
            part = relaxation.of(missing * state.contact.normal_force)
            distance = np.maximum(distance + part * missing, 0.0)
        after = counted(passes.count, "pass", "passes")
        raise ConvergenceError(
            f"wear must agree with the slips, after {after} it still changes forces by {change:.1e} of the "
            "largest: take smaller load steps or fewer cycles, or prescribe how far surfaces slide",
            passes.history,
        )

    def feedback(self, contact: Contact, before: State | None, steps: AutomaticSteps) -> tuple[EarlierWear]:
        """Return what a state has lost, with the slip of its load step until contact knows better.

        Raises:
            InvalidInputError: If parts of load steps have histories of their own, or bodies may snap.
        """
        if steps.finer_history or steps.snaps:
            raise InvalidInputError(
                "wear is that of whole load steps, got AutomaticSteps with finer_history or snaps: leave "
                "them out, and give more load steps"
            )
        return (EarlierWear.of(() if before is None else (before,)),)

    def stored(self, torn: TornSystem) -> dict[str, np.ndarray]:
        """Return what points had lost, and their distances."""
        closures = cast(WornClosures, torn.groups.normal.closures)
        wear, points = cast(PointWear, torn.wear), torn.points
        lost = wear.lost.updated(points, wear.before[:, None])
        known = {"lost": lost.values, "lost_at": lost.key, "distance": closures.distance}
        return {**known, "slid_at": AtNodes.of(points, wear.before).key}

    def restored(self, torn: TornSystem, stored: Mapping[str, np.ndarray]) -> TornSystem:
        """Return the system with the wear as it was. Collective."""
        lost = AtNodes.keyed(stored["lost_at"], stored["lost"]).on(torn.points)[:, 0]
        wear = PointWear.of(torn.scene, torn.points, lost, torn.decomposition.comm)
        return wear.on(torn, stored["distance"])

    def stored_feedback(self, contact: Contact, stored: Mapping[str, np.ndarray]) -> tuple[EarlierWear]:
        """Return what a stored state had lost before its load step."""
        lost = AtNodes.keyed(stored["lost_at"], stored["lost"])
        return (EarlierWear(lost, AtNodes.keyed(stored["slid_at"], stored["slip"][0])),)


def _lost(torn: TornSystem, before: State | None) -> np.ndarray:
    """Return the depth that points of a system have lost in a state before, (n_contact,), [length]."""
    if before is None:
        return np.zeros(torn.points.count)
    return on_contacts(before.torn, before.contact.worn_depth, torn)


def _slip(torn: TornSystem, latest: State | None) -> np.ndarray:
    """Return the slips of the latest state at points of a system, (n_contact, dim − 1), [length]."""
    if latest is None:
        return np.zeros((torn.points.count, torn.components - 1))
    return on_contacts(latest.torn, latest.contact.slip, torn)


def _in_forces(state: LinearState, wear: PointWear, missing: np.ndarray) -> float:
    """Return by how much forces change if distances do, relative to all. Collective."""
    torn, rows = state.torn, state.rows
    force, normal = state.contact.normal_force, torn.normal_rows
    closures = torn.groups.normal.closures
    assert closures is not None
    step = torn.numbering.gather(rows.step, normal)
    deeper = wear.depth_over(missing, force / torn.points.area)
    change = step * deeper / (1.0 + step * closures.growth(force))
    return float(np.linalg.norm(change)) / (rows.residuals.force_scale or 1.0)
