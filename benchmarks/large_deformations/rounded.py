"""Round dies by this package."""

from __future__ import annotations

from time import perf_counter
from typing import Any

from mpi4py import MPI

from benchmarks.large_deformations.ironing_meshes import FRICTION, RATIO, SOFT, bed
from benchmarks.large_deformations.rounded_meshes import DIES, place, recorded, round_die, times
from fenics_contact import (
    Body,
    ContactPair,
    ContactProblem,
    Coulomb,
    LoadSequence,
    LoadStep,
    Scene,
    Support,
    Surface,
)
from fenics_contact._scene.pairs import Discretisation
from fenics_contact.materials import NeoHooke


def rounded(columns: int, die: str, discretisation: Discretisation) -> Scene:
    """Return the scene at rest; nodes of the die are the slaves."""
    bodies = {
        "bed": Body(bed(columns), NeoHooke(SOFT, RATIO)),
        "die": Body(round_die(columns), NeoHooke(DIES[die], RATIO)),
    }
    pair = ContactPair(Surface("die", "y0"), Surface("bed", "y1"), Coulomb(FRICTION), discretisation)
    return Scene(bodies, _held(0.0), contacts=[pair])


def _held(time: float) -> list[Support]:
    return [Support("bed", "y0"), Support("die", "y1", place(time))]


def measured(comm: MPI.Comm, columns: int, die: str, discretisation: Discretisation) -> dict[str, Any]:
    """Return the forces on one mesh."""
    began, forces, newton_steps = perf_counter(), [], 0
    sequence = LoadSequence(ContactProblem(rounded(columns, die, discretisation), comm))
    for time in times(columns):
        state = sequence.advance(LoadStep(f"time {time:g}", supports=_held(time)))
        forces.append(-state.reactions()[1].force)
        newton_steps += len(state.solution.history)
    return recorded(columns, die, discretisation, forces, newton_steps, perf_counter() - began)
