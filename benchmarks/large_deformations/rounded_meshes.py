"""A die without corners where it touches, pressed into the bed of shallow ironing and drawn along it.

As the bed leaves the die on a smooth surface, forces of two programs on one mesh come together as it is
refined. Lengths in mm, forces in N per mm. GetFEM brings a MUMPS without MPI, so nothing that uses MPI or
PETSc may be imported here.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from benchmarks.large_deformations.ironing_meshes import HARD, SOFT
from fenics_contact import BodyMesh
from fenics_contact.gallery import rectangle

#: Radius of the die's underside, its way down and then along.
RADIUS, DEPTH, ALONG = 1.5, 0.4, 1.0
#: Load steps until the die is pressed in, and on each facet of the bed.
PRESSING, PER_FACET = 4, 4
#: Young's modulus of the die, [N/mm²], by what it is beside the bed.
DIES = {"stiff": HARD, "equal": SOFT}


def round_die(columns: int) -> BodyMesh:
    """Mesh the die for a number of columns of the bed; "y0" is its round underside."""
    mesh = rectangle((1.8, 4.0), (4.2, 6.0), (columns // 6, columns // 8))
    x, y = mesh.points.T
    under = RADIUS - np.sqrt(RADIUS**2 - (x - 3.0) ** 2)
    return replace(mesh, points=np.column_stack([x, 4.0 + under + (2.0 - under) * (y - 4.0) / 2.0]))


def place(time: float) -> tuple[float, float]:
    """Return the displacement of the die's upper side: pressed until 1, drawn until 2."""
    return ALONG * max(0.0, time - 1.0), -DEPTH * min(time, 1.0)


def times(columns: int) -> list[float]:
    """Return the ends of the load steps."""
    drawn = round(PER_FACET * ALONG * columns / 12.0)
    pressed = [step / PRESSING for step in range(1, PRESSING + 1)]
    return [*pressed, *(1.0 + step / drawn for step in range(1, drawn + 1))]


def recorded(
    columns: int, die: str, way: str, forces: Sequence[np.ndarray], newton_steps: int, seconds: float
) -> dict[str, Any]:
    """Return the record of a run: forces pressed, and their mean over the second half of the way along.

    Args:
        columns: Of the bed.
        die: One of `DIES`.
        way: Its discretisation or program.
        forces: On the die, across and up, one for each of `times`.
        newton_steps: Of all load steps.
        seconds: From the meshes to the last force.
    """
    across, up = np.array(forces).T
    half = (len(forces) + PRESSING) // 2
    return {
        "die": die,
        "discretisation": way,
        "columns": columns,
        "pressed": round(float(up[PRESSING - 1]), 4),
        "vertical": round(float(up[half:].mean()), 4),
        "horizontal": round(float(-across[half:].mean()), 4),
        "load_steps": len(forces),
        "newton_steps": newton_steps,
        "seconds": round(seconds, 1),
    }
