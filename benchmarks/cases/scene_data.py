"""Numbers of the scenes, for every program that solves them and for the plan of runs. Imports nothing."""

from __future__ import annotations

#: Cells or boxes along three directions.
Counts = tuple[int, int, int]

#: Cells of one link of the published experiment around, through and across it, and its boxes.
PAPER_CELLS: Counts = (48, 8, 20)
PAPER_BOXES: Counts = (8, 1, 2)
FRICTION_COEFFICIENT = 0.3

#: Corners of the block, without units.
LOWER, UPPER = (0.0, 0.0, 0.0), (2.0, 1.0, 1.0)
#: z of the rigid plane below the block.
PLANE_HEIGHT = -0.02
YOUNG_MODULUS, POISSON_RATIO = 1.0, 0.3
#: Diameter of the bores of the drilled block, where they cross it, and along which axes they go.
BORE = 0.4
BORES = (((1.4, 0.0, 0.55), (0.0, 1.0, 0.0)), ((0.7, 0.5, 0.0), (0.0, 0.0, 1.0)))
#: On the upper side of the block; the side x = 0 is clamped.
TRACTION = (0.02, 0.01, -0.05)

#: Effects of one scene: each level has all that the one before has, friction laws replaced.
LEVELS = ("none", "contact", "Tresca", "Coulomb", "thermal", "sensitivity")
