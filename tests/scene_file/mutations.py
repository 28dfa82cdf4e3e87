"""Scene files with random mistakes: values, keys and pieces of text that nobody would write on purpose."""

from __future__ import annotations

import json
import random
import tomllib
from collections.abc import Iterator
from typing import Any

from tests.conftest import ROOT
from tests.scene_file.texts import GOOD

#: The example scenes with fewer cells.
_COARSER = {
    "hertz": (("n = 9", "n = 3"), ("counts = [12, 12, 12]", "counts = [3, 5, 3]")),
    "chain_links": (("n_around = 36", "n_around = 24"), ("n_a = 6", "n_a = 2"), ("n_b = 14", "n_b = 6")),
    "two_blocks": (
        ("counts = [8, 6, 2]", "counts = [3, 3, 1]"),
        ("counts = [6, 6, 3]", "counts = [3, 5, 1]"),
    ),
    "sheared_block": (("counts = [16, 8, 6]", "counts = [5, 3, 3]"),),
}
#: What the examples lack: a plane scene, every shape, every material, formulas, ties.
PLANE = """\
meshes.m = { shape = "rectangle", lower = [0, 0], upper = [2, 1], counts = [3, 2], grading = [1.0, 0.0] }
meshes.d = { shape = "half_disc", radius = 2.0, n = 3, degrees = 10.0, scale = 2.0, translate = [1, 1] }
bodies.block = { mesh = "m", material = "s" }
bodies.disc = { mesh = "d", material = "o" }
supports = [{ name = "s", body = "block", surface = "y0", value = ["0.1*x", "where(x > 1, 0, 1e-3)"] }]

[materials.s]
model = "plane_strain"
young_modulus = 10.0
poisson_ratio = 0.3
thermal_expansion = 1e-5

[materials.o]
model = "orthotropic_plane_stress"
young_moduli = [9, 5]
poisson_ratio = 0.3
shear_modulus = 3.0

[[steps]]
name = "first"

[[steps]]
name = "next"
count = 2
supports = { s = ["x", 0.0] }
loads = { p = "x + 1" }

[[loads]]
name = "p"
kind = "pressure"
body = "disc"
surface = "top"
value = "x**2"

[[loads]]
kind = "thermal"
body = "block"
value = 20.0

[[loads]]
kind = "gravity"
body = "disc"
density = 1.0
acceleration = [0.0, -9.81]

[[contacts]]
slave = { body = "block", surface = "y1" }
master = { body = "disc", surface = "contact" }
friction = { law = "tresca", traction = 0.1 }
discretisation = "mortar"

[[contacts]]
slave = { body = "block", surface = "x1" }
master = { obstacle = "distance", formula = "5 - x" }
"""
SOLID = """\
meshes.t = { shape = "block", lower = [0, 0, 0], upper = [1, 1, 1], counts = [2, 3, 1], cell = "tetrahedron" }
materials.s = { young_modulus = 10.0, poisson_ratio = 0.3 }
bodies.p = { mesh = "p", material = "s" }
bodies.b = { mesh = "b", material = { shank = "s", ends = "o" } }
bodies.c = { mesh = "c", material = "o" }
bodies.t = { mesh = "t", material = "s" }
supports = [{ body = "p", surface = "bottom" }]
loads = [{ kind = "body_force", body = "b", value = ["x", 0, "1e-3*z"] }]
ties = [{ slave = { body = "t", surface = "x0" }, master = { body = "p", surface = "x1" }, sliding = true }]
solver = { method = "smalse", max_products = 1000, smalse.balance = 2, subdomains = { p = 2, t = [2, 1, 1] } }
output = { folder = "out", files = ["vtu", "xdmf"], pictures = ["status"], checkpoint = false }

[meshes.p]
shape = "drilled_plate"
hole = 1.0
half_width = 2.0
ends = [-4, 4]
heights = [0, 1]
n_layers = 2
n = 2

[meshes.b]
shape = "bolt"
shank = 0.9
head = 1.6
grip = [0, 1]
head_height = 0.5
n = 2
quadratic = true

[meshes.c]
shape = "half_cylinder"
radius = 1.0
length = 2.0
n = 2
n_length = 3
axis = [0, 1, 0]
degrees = 30.0

[materials.o]
model = "orthotropic"
young_moduli = [10.0, 5.0, 4.0]
poisson_ratios = [0.3, 0.2, 0.1]
shear_moduli = [3.0, 2.0, 1.0]
axis_1 = [1, 1, 0]

[[contacts]]
slave = { body = "b", surface = "head" }
master = { body = "p", surface = "top" }
"""
_LARGE = 10**400
VALUES: list[Any] = [
    0, -1, 1, 2, 3, 7, 10**4, 10**9, 10**18, 2**63, 10**30, _LARGE, -_LARGE, 0.0, -0.0, 1e-320, 1e-300,
    1e-20, 1e150,
    1e300, -1e300, float("inf"), float("nan"), 0.5, True, False, "", " ", "free", "x", "1/0", "x/0",
    "log(x)", "1e400",
    "9**9**9", "z", "x # y", "+".join(["x"] * 300), "-" * 900 + "x", "(" * 300 + "x" + ")" * 300, "a" *
    5000, "a\0b",
    "\x1b[31m", "\u202e", "\u2028", "é", "a\nb", "../..", "/", "/dev/zero", ".", "no.py:A", "no.msh",
    "auto", "<x>",
    "<block>", "a|b", "{needed}", "%s", [], [[]], {}, {"": 1}, {"a": {"b": {}}}, [1], [1, 2], [1, 2, 3],
    [10**9] * 3,
    [10**9] * 2, [_LARGE] * 3, [0.0] * 3, [-1.0] * 3, [1e300] * 3, [1e-300] * 3, [1e308, -1e308, 1e308],
    ["x"] * 3,
    ["1/0"] * 3, ["free"] * 3, ["free"] * 2, list(range(50)), [float("nan")] * 3, [True] * 3,
]  # fmt: skip
KEYS = (
    "", "x", "\x1b[0m", "a.b", "é", "<block>", "name", "value", "quadratic", "a" * 300, "grading", "kind",
    "file"
)  # fmt: skip
PIECES = (
    "\0", "\x1b", "\ufeff", "\x85", "\u2028", "\r", '"', "'", "[", "]", "{", "}", "=", "#", ",", ".",
    "\\", "1e",
    "-", '"""', "\x0c",
)  # fmt: skip


def bases() -> dict[str, str]:
    """Return the scenes that mistakes are made in."""
    found = {"good": GOOD, "plane": PLANE, "solid": SOLID}
    for name, changes in _COARSER.items():
        text = (ROOT / "demos" / "scenes" / f"{name}.toml").read_text(encoding="utf-8")
        for old, new in changes:
            assert old in text, old
            text = text.replace(old, new)
        found[name] = text
    return found


def mutated(seed: int) -> tuple[str, list[str]]:
    """Return a scene file with one to three random mistakes, and overrides of the command line."""
    rng = random.Random(seed)
    scenes = bases()
    text, overrides = scenes[rng.choice(sorted(scenes))], []
    for _ in range(rng.choice([1, 1, 1, 2, 3])):
        how = rng.random()
        if how < 0.55:
            text = _other_value(rng, text)
        elif how < 0.8:
            text = _other_text(rng, text)
        else:
            overrides.append(_override(rng, text))
    return text, overrides


def _other_value(rng: random.Random, text: str) -> str:
    """Put another value, or none, in the place of one of the file."""
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        return text
    places = list(_places(data))
    if not places:
        return text
    owner, key = rng.choice(places)
    what = rng.random()
    if what < 0.75:
        owner[key] = rng.choice(VALUES)
    elif what < 0.85:
        owner.pop(key)
    elif isinstance(owner, dict):
        owner[rng.choice(KEYS)] = rng.choice(VALUES)
    else:
        owner.append(rng.choice(VALUES))
    return "\n".join(f"{json.dumps(name)} = {as_toml(value)}" for name, value in data.items())


def _other_text(rng: random.Random, text: str) -> str:
    """Cut, move, double or spoil a line."""
    lines = text.split("\n")
    here, there = rng.randrange(len(lines)), rng.randrange(len(lines))
    how = rng.randrange(5)
    if how == 0:
        del lines[here]
    elif how == 1:
        lines.insert(here, lines[there])
    elif how == 2:
        lines[here], lines[there] = lines[there], lines[here]
    elif how == 3:
        lines = lines[:here]
    else:
        at = rng.randrange(len(lines[here]) + 1)
        lines[here] = lines[here][:at] + rng.choice(PIECES) + lines[here][at:]
    return "\n".join(lines)


def _override(rng: random.Random, text: str) -> str:
    key = rng.choice(
        ["contacts.0.friction", "bodies.block.mesh", "meshes.m.counts.1", "solver", "steps.1.count"]
    )
    key += rng.choice(["", "", "", ".x", ".0", "[", '"', "\x1b", ".99999999999999999999"])
    return f"{key}{rng.choice(['=', '==', '', ' = '])}{as_toml(rng.choice(VALUES))}"


def _places(data: Any) -> Iterator[tuple[Any, Any]]:
    for key in list(data) if isinstance(data, dict) else range(len(data)):
        yield data, key
        if isinstance(data[key], dict | list):
            yield from _places(data[key])


def as_toml(value: Any) -> str:
    """Write a value as TOML, whatever it is."""
    if isinstance(value, str):
        return json.dumps(value)
    if isinstance(value, list):
        return f"[{', '.join(map(as_toml, value))}]"
    if isinstance(value, dict):
        return f"{{{', '.join(f'{json.dumps(key)} = {as_toml(part)}' for key, part in value.items())}}}"
    return str(value).lower() if isinstance(value, bool) else repr(value)
