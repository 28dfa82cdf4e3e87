"""Two mirrored bodies pressed and sheared to and fro, the lower one stretched: Nowell and Hills' contact."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

from fenics_contact import (
    Body,
    BodyMesh,
    ContactPair,
    ContactProblem,
    Coulomb,
    LoadStep,
    Scene,
    State,
    Support,
    Surface,
    gallery,
    solve_steps,
)
from fenics_contact.materials import PlaneStrain

FRICTION, MATERIAL = 0.4, PlaneStrain(1000.0, 0.3)
#: The load steps of a closed cycle behind the first loading.
CYCLE = ("right", "left", "right again")


def ticks(fine: float, size: float, cell: float) -> np.ndarray:
    """Equal cells up to ``fine``, then growing ones."""
    growing = np.cumsum(1.1 ** np.arange(1, round(np.log1p(0.1 * (size - fine) / cell) / np.log(1.1))))
    return np.concatenate([np.arange(0.0, fine, cell), fine + (size - fine) * growing / growing[-1]])


def half(side: float, scale: float, cell: float) -> BodyMesh:
    """The upper body (side 1) or the lower one (side −1), thirty contacts wide, of radius 2000 ``scale``."""
    size, radius = 30.0 * scale, 2000.0 * scale
    across = ticks(1.25 * scale, size, cell * scale)
    down = ticks(2.0 * cell * scale, size, cell * scale)
    lines = np.concatenate([-across[:0:-1], across]), down if side > 0 else -down[::-1]
    mesh = gallery.rectangle_lattice(lines)
    x, y = mesh.points.T
    return mesh.moved(np.column_stack([x, y + side * x**2 / (2 * radius) * (1 - np.abs(y) / size)]))


def fretted(
    strain: float, scale: float = 1.0, cell: float = 1 / 16, shear: float = 0.00075
) -> Sequence[State]:
    """The states of the cycle: sheared to and fro, and the lower body stretched by a strain in phase."""
    bodies = {
        "upper": Body(half(1.0, scale, cell), MATERIAL),
        "lower": Body(half(-1.0, scale, cell), MATERIAL),
    }
    pair = ContactPair(Surface("lower", "y1"), Surface("upper", "y0"), Coulomb(FRICTION))

    def step(name: str, sign: float) -> LoadStep:
        way = sign * strain
        sides = [Support("lower", f"x{k}", (way * (2 * k - 1) * 30.0 * scale, None)) for k in (0, 1)]
        base = Support("lower", "y0", (lambda x: way * x[:, 0], 0.0))
        thinner = way * 30.0 * MATERIAL.poisson_ratio / (1 - MATERIAL.poisson_ratio)
        top = Support("upper", "y1", (sign * shear * scale, -(0.00205 + thinner) * scale))
        return LoadStep(name, supports=[base, *sides, top])

    steps = [step("pressed", 0.0), *(step(name, 1.0 - 2.0 * (name == "left")) for name in CYCLE)]
    scene = Scene(bodies, steps[0].supports, contacts=[pair])
    return list(solve_steps(ContactProblem(scene, MPI.COMM_SELF, tolerance=1e-8), steps))[1:]


@dataclass(frozen=True)
class Fretting:
    """The half plane under measured forces, of Nowell and Hills.

    On the slip zones q = μ p; there the stick zone of half width c = a √(1 − Q/(μP)), around x = e, takes
    μ p0 (c/a) √(1 − ((x − e)/c)²) off it. On the surface a traction q0 √(1 − x²/a²) along x makes the
    stress −2 q0 x/a inside, −2 q0 (x/a ∓ √(x²/a² − 1)) outside. Within the stick zone strains of both bodies
    agree: −2 μ p0 e/a + σ = 2 μ p0 e/a, so that e = a σ / (4 μ p0) with the bulk stress σ of the lower one.
    """

    radius: float
    force: float
    shear: float
    bulk: float

    @property
    def half_width(self) -> float:
        stiffness = MATERIAL.young_modulus / (2 * (1 - MATERIAL.poisson_ratio**2))
        return float(np.sqrt(2 * self.force * self.radius / (np.pi * stiffness)))

    @property
    def peak(self) -> float:
        return 2 * self.force / (np.pi * self.half_width)

    @property
    def centre(self) -> float:
        return self.half_width * self.bulk / (4 * FRICTION * self.peak)

    @property
    def stick(self) -> float:
        return self.half_width * float(np.sqrt(1 - self.shear / (FRICTION * self.force)))

    def along(self, x: np.ndarray) -> np.ndarray:
        """σ_xx of the lower surface by shear and bulk stress, without that of the pressure."""

        def of_ellipse(x: np.ndarray, a: float) -> np.ndarray:
            outside = np.sqrt(np.maximum((x / a) ** 2 - 1.0, 0.0))
            return -2.0 * (x / a - np.sign(x) * outside)

        a, c = self.half_width, self.stick
        shear = of_ellipse(x, a) - c / a * of_ellipse(x - self.centre, c)
        return FRICTION * self.peak * shear + self.bulk

    @property
    def edge(self) -> float:
        """The largest tension, at x = −a."""
        return float(self.along(np.array([-self.half_width]))[0])
