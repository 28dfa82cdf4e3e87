"""A cylinder on a flat that is pressed, then sheared and stretched at once: Nowell and Hills' contact."""

from __future__ import annotations

from dataclasses import dataclass, replace
from time import process_time

import numpy as np
from mpi4py import MPI

from benchmarks.others.rows import Row, accurately, row_of_result
from fenics_contact import (
    Body,
    BodyMesh,
    ContactPair,
    Coulomb,
    Limits,
    LoadStep,
    Pressure,
    RigidSurface,
    Scene,
    State,
    Support,
    Surface,
    gallery,
    solve_steps_to,
)
from fenics_contact.design import Partials, PeakPressure
from fenics_contact.design.forms import ShapeForms
from fenics_contact.design.objective import Weighable
from fenics_contact.design.objectives import on_tangential_rows
from fenics_contact.gallery.blocks import split_quadrilaterals
from fenics_contact.materials import PlaneStrain
from fenics_contact.shapes import Circle
from fenics_contact.theory import LineContact, contact_modulus, hertz_line

YOUNG, POISSON, FRICTION, RADIUS, FORCE = 74e3, 0.33, 0.75, 150.0, 2.8
SHEAR = 0.45 * FORCE
#: Bodies reach 64 half widths to each side; what that changes by falls with its square.
HALVINGS, MARGIN = 8, 3e-4


def hertz() -> LineContact:
    """Return the contact of half planes under the force."""
    return hertz_line(FORCE, 1.0 / RADIUS, contact_modulus(YOUNG, POISSON, YOUNG, POISSON))


def bulk() -> float:
    """Return the bulk stress."""
    return 0.59 * hertz().peak_pressure


def blocks() -> tuple[BodyMesh, BodyMesh]:
    """Mesh the flat and the cylinder's middle, by cells of a quarter of the contact's half width and more."""
    growing = 0.25 * hertz().half_width * 2.0 ** np.arange(HALVINGS + 1)
    depth = np.concatenate([[0.0], growing])
    across = np.concatenate([-growing[::-1], depth])
    flat, round_ = (
        split_quadrilaterals(gallery.rectangle_lattice((across, down))) for down in (-depth[::-1], depth)
    )
    x, y = round_.points.T
    rise = (RADIUS - np.sqrt(RADIUS**2 - x**2)) * (1.0 - y / growing[-1])
    round_ = round_.moved(np.column_stack([x, y + rise]))
    return flat, replace(round_, shapes={"y0": Circle((0.0, RADIUS), RADIUS)})


def held(shear: float, stretch: float) -> list[Support | RigidSurface]:
    """Return what holds the flat, stretched by a strain, and the cylinder under both forces."""
    height = 0.25 * hertz().half_width * 2.0**HALVINGS
    top = RigidSurface("cylinder", "y1", (0.0, height), rotation=0.0, force=(shear, -FORCE))
    return [Support("flat", "y0", (lambda x: stretch * x[:, 0], 0.0)), top]


def steps() -> tuple[LoadStep, LoadStep]:
    """Return pressing, and shear with bulk tension."""
    strain = bulk() * (1.0 - POISSON**2) / YOUNG
    sides = [Pressure("flat", side, -bulk()) for side in ("x0", "x1")]
    return (
        LoadStep("pressed", supports=held(0.0, 0.0)),
        LoadStep("sheared", supports=held(SHEAR, strain), loads=sides),
    )


def fretting() -> Scene:
    """The bodies under the force alone, in plane strain."""
    flat, round_ = blocks()
    material = PlaneStrain(YOUNG, POISSON)
    pair = ContactPair(Surface("flat", "y1"), Surface("cylinder", "y0"), Coulomb(FRICTION), "mortar")
    bodies = {"flat": Body(flat, material), "cylinder": Body(round_, material)}
    return Scene(bodies, held(0.0, 0.0), contacts=[pair])


@dataclass(frozen=True)
class ShearMoment(Weighable):
    """J = ∫ xⁿ q dx of the shear traction q along x, from nodes, [force · lengthⁿ⁻¹]."""

    order: int

    can_be_infinite = False

    def value(self, state: State, forms: ShapeForms) -> float:
        """Return the moment."""
        return float(self._by_force(state) @ state.contact.friction_force[:, 0])

    def partials(self, state: State, forms: ShapeForms) -> Partials:
        """∂J/∂τ_i = xⁿ t_i; bodies do not move by a design here."""
        rows = on_tangential_rows(state, self._by_force(state)[:, None])
        return Partials.of(state, self.value(state, forms), by_multiplier=rows)

    def _by_force(self, state: State) -> np.ndarray:
        contact = state.contact
        along = contact.points.tangents[:, 0, 0] * (contact.normal_force > 0.0)
        return np.asarray(state.contact_places[:, 0] ** self.order * along)


def fretting_rows() -> list[Row]:
    """Largest pressure of both steps, and the stick zone by moments of the shear traction.

    With q = μ p − q*, where q* = μ p0 (c/a) √(1 − ((x − e)/c)²) has the resultant μ P − Q = μ P (c/a)²:
    ∫ x q dx = −e (μ P − Q) and ∫ x² q dx = μ P a²/4 − (μ P − Q) (c²/4 + e²). Friction on the flat is −q.
    Pressing alone calls for no friction, so that the moments are those of all loads at once.
    """
    theory = hertz()
    width, grip = theory.half_width, FRICTION * FORCE
    inside = grip - SHEAR
    shift, stick = width * bulk() / (4.0 * FRICTION * theory.peak_pressure), width * np.sqrt(inside / grip)
    began = process_time()
    peaks = solve_steps_to(
        fretting(), steps(), PeakPressure(0), 2e-3, MPI.COMM_SELF, limits=Limits(levels=18, unknowns=100_000)
    )
    seconds = 0.5 * (process_time() - began)
    rows = [
        row_of_result(
            peak, seconds=seconds, quantity=f"largest pressure, {step.name} [N/mm²]",
            reference=theory.peak_pressure, source="Hertz, half planes", margin=MARGIN,
        )
        for step, peak in zip(steps(), peaks, strict=True)
    ]  # fmt: skip
    sheared = steps()[1].applied_to(fretting())
    first = accurately(
        sheared, ShearMoment(1), 0.02, scale=1.0 / inside,
        quantity="shift e of the stick zone [mm]", reference=shift, source="Nowell and Hills", margin=MARGIN,
    )  # fmt: skip
    second = accurately(sheared, ShearMoment(2), 5e-3, scale=-1.0 / inside, quantity="")
    square = 4.0 * (grip * width**2 / 4.0 / inside - second.value - first.value**2)
    off = 4.0 * (second.error + 2.0 * first.value * first.error)
    return [
        *rows,
        first,
        replace(
            second, quantity="half width c of the stick zone [mm]", value=np.sqrt(square),
            error=off / (2.0 * np.sqrt(square)), reference=stick, source="Nowell and Hills",
            margin=4 * MARGIN, seconds=first.seconds + second.seconds, levels=(),
            products=max(first.products, second.products),
        ),
    ]  # fmt: skip
