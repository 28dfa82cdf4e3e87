"""Steps of decks in which temperatures move bodies, and pressures, gaps and friction act on temperatures."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from fenics_contact.decks.deck import Deck
from fenics_contact.decks.heat_steps import HeatCards
from fenics_contact.errors import InvalidInputError
from fenics_contact.heat.coupled import HeatedState, solve_heated
from fenics_contact.heat.parts import HeldTemperature
from fenics_contact.heat.scene import HeatScene

if TYPE_CHECKING:
    from mpi4py import MPI

#: Name of the set of all nodes of a body.
EVERYWHERE = "all nodes"


def both_ways(
    mechanics: Deck,
    heat: Callable[[int, float], HeatScene],
    steps: Sequence[HeatCards],
    initial: Mapping[str, np.ndarray],
    comm: MPI.Comm,
    **cut: Any,
) -> Iterator[tuple[int, float, HeatedState]]:
    """Yield step, time since it began and state; `heat`: scene of a step at such a time. Collective."""
    cold = {name: float(own[0]) for name, own in initial.items()}
    if wrong := [name for name, own in initial.items() if np.ptp(own) > 0.0]:
        raise InvalidInputError(
            f"bodies whose contact acts on heat must have one initial temperature each, {wrong[0]} has "
            f"{initial[wrong[0]].min():g} to {initial[wrong[0]].max():g}: give it one"
        )
    scene, start, before = mechanics.scene, heat(0, 0.0), 0.0
    held = [HeldTemperature(name, EVERYWHERE, cold[name]) for name in start.bodies]
    at_start = replace(start, held=held, loads=(), ties=())
    state = solve_heated(scene, at_start, comm, stress_free=cold, **cut)
    for place, load in zip(mechanics.step_of, mechanics.steps, strict=True):
        if place < len(steps):  # the last one is no step of the deck
            scene, total = load.applied_to(scene), float(load.time or 0.0)
            cut["duration"] = np.inf if steps[place].steady else total - before
            now, before = total - steps[place].start, total
            state = solve_heated(scene, heat(place, now), comm, stress_free=cold, before=state, **cut)
            yield place, now, state
