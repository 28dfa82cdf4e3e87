"""Small scenes as text, to be changed."""

from __future__ import annotations

GOOD = """\
title = "Two blocks"

[meshes.lower]
shape = "block"
lower = [0.0, 0.0, 0.0]
upper = [2.0, 2.0, 1.0]
counts = [2, 2, 1]

[meshes.upper]
shape = "block"
lower = [0.5, 0.5, 1.0]
upper = [1.5, 1.5, 2.0]
counts = [2, 2, 1]

[materials.steel]
young_modulus = 2.1e5
poisson_ratio = 0.3

[bodies.lower]
mesh = "lower"
material = "steel"

[bodies.upper]
mesh = "upper"
material = "steel"

[[supports]]
body = "lower"
surface = "z0"

[[loads]]
kind = "traction"
body = "upper"
surface = "z1"
value = [10.0, 0.0, -100.0]

[[contacts]]
slave = { body = "upper", surface = "z0" }
master = { body = "lower", surface = "z1" }
friction = { law = "coulomb", coefficient = 0.3 }

[solver]
tolerance = 1e-8
"""

#: A block on a floor, pressed and shifted in three steps.
STEPS = """
title = "Shifted block"
meshes.m = { shape = "block", lower = [0, 0, 0], upper = [2, 1, 1], counts = [3, 2, 2] }
materials.s = { young_modulus = 10.0, poisson_ratio = 0.3 }
bodies.block = { mesh = "m", material = "s" }
output.pictures = []
solver.tolerance = 1e-8

[[supports]]
name = "top"
body = "block"
surface = "z1"
value = [0.0, 0.0, -0.1]

[[contacts]]
slave = { body = "block", surface = "z0" }
master = { obstacle = "plane", point = [0, 0, 0], normal = [0, 0, 1] }
friction = { law = "coulomb", coefficient = 0.3 }

[[steps]]
name = "pressed"

[[steps]]
name = "shifted"
count = 2
supports.top = [0.4, 0.0, -0.1]
"""


def changed(*changes: tuple[str, str], text: str = GOOD) -> str:
    """Return the scene with each old text, which must be there once, replaced by a new one."""
    for old, new in changes:
        assert text.count(old) >= 1, old
        text = text.replace(old, new, 1)
    return text
