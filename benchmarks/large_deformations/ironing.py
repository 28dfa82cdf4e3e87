"""Shallow ironing by this package: forces at the published times."""

from __future__ import annotations

from time import perf_counter
from typing import Any

import numpy as np
from mpi4py import MPI

from benchmarks.large_deformations.ironing_meshes import (
    COARSER,
    FRICTION,
    HARD,
    PLACES,
    RATIO,
    SOFT,
    TIMES,
    bed,
    die,
    place,
)
from fenics_contact import (
    AutomaticSteps,
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

#: Between two times the die moves by up to two facets in a part, each a step of friction of its own.
PARTS = AutomaticSteps(finer_history=True)


def ironing(columns: int, discretisation: Discretisation = "node") -> Scene:
    """Return the scene at rest; nodes of the die are the slaves."""
    soft, hard = (
        Body(bed(columns), NeoHooke(SOFT, RATIO)),
        Body(die(columns // COARSER), NeoHooke(HARD, RATIO)),
    )
    pair = ContactPair(Surface("die", "skin"), Surface("bed", "y1"), Coulomb(FRICTION), discretisation)
    return Scene({"bed": soft, "die": hard}, held(0.0), contacts=[pair])


def held(time: float) -> list[Support]:
    """Return the supports at a time."""
    return [Support("bed", "y0"), Support("die", "y1", place(time))]


def measured(
    comm: MPI.Comm, columns: int, discretisation: Discretisation = "node", last: float = TIMES[-1]
) -> dict[str, Any]:
    """Return vertical and horizontal force at the times, while sliding their mean over a facet of the bed."""
    sequence = LoadSequence(ContactProblem(ironing(columns, discretisation), comm, steps=PARTS))
    began, found = perf_counter(), list[dict[str, float]]()
    for time in (time for time in TIMES if time <= last):
        forces, newton_steps = [], 0
        for share in PLACES if time > 1.0 else (0.0,):
            at = time + share * 1.2 / columns
            state = sequence.advance(LoadStep(f"time {at:g}", supports=held(at)))
            forces.append(state.reactions()[1].force)
            newton_steps += len(state.solution.history)
        across, down = np.mean(forces, axis=0)
        ripple = np.ptp(np.array(forces)[:, 0])
        found.append(
            {
                "time": time,
                "vertical": round(-float(down), 3),
                "horizontal": round(float(across), 3),
                "ripple": round(float(ripple), 3),
                "newton_steps": newton_steps,
            }
        )
    return {
        "columns": columns,
        "discretisation": discretisation,
        "times": found,
        "seconds": round(perf_counter() - began, 1),
    }
