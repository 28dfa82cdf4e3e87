"""Metals: a ball pressed into a block that yields without hardening, and a sheet stretched by a punch."""

from __future__ import annotations

from time import process_time

import numpy as np
from mpi4py import MPI
from scipy.interpolate import PchipInterpolator

from benchmarks.others.rows import Row
from fenics_contact import (
    Body,
    BodyMesh,
    ContactPair,
    ContactProblem,
    LoadSequence,
    LoadStep,
    MovingObstacle,
    RigidSphere,
    Scene,
    Support,
    Surface,
    gallery,
)
from fenics_contact.materials import FinitePlasticity, IsotropicElasticity, J2Plasticity
from fenics_contact.mesh import quadratic

YOUNG, YIELD, RADIUS = 2.1e5, 50.0, 500.0
#: Johnson's force by depth: the mean pressure 3 σ_y on a circle whose radius a has a² = δ R / 0.368, N/mm.
JOHNSON = 3.0 * np.pi * RADIUS * YIELD / 0.368
#: Depths, mm: a few steps that are forgotten, then some by a ratio up to the last, and where the mean begins.
BEFORE, LAST, COUNTED = np.geomspace(0.1, 1.5, 8), 3.0, 1.9
RATIO = 1.065


def block(cell: float) -> BodyMesh:
    """Mesh half the section of a block of 800 x 800 mm by cells of nine nodes, equal ones up to 75 mm."""
    fine = np.linspace(0.0, 75.0, round(75.0 / cell) + 1)
    across = np.append(fine, 75.0 + gallery.growing_ticks(725.0, 1.5 * cell, 1.4)[1:])
    down = -gallery.growing_ticks(800.0, cell, 1.3)[::-1]
    return quadratic(gallery.rectangle_lattice([across, down]))


def ball(cell: float) -> BodyMesh:
    """Mesh the ball's lower end, which is held all above."""
    cap = gallery.rectangle((0.0, 0.0), (110.0, 40.0), (round(110.0 / cell), 1))
    x, y = cap.points.T
    return cap.moved(np.column_stack([x, y + RADIUS - np.sqrt(RADIUS**2 - x**2)]))


def raised(depth: float) -> list[Support]:
    """Return what holds the ball, and the block that has come up by a depth."""
    sides = [Support("block", "x0", (0.0, None)), Support("ball", "x0", (0.0, None))]
    return [*sides, Support("block", "y0", (None, depth)), Support("ball", "y1")]


def indentation(cell: float) -> Scene:
    """The block below the ball, 10⁴ times as stiff."""
    bodies = {
        "block": Body(block(cell), J2Plasticity(YOUNG, 0.3, YIELD), axisymmetric=True),
        "ball": Body(ball(cell), IsotropicElasticity(1e4 * YOUNG, 0.3), axisymmetric=True),
    }
    pair = ContactPair(Surface("block", "y1"), Surface("ball", "y0"), discretisation="mortar")
    return Scene(bodies, raised(0.0), contacts=[pair])


def stiffness(cell: float, ratio: float) -> tuple[np.ndarray, LoadSequence]:
    """Return force by depth in the steps of the mean, and their sequence at its end."""
    count = round(np.log(LAST / BEFORE[-1]) / np.log(ratio))
    depths = np.geomspace(BEFORE[-1], LAST, count + 1)[1:]
    sequence = LoadSequence(ContactProblem(indentation(cell), MPI.COMM_SELF, tolerance=1e-6))
    steps = [LoadStep(f"{depth:.3g} mm", supports=raised(depth)) for depth in (*BEFORE, *depths)]
    states = [sequence.advance(step) for step in steps]
    force = np.array([abs(state.contact.force[:, 1].sum()) for state in states])[-count:]
    return (force / depths)[depths > COUNTED], sequence


def ball_rows() -> list[Row]:
    """SSNV506 at a small depth.

    The bar: how far steps are from their mean, and what half the cells and half the steps change that by.
    """
    began = process_time()
    found, sequence = stiffness(5.0, RATIO)
    coarse, slow = (stiffness(10.0, ratio)[0].mean() for ratio in (RATIO, np.sqrt(RATIO)))
    mean = float(found.mean())
    error = np.abs(found - mean).max() + abs(mean - coarse) + abs(slow - coarse)
    return [
        Row(
            f"force by depth, mean from {COUNTED:g} to {LAST:g} mm [N/mm]", mean, float(error), JOHNSON,
            "Johnson, an estimate", others="code_aster at 20 mm 1.5 % above Johnson, at 100 mm 10.5 % below",
            unknowns=2 * sum(body.mesh.n_nodes for body in sequence.scene.bodies.values()),
            products=sequence.state.solution.iterations if sequence.state else 0,
            seconds=process_time() - began, levels=((float(coarse), 0), (float(slow), 0), (mean, 0)),
        )
    ]  # fmt: skip


#: Whole strain of the sheet in thousandths, and its stress, N/mm².
STRAINS = np.array(
    [1.1675, 3.6675, 8.6675, 21.1675, 48.6675, 101.1675, 201.1675, 401.1675, 601.1675, 801.1675, 1001.1675,
     1501.1675, 2001.1675]
)  # fmt: skip
STRESSES = np.array(
    [80.56, 162.84, 205.29, 253.28, 305.13, 358.27, 416.09, 483.26, 527.49, 561.30, 589.01, 642.92, 684.14]
)
#: Force of the published pressure at time one, N.
SHEET_LOAD = np.pi * 50.8**2 * 12.33


def sheet(fineness: int) -> Scene:
    """A clamped sheet of radius 59.18 and thickness 1 mm between a rising hemisphere and the die's fillet."""
    across = 59.18 - gallery.growing_ticks(59.18, 1.0 / fineness, 1.08 ** (1.0 / fineness))[::-1]
    mesh = quadratic(gallery.rectangle_lattice([across, np.linspace(0.0, 1.0, 3)]))
    plastic = 1e-3 * STRAINS - STRESSES / 69004.0
    curve = tuple(zip(plastic[1:].tolist(), STRESSES[1:].tolist(), strict=True))
    metal = FinitePlasticity(69004.0, 0.3, yield_stress=80.56, hardening_curve=curve)
    punch = MovingObstacle(RigidSphere((0.0, -50.8), 50.8), lambda way: (None, (0.0, way)))
    return Scene(
        {"sheet": Body(mesh, metal, axisymmetric=True)},
        [Support("sheet", "x1")],
        contacts=[
            ContactPair(Surface("sheet", "y0"), punch),
            ContactPair(Surface("sheet", "y1"), RigidSphere((59.18, 7.35), 6.35)),
        ],
    )


def stretched(fineness: int) -> tuple[np.ndarray, np.ndarray, LoadSequence]:
    """Return the punch's force by the load, and the pole's height, by steps of 2 mm; and their sequence."""
    sequence = LoadSequence(ContactProblem(sheet(fineness), MPI.COMM_SELF, tolerance=1e-6))
    points = sequence.scene.bodies["sheet"].mesh.points
    pole = int(np.argmin(np.linalg.norm(points - np.array([0.0, 1.0]), axis=1)))
    found = [(0.0, 0.0)]
    for way in np.arange(2.0, 36.1, 2.0):
        state = sequence.advance(LoadStep(f"{way:g} mm", time=float(way)))
        force = state.contact.force[state.contact.on_pair(0), 1].sum()
        found.append((force / SHEET_LOAD, state.gather_displacement("sheet")[pole, 1]))
    force, height = np.array(found).T
    return force, height, sequence


def sheet_rows() -> list[Row]:
    """SSNV501: height of the pole by force, by cubics through steps; the bar: what half the cells change."""
    printed = {0.1: (10.6, 9.977), 0.2: (15.4, 15.091), 0.3: (20.0, 19.344), 0.4: (24.7, 23.595),
               0.5: (28.2, 27.622), 0.6: (33.0, 32.000)}  # fmt: skip
    began, loads = process_time(), np.array(list(printed))
    coarse = PchipInterpolator(*stretched(1)[:2])(loads)
    force, height, sequence = stretched(2)
    fine = PchipInterpolator(force, height)(loads)
    seconds = (process_time() - began) / len(loads)
    return [
        Row(
            f"height of the pole at {SHEET_LOAD * load / 1e3:.0f} kN [mm]", float(fine[k]),
            float(abs(fine[k] - coarse[k])), known, "SSNV501, of others", 0.1, f"code_aster {aster:g}",
            unknowns=2 * sequence.scene.bodies["sheet"].mesh.n_nodes,
            products=sequence.state.solution.iterations if sequence.state else 0, seconds=seconds,
            levels=((float(coarse[k]), 0), (float(fine[k]), 0)),
        )
        for k, (load, (known, aster)) in enumerate(printed.items())
    ]  # fmt: skip
