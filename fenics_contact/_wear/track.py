"""A history of wear that may go on in jumps of any size."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from fenics_contact._equilibrium.other_rows import require_values_to_keep, with_kept
from fenics_contact._equilibrium.problem import ContactProblem
from fenics_contact._equilibrium.steps import timed
from fenics_contact._scene.scene import LoadStep, Scene
from fenics_contact._wear.shapes import Follower
from fenics_contact.errors import together
from fenics_contact.feti.carried import on_contacts
from fenics_contact.feti.point_wear import AtNodes
from fenics_contact.results.deformed_state import AnyState


@dataclass(frozen=True, eq=False)
class Track:
    """A history of wear so far.

    `scene`: with its shape; `states`: the state at its end, none before the first step; `cycles`: done;
    `volume`: lost by each pair; `steps`: solved; `jump`: cycles of the last ones; `follower`: moves the
    meshes; `before`: the state from which the next step goes on, the last one less what meshes have lost;
    `gone`, `kept`: depth that they have lost so far, and that stays a gap.
    """

    problem: ContactProblem
    scene: Scene
    states: tuple[AnyState, ...] = ()
    cycles: float = 0.0
    volume: np.ndarray = field(default_factory=lambda: np.zeros(0))
    steps: int = 0
    jump: float = 1.0
    follower: Follower = field(default_factory=lambda: Follower(np.inf))
    before: tuple[AnyState, ...] = ()
    gone: AtNodes = field(default_factory=AtNodes.none)
    kept: AtNodes = field(default_factory=AtNodes.none)

    @property
    def state(self) -> AnyState:
        """The state at its end."""
        (state,) = self.states
        return state

    @property
    def depth(self) -> np.ndarray:
        """Depth that points of the last state have lost, shape (n_contact,), [length]."""
        (before,) = self.before
        return self.gone.on(before.contact.points)[:, 0] + before.contact.worn_depth

    @property
    def pressure(self) -> float:
        """The largest pressure of pairs that wear, [force / length²]."""
        return float(self.state.contact.pressure[self._worn].max(initial=0.0))

    @property
    def slip(self) -> float:
        """The largest slip of pairs that wear in the last load step, [length]."""
        return float(np.linalg.norm(self.state.contact.slip[self._worn], axis=1).max(initial=0.0))

    @property
    def _worn(self) -> np.ndarray:
        """Marks of the points of pairs that wear, shape (n_contact,)."""
        worn = np.array([bool(pair.wears) for pair in self.scene.contacts])
        return np.asarray(worn[self.state.contact.points.pair])

    def after(self, steps: Sequence[LoadStep], cycles: float) -> Track:
        """Return the history after so many cycles, of which the steps are one. Collective."""
        track = self
        for step in steps:
            track = track._after(replace(step, cycles=cycles))
        return replace(track, cycles=self.cycles + cycles, jump=cycles)._followed()

    def _followed(self) -> Track:
        """Return the history with the meshes in their worn shape, where that differs enough. Collective."""
        points, decomposition = self.state.contact.points, self.problem.decomposition
        kept = self.kept.on(points)[:, 0]
        for moved in self.follower.moved(self.scene, decomposition, self.state, kept):
            gone = AtNodes.of(points, self.gone.on(points) + moved.depth[:, None])
            rest = AtNodes.of(points, moved.before.contact.worn_depth[:, None])
            return replace(self, scene=moved.scene, before=(moved.before,), gone=gone, kept=rest)
        return self

    def _after(self, step: LoadStep) -> Track:
        before = next(iter(self.before), None)
        with together(self.problem.comm):
            scene = step.applied_to(self.scene)
            require_values_to_keep(step, scene)
        scene = with_kept(scene, before)
        step = timed(step, self.steps + 1)
        state = self.problem.solve(scene, before=before, start=before or "last", step=step)
        contact = state.contact
        lost = contact.nominal_area * contact.worn
        volume = np.bincount(contact.points.pair, lost, minlength=len(scene.contacts))
        volume = volume + (self.volume if len(self.volume) else 0.0)
        return replace(
            self, scene=scene, states=(state,), before=(state,), volume=volume, steps=self.steps + 1
        )

    def at_end_of(self, steps: Sequence[LoadStep]) -> Track:
        """Return the history of a scene as it is after steps, before any is solved."""
        scene = self.scene
        for step in steps:
            scene = step.applied_to(scene)
        return replace(self, scene=scene)

    def begun(self) -> Track:
        """Return the history as one of no cycles yet."""
        return replace(self, cycles=0.0)

    def depth_at(self, other: Track) -> np.ndarray:
        """Return the depths at the contact points of another history, shape (n_contact,), [length]."""
        return on_contacts(self.state.torn, self.depth, other.state.torn)
