"""Round dies by GetFEM."""

from __future__ import annotations

from time import perf_counter
from typing import Any

from benchmarks.large_deformations.getfem_ironing import drawn, force_on, missing, moved
from benchmarks.large_deformations.ironing_meshes import bed
from benchmarks.large_deformations.rounded_meshes import DIES, place, recorded, round_die, times


def measured(comm: None, columns: int, die: str) -> dict[str, Any]:
    """Return forces as `rounded.measured` does, or a note where GetFEM is missing."""
    if (reason := missing()) is not None:
        return {"skipped": reason}
    import getfem as gf

    began, forces, newton_steps, before = perf_counter(), [], 0, 0.0
    model, skin, _alive = drawn(gf, bed(columns), round_die(columns), "y0", DIES[die])
    for time in times(columns):
        newton_steps += moved(model, place, before, time)
        forces.append(force_on(gf, skin, model))
        before = time
    return recorded(columns, die, "GetFEM", forces, newton_steps, perf_counter() - began)
