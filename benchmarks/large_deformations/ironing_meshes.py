"""Shallow ironing: a stiff die with a round underside is pressed into a soft bed and drawn along it.

K. A. Fischer, P. Wriggers, Mortar based frictional contact formulation for higher order interpolations using
the moving friction cone, Comput. Methods Appl. Mech. Eng. 195 (2006). Lengths in mm, forces in N per mm.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fenics_contact import BodyMesh
from fenics_contact.gallery import growing_ticks, rectangle, rectangle_lattice

#: Young's moduli of bed and die, [N/mm²], Poisson's ratio of both, coefficient of friction.
SOFT, HARD, RATIO, FRICTION = 689.6, 6896.0, 0.32, 0.3
#: Times of the published curves: pressed by 1 mm until 1, drawn by 10 mm until 2.
TIMES = (0.5, 1.0, 1.25, 1.5, 1.75)
#: Places about each later time, in facets of the bed: forces ripple with them as nodes pass facets.
PLACES = (-0.375, -0.125, 0.125, 0.375)
#: Height of the round part, and half the width of the die.
SAGITTA, HALF = 0.3, 0.6
#: Columns of the bed by those of the die, whose nodes are the slaves.
COARSER = 6
#: Height of a row of the bed by that of the one above, for 48 columns.
GROWTH = 1.3


def die(columns: int) -> BodyMesh:
    """Mesh the die; "skin" is its round underside and its sides, which may touch the bed as well."""
    mesh = rectangle((0.2, 4.2), (1.4, 5.4), (columns, columns))
    x, y = mesh.points.T
    radius = (HALF**2 + SAGITTA**2) / (2.0 * SAGITTA)
    under = 4.2 + radius - np.sqrt(radius**2 - (x - 0.8) ** 2)
    points = np.column_stack([x, under + (5.4 - under) * (y - 4.2) / 1.2])
    skin = np.concatenate([mesh.surfaces[side] for side in ("x0", "y0", "x1")])
    return replace(mesh, points=points, surfaces={**mesh.surfaces, "skin": skin})


def bed(columns: int) -> BodyMesh:
    """Mesh the bed, 12 x 4, with square cells at its top."""
    down = growing_ticks(4.0, 12.0 / columns, GROWTH ** (48 / columns))
    return rectangle_lattice([np.linspace(0.0, 12.0, columns + 1), 4.0 - down[::-1]])


def place(time: float) -> tuple[float, float]:
    """Return the displacement of the die's upper side."""
    return 10.0 * max(0.0, time - 1.0), -min(time, 1.0)
