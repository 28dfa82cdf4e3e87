"""A small scene as text, to be changed."""

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


def changed(*changes: tuple[str, str], text: str = GOOD) -> str:
    """Return the scene with each old text, which must be there once, replaced by a new one."""
    for old, new in changes:
        assert text.count(old) >= 1, old
        text = text.replace(old, new, 1)
    return text
