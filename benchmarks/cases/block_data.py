"""Numbers of the block on a plane, without units, for every program that solves it. Imports nothing."""

from __future__ import annotations

#: Corners of the block.
LOWER, UPPER = (0.0, 0.0, 0.0), (2.0, 1.0, 1.0)
#: z of the rigid plane below.
PLANE_HEIGHT = -0.02
YOUNG_MODULUS, POISSON_RATIO = 1.0, 0.3
#: On the upper side; the side x = 0 is clamped.
TRACTION = (0.02, 0.01, -0.05)
FRICTION_COEFFICIENT = 0.3

#: Cells or boxes along three directions.
Counts = tuple[int, int, int]
